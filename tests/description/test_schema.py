"""The printed schema accepts what the reader accepts."""

import tomllib
from importlib import resources

import jsonschema
import pytest

from bad_robot_files import BAD
from dhkit.description import from_toml, robots
from dhkit.description.schema import robot_schema
from dhkit.errors import DescriptionError

# One validator: `jsonschema.validate` checks the schema itself anew at each call.
SCHEMA = jsonschema.Draft202012Validator(robot_schema())
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
    jsonschema.Draft202012Validator.check_schema(SCHEMA.schema)


@pytest.mark.parametrize("name", robots())
def test_library_files_fit_it(name):
    file = resources.files("dhkit.description") / "library" / f"{name}.toml"
    SCHEMA.validate(tomllib.loads(file.read_text("utf-8")))


@pytest.mark.parametrize("name", STRUCTURAL)
def test_bad_files_do_not(name):
    with pytest.raises(jsonschema.ValidationError):
        SCHEMA.validate(tomllib.loads(BAD[name][0]))


WHOLE = """
format = 1
name = "two"
convention = "standard"
units = { length = "m", angle = "rad" }
[[joint]]
name = "first"
type = "revolute"
a = 0.1
alpha = 0
d = 0
theta = 0
velocity = 2
effort = 3
body = { mass = 1, com = [0, 0, 0], inertia = {} }
[parameters]
l1 = 0.5
[configurations]
ready = [0.5]
"""
CHANGES = [
    *(
        (f'name = "{own}"', f'name = "{name}"')
        for own in ("two", "first")
        for name in (" ", "a b", "<b>", "../x", "1")
    ),
    ('name = "two"', 'name = ""'),
    ("l1 = 0.5", '"a b" = 0.5'),
    ("l1 = 0.5", "_l = 0.5"),
    ("ready = [0.5]", '"a b" = [0.5]'),
    ("velocity = 2", "velocity = 0"),
    ("effort = 3", "effort = -1"),
    ("mass = 1", "mass = -1"),
]


@pytest.mark.parametrize(("old", "new"), CHANGES)
def test_names_and_signs_are_refused_by_the_schema_and_by_the_reader(old, new):
    SCHEMA.validate(tomllib.loads(WHOLE))
    from_toml(WHOLE)
    text = WHOLE.replace(old, new, 1)
    assert text != WHOLE
    with pytest.raises(jsonschema.ValidationError):
        SCHEMA.validate(tomllib.loads(text))
    with pytest.raises(DescriptionError):
        from_toml(text)
