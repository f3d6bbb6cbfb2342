"""Forms of answer sheets, tasks and rubrics: JSON Schemas made from the tables that check them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from pydantic import TypeAdapter

from dhkit.description.schema import titled_schema
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.quantity_names import SMALL_HEADS
from dhkit.grading.answers.sheet import (
    ALIASES,
    CHOICES,
    COLUMNS,
    FORMAT,
    JACOBIAN_ROWS,
    KEYS,
    QUANTITY,
    VARIANT_KEYS,
    quantity_names,
    shape_of,
)
from dhkit.grading.bounds import BOUNDS as BORDER
from dhkit.grading.catalogue import LIBRARY
from dhkit.grading.rubric import WEIGHED, Rubric
from dhkit.grading.variants.variants import MOST_DIGITS, USUAL_DIGITS

Schema: TypeAlias = dict[str, Any]
"""A JSON Schema, or a part of one."""
_ENTRY: Schema = {"type": ["string", "number"]}
"""A formula as text, or a number."""
_ANSWER = {"$ref": "#/$defs/Answer"}
MEANINGS = {
    "M": "Mass matrix M(q), n rows of n: kg m^2 of revolute joints, kg of prismatic ones.",
    "C": "Matrix C(q, qd) of Coriolis and centrifugal terms, n rows of n; it is judged by C qd.",
    "h": "Coriolis and centrifugal torques C(q, qd) qd, n entries: N m and N.",
    "g": "Gravity torques g(q), n entries: N m and N.",
    "tau": "Joint torques M qdd + C qd + g, n entries: N m and N.",
    "K": "Kinetic energy, J.",
    "V": "Potential energy, J, counted from any zero.",
    "L": "Lagrangian K - V, J.",
    "T": "Transform from base to tool, 4 rows of 4: lengths in m.",
    "J": "The tool's Jacobian, 6 rows of n: linear (m), then angular; world axes. Planar arms: x, y, or x, y, angle.",
}
"""Descriptions by quantity, without the link transforms."""
_UNITS = dict(zip(COLUMNS, ("rad", "m", "m", "rad"), strict=True))
"""Units of the entries of a table's row."""


def sheet_schema() -> Schema:
    """Return the JSON Schema of answer sheets in TOML."""
    text = "Answers about a robot, as text that is read and never run: SI units and radians."
    answer = {"anyOf": [_ENTRY, {"type": "array", "items": _ANSWER}]}
    return _document("answer sheet", "sheet", text, Answer=answer) | {"required": ["answer"]}


def task_schema() -> Schema:
    """Return the JSON Schema of an instructor's task, the file of ``dhkit grade --task``."""
    return _document("task", "task file", "What was asked for; it goes before what sheets say.")


def rubric_schema() -> Schema:
    """Return the JSON Schema of rubrics, the file of ``dhkit grade --rubric``, from the form that validates them."""
    schema = TypeAdapter(Rubric).json_schema() | {"description": "Weights of the answers."}
    schema["properties"]["weights"]["propertyNames"] = {"pattern": _whole(WEIGHED.pattern)}
    schema["$defs"]["Credit"]["properties"]["mistakes"]["propertyNames"] = {"enum": sorted(LIBRARY)}
    return titled_schema("dhkit rubric", schema)


def _document(noun: str, kind: str, description: str, **definitions: Schema) -> Schema:
    """Return the schema of a document that may contain a rubric, with further definitions."""
    rubric = rubric_schema()
    definitions |= rubric.pop("$defs")
    definitions["Rubric"] = {
        key: value for key, value in rubric.items() if key not in ("$schema", "title")
    }
    table = _table(KEYS[kind], _properties(), description)
    return titled_schema(f"dhkit {noun}, format {FORMAT}", table | {"$defs": definitions})


