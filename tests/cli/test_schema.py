"""`dhkit schema`: each format by its name, as JSON Schema."""

import json

import jsonschema
import pytest

from dhkit.cli import main

TITLES = {
    "robot": "dhkit robot file, format 1",
    "assignment": "dhkit assignment, format 1",
    "sheet": "dhkit answer sheet, format 1",
    "rubric": "dhkit rubric",
    "task": "dhkit task, format 1",
    "motion": "dhkit motion file",
}


@pytest.mark.parametrize("name", TITLES)
def test_a_schema_is_printed(name, capsys):
    with pytest.raises(SystemExit) as exit:
        main(["schema", name])
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert (exit.value.code, schema["title"]) == (0, TITLES[name])
    assert schema["$schema"] == jsonschema.Draft202012Validator.META_SCHEMA["$id"]
    assert not jsonschema.Draft202012Validator(schema).is_valid({"cake": 1})


def test_an_unknown_name_is_told_all_others(capsys):
    with pytest.raises(SystemExit) as exit:
        main(["schema", "rubrics"])
    told = "dhkit: no schema 'rubrics'; expected robot, assignment, sheet, rubric, task, motion\n"
    assert (exit.value.code, capsys.readouterr().err) == (2, told)
