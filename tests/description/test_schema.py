"""The printed schema accepts what the reader accepts."""

import tomllib
from importlib import resources

import jsonschema
import pytest

from bad_robot_files import BAD
from dhkit.description import robots
from dhkit.description.schema import robot_schema

STRUCTURAL = [
    "wrong type",
    "unknown top key",
    "unknown inertia key",
    "missing theta",
    "missing convention",
    "missing mass",
    "com of two",
    "body and bodies",
    "no bodies",
    "17 bodies",
    "a body that is a number",
    "one of the bodies without mass",
    "unknown unit",
    "unknown type",
    "zero joints",
    "200 joints",
    "unknown format",
    "one limit",
]


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(robot_schema())


@pytest.mark.parametrize("name", robots())
def test_library_files_fit_it(name):
    file = resources.files("dhkit.description") / "library" / f"{name}.toml"
    jsonschema.validate(tomllib.loads(file.read_text("utf-8")), robot_schema())


@pytest.mark.parametrize("name", STRUCTURAL)
def test_bad_files_do_not(name):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(BAD[name][0]), robot_schema())