def _properties() -> Schema:
    """Return the schemas of all keys, of a document and of the tables in it."""
    names = {"type": "array", "items": {"type": "string"}}
    keys = {
        "format": {"const": FORMAT, "description": "Version of the file's format."},
        "robot": _text(
            "Robot: a library name (see `dhkit robots`), or a robot file (.toml) in this file's folder."
        ),
        "student": _text("Student's name."),
        "rubric": {
            "$ref": "#/$defs/Rubric",
            "description": "Weights of the answers, unless --rubric says it; a sheet's own counts where it is alone.",
        },
        "variants": _variants(),
        "q": names
        | {
            "description": "Names of the joint variables (rad, m), one a joint; q1 ... qn unless given."
        },
        "qd": names | {"description": "Names of their rates (rad/s, m/s)."},
        "state": {
            "type": "string",
            "description": "Order of a state vector x of an executed program, such as 'q, qd'.",
        },
        "qdd": names | {"description": "Names of their accelerations (rad/s^2, m/s^2)."},
        "angles": _choice(
            "angles", "Whether angles count from the link before, or from a fixed direction."
        ),
        "parameters": {
            "type": "object",
            "description": "Further names, each an expression in the robot's parameters and in names before it.",
            "additionalProperties": _ENTRY,
            "maxProperties": BOUNDS.names,
        },
        "friction": _switch("Whether tau includes viscous friction."),
        "execute": _switch(
            "Whether programs may be executed where `dhkit grade --execute` asks for it."
        ),
        "packages": names
        | {
            "description": "Packages that executed programs may import; numpy, scipy, sympy and casadi unless given."
        },
        "total_derivative": _switch(
            "Whether L is right up to the time derivative of a function of q."
        ),
        "asked": {
            "type": "array",
            "description": "Quantities that were assigned: a sheet without one of them is incomplete.",
            "items": {"type": "string", "pattern": _whole(QUANTITY.pattern)},
        },
        "proof": _choice(
            "proof", "Whether an answer has to be proved equal, or may be tried at random states."
        ),
        "frames": _choice(
            "frames", "Whether a table may place its frames freely, or must have the robot file's."
        ),
        "zero": _choice(
            "zero", "Whether a table's zero pose is free, or must be the robot file's."
        ),
        "values": _switch(
            "Whether answers in numbers pass that are right at the robot file's values; true if not given."
        ),
        "J_rows": {
            "type": "array",
            "description": "Rows of the Jacobian that are asked for, in the answer's order; all six unless given, or "
            "those that a planar arm has.",
            "items": {"enum": list(JACOBIAN_ROWS)},
            "uniqueItems": True,
        },
        "convention": _choice(
            "convention",
            "Whose Denavit-Hartenberg table it is: the standard one, or Craig's modified.",
        ),
        "rows": {
            "type": "array",
            "description": "A row a joint.",
            "minItems": 1,
            "items": {
                "type": "array",
                "prefixItems": [
                    _ENTRY | {"description": f"{name}, {_UNITS[name]}"} for name in COLUMNS
                ],
                "minItems": len(COLUMNS),
                "maxItems": len(COLUMNS),
            },
        },
        "branches": {
            "type": "array",
            "description": "Solutions, each a list of n formulas (rad, m) of the tool's pose px py pz, r11 ... r33.",
            "minItems": 1,
            "maxItems": BOUNDS.branches,
            "items": {"type": "array", "items": _ENTRY},
        },
    }
    keys |= {
        "joint": {
            "type": "integer",
            "minimum": 1,
            "description": "The joint that a step finds, from 1.",
        },
        "equation": _formulas(
            "Equation that determines the joint from those before, with one equals sign."
        ),
        "solution": _formulas(
            "The joint's value (rad, m), in joints of earlier steps; ± or a list for both roots."
        ),
    }
    keys["steps"] = {
        "type": "array",
        "description": "Steps in the order in which joints are found; instead of branches.",
        "minItems": 1,
        "maxItems": BOUNDS.steps,
        "items": _table(KEYS["step"], keys, "An equation, its solution, or both.")
        | {
            "required": ["joint"],
            "anyOf": [{"required": ["equation"]}, {"required": ["solution"]}],
        },
    }
    tables = {
        "names": _table(KEYS["names"], keys, "The student's own names."),
        "task": _table(KEYS["task"], keys, "What was asked for, where there is a choice."),
        "answer": _answer(
            dh=_table(KEYS["dh"], keys, "A table: theta, d, a, alpha by row."),
            ik=_table(KEYS["ik"], keys, "Inverse kinematics: formulas of branches, or steps.")
            | {"oneOf": [{"required": ["branches"]}, {"required": ["steps"]}]},
        ),
    }
    return keys | tables


def _variants() -> Schema:
    """Return the schema of what varies between students; its keys are those of ``VARIANT_KEYS``."""
    numbers = {
        "type": "array",
        "description": "[lowest, highest] or [lowest, highest, step]: SI units and rad.",
        "items": {"type": "number"},
        "minItems": 2,
        "maxItems": 3,
    }
    texts = {
        "type": "array",
        "items": {"type": "string"},
        "minItems": 1,
        "maxItems": BORDER.varied_parameters,
        "uniqueItems": True,
    }
    properties = {
        "parameters": {
            "type": "object",
            "description": "Ranges of the robot's parameters, by name.",
            "additionalProperties": numbers,
            "maxProperties": BORDER.varied_parameters,
        },
        "robots": texts
        | {"description": "Robots of which each student gets one; the task's robot unless given."},
        "conventions": texts
        | {
            "description": "Conventions of which each student gets one; the robot file's unless given.",
            "items": {"enum": [*CHOICES["convention"]]},
        },
        "payload": numbers
        | {"description": "Range of the mass of a point at the tool, kg; a parameter mp."},
        "digits": {
            "type": "integer",
            "minimum": 1,
            "maximum": MOST_DIGITS,
            "default": USUAL_DIGITS,
            "description": "Significant digits of a range's larger end, which give the step of the range.",
        },
    }
    return _table(VARIANT_KEYS, properties, "What varies between students (`dhkit task variants`).")


def _table(keys: Sequence[str], properties: Schema, description: str) -> Schema:
    known = {key: properties[key] for key in keys}
    return {
        "type": "object",
        "description": description,
        "properties": known,
        "additionalProperties": False,
    }


def _answer(**tables: Schema) -> Schema:
    """Return the schema of the answers: whole quantities, single entries, or tables."""
    whole = {name: _ANSWER | {"description": MEANINGS[name]} for name in quantity_names(0)}
    names = {name: name for name in whole} | ALIASES | SMALL_HEADS
    heads = "|".join(name for name, quantity in names.items() if shape_of(quantity, 1))
    element = rf"(?:{heads})[_{{]*[1-9][0-9_,{{}}]*|A[1-9][0-9_,{{}}]{{2,}}"
    return {
        "type": "object",
        "description": "Formulas in quotes or numbers, alone or in lists; what is empty is not handed in.",
        "properties": whole | tables,
        "patternProperties": {
            _whole("A[1-9][0-9]?"): _ANSWER
            | {"description": "Link transform from link i - 1 to link i, 4 rows of 4."},
            _whole(element): _ENTRY
            | {"description": "A single entry, counted from 1: M11, g_2, A1_14."},
        },
        "additionalProperties": False,
        "minProperties": 1,
    }


def _formulas(description: str) -> Schema:
    """Return the schema of a formula, or of a list of them."""
    return {
        "anyOf": [_ENTRY, {"type": "array", "items": _ENTRY, "maxItems": BOUNDS.steps}],
        "description": description,
    }


def _text(description: str) -> Schema:
    return {"type": "string", "description": description}


def _switch(description: str) -> Schema:
    return {"type": "boolean", "default": False, "description": description}


def _choice(key: str, description: str) -> Schema:
    return {"enum": [*CHOICES[key]], "default": CHOICES[key][0], "description": description}


def _whole(pattern: str) -> str:
    """Return a pattern that matches whole texts only, though JSON Schema searches."""
    return f"^(?:{pattern})$"
