"""The robot file's form, format 1: one definition that validates files and prints as JSON Schema."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PlainValidator,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError

from dhkit.description.bounds import BOUNDS
from dhkit.description.parameters import PARAMETER_NAME
from dhkit.description.toml_text import Document
from dhkit.description.validation import BODY_NAME, NAME
from dhkit.errors import DescriptionError

Entry: TypeAlias = int | Decimal | str
"""A number as the file has it: bare, or text in quotes."""

KeyPath: TypeAlias = tuple[int | str, ...]
"""Keys of tables and places in lists, from the root of a document to a value in it."""

JsonSchema: TypeAlias = dict[str, Any]
"""A JSON Schema, draft 2020-12."""


def expected(text: str) -> PydanticCustomError:
    """Return a fault whose message is the value found and then this text."""
    return PydanticCustomError("expected", "{text}", {"text": text})


def _entry(value: object) -> Entry:
    if isinstance(value, bool) or not isinstance(value, (int, Decimal, float, str)):
        raise expected("a number, or an expression in quotes")
    return Decimal(repr(value)) if isinstance(value, float) else value


def _keyed_inertia(value: object) -> object:
    """Turn a 3x3 list into keys; refuse a list of six, which every tool orders in its own way."""
    if not isinstance(value, list):
        return value
    if len(value) != 3 or not all(isinstance(row, list) and len(row) == 3 for row in value):
        raise expected(
            "keys xx, yy, zz, xy, yz, xz or a 3x3 matrix; tools order plain lists differently"
        )
    rows = []
    for row in value:
        entries = [_entry(entry) for entry in row]
        rows.append(entries)
    for i, j in ((0, 1), (1, 2), (0, 2)):
        if rows[i][j] != rows[j][i]:
            raise expected(f"a symmetric matrix; {rows[i][j]} is not {rows[j][i]}")
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = rows
    return {"xx": xx, "yy": yy, "zz": zz, "xy": xy, "yz": yz, "xz": xz}


def _list_of_tables(value: object) -> object:
    return [value] if isinstance(value, dict) else value


def _one_or_two(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _one_or_three(value: object) -> object:
    return value if isinstance(value, list) else [value] * 3


class _AlsoTakes:
    """Adds to the JSON Schema a second form of a field, which its validator converts to the field's type."""

    def __init__(self, other: Callable[[JsonSchemaValue], JsonSchemaValue]) -> None:
        self.other = other

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        own = handler(schema)
        return {"anyOf": [own, self.other(own)]}


_NUMBER = {"type": ["number", "string"]}
_ROW = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}
_THREE_BY_THREE = _ROW | {"items": _ROW}
Number = Annotated[
    Entry,
    PlainValidator(_entry),
    WithJsonSchema(_NUMBER | {"description": "a number in the file's units, or text in SI"}),
]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Text = Annotated[str, Field(max_length=20_000)]


class Form(BaseModel):
    """A table of the file: known keys only, no conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class UnitsForm(Form):
    """Units of bare a, d, alpha, theta, com, xyz, rpy, limits, velocity, configurations and shapes."""

    length: Literal["m", "mm", "cm", "in"] = "m"
    angle: Literal["rad", "deg"] = "rad"


class InertiaForm(Form):
    """Inertia about the centre of mass, kg m^2, axes of the link's DH frame; products with the tensor's sign."""

    xx: Number = 0
    yy: Number = 0
    zz: Number = 0
    xy: Number = 0
    yz: Number = 0
    xz: Number = 0


_InertiaEntry = Annotated[
    InertiaForm, BeforeValidator(_keyed_inertia), _AlsoTakes(lambda _: _THREE_BY_THREE)
]


class BodyForm(Form):
    """Mass, kg, centre of mass and inertia of a link, or of a part of it, in the link's own DH frame."""

    name: Text = ""
    mass: Number
    com: Triple = Field(default=[0, 0, 0])
    inertia: Annotated[
        InertiaForm, BeforeValidator(_keyed_inertia), _AlsoTakes(lambda _: _THREE_BY_THREE)
    ] = InertiaForm()
    unphysical: bool = False


class DriveForm(Form):
    """Motor and gear, motor side: rotor inertia kg m^2, viscous N m s/rad, Coulomb N m."""

    gear: Number = 1
    rotor_inertia: Number = 0
    viscous: Number = 0
    coulomb: Annotated[
        list[Number],
        BeforeValidator(_one_or_two),
        Field(min_length=1, max_length=2),
        _AlsoTakes(lambda _: _NUMBER),
    ] = [0]


class RoundForm(Form):
    """A cylinder or capsule along z."""

    radius: Number
    length: Number


class BallForm(Form):
    """A sphere."""

    radius: Number


class FrameForm(Form):
    """The DH frame of a link that was locked to another, in the DH frame of that one, and its number in the link."""

    body: Annotated[int, Field(ge=0, le=BOUNDS.joints)] = 0
    xyz: Triple = Field(default=[0, 0, 0])
    rpy: Triple = Field(default=[0, 0, 0])


class ShapeForm(Form):
    """One of mesh, box, cylinder, capsule and sphere, placed in the link's DH frame, or in ``frame``."""

    mesh: Text | None = None
    scale: Annotated[Triple, BeforeValidator(_one_or_three), _AlsoTakes(lambda _: _NUMBER)] = [
        1,
        1,
        1,
    ]
    box: Triple | None = None
    cylinder: RoundForm | None = None
    capsule: RoundForm | None = None
    sphere: BallForm | None = None
    xyz: Triple = Field(default=[0, 0, 0])
    rpy: Triple = Field(default=[0, 0, 0])
    frame: FrameForm = Field(default=FrameForm())
    color: Text | None = None

    @model_validator(mode="after")
    def _exactly_one(self) -> ShapeForm:
        kinds = ("mesh", "box", "cylinder", "capsule", "sphere")
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(given) != 1:
            raise expected(
                f"exactly one of {', '.join(kinds)}; found {' and '.join(given) or 'none'}"
            )
        return self


Shapes = Annotated[
    list[ShapeForm],
    BeforeValidator(_list_of_tables),
    Field(max_length=BOUNDS.shapes, default=[]),
    _AlsoTakes(lambda several: several["items"]),
]


class JointForm(Form):
    """A row of the DH table, and the link that its joint moves."""

    model_config = ConfigDict(json_schema_extra={"not": {"required": ["body", "bodies"]}})

    name: Text = ""
    type: Literal["revolute", "prismatic"]
    a: Number
    alpha: Number
    d: Number
    theta: Number
    limits: Pair | None = None
    velocity: Number | None = None
    effort: Number | None = None
    body: BodyForm | None = None
    bodies: Annotated[list[BodyForm], Field(min_length=1, max_length=BOUNDS.bodies)] | None = None
    drive: DriveForm | None = None
    shape: Shapes
    assumed: list[
        Literal[
            "a", "alpha", "d", "theta", "limits", "velocity", "effort", "body", "drive", "shape"
        ]
    ] = Field(default=[], max_length=10)

    @model_validator(mode="after")
    def _one_of_body_and_bodies(self) -> JointForm:
        if self.body is not None and self.bodies is not None:
            raise PydanticCustomError("text", "found both body and bodies; expected one of them")
        return self


class CouplingForm(Form):
    """Inertia of a drive that two joints turn, kg m^2, kg m or kg; joints by number, from 1."""

    joints: Annotated[
        list[Annotated[int, Field(ge=1, le=BOUNDS.joints)]], Field(min_length=2, max_length=2)
    ]
    inertia: Number


class ToolForm(Form):
    """The tool's frame in DH frame n."""

    xyz: Triple = Field(default=[0, 0, 0])
    rpy: Triple = Field(default=[0, 0, 0])
    shape: Shapes


class BaseForm(ToolForm):
    """Frame 0 in the world, and link 0."""

    body: BodyForm | None = None


class RobotForm(Form):
    """A robot file."""

    format: Literal[1]
    name: Text
    convention: Literal["standard", "modified"]
    units: UnitsForm = UnitsForm()
    gravity: Triple = Field(default=[0, 0, Decimal("-9.81")])
    source: Text = ""
    notes: Text = ""
    drawn: bool = True
    parameters: dict[str, Number] = Field(default={}, max_length=BOUNDS.parameters)
    joint: list[JointForm] = Field(min_length=1, max_length=BOUNDS.joints)
    coupling: Annotated[
        list[CouplingForm],
        BeforeValidator(_list_of_tables),
        Field(max_length=BOUNDS.joints * (BOUNDS.joints - 1) // 2, default=[]),
        _AlsoTakes(lambda several: several["items"]),
    ]
    base: BaseForm = Field(default_factory=lambda: BaseForm.model_validate({}))
    tool: ToolForm = Field(default_factory=lambda: ToolForm.model_validate({}))
    configurations: dict[str, list[Number]] = Field(default={}, max_length=BOUNDS.configurations)


def robot_schema() -> JsonSchema:
    """Return the JSON Schema of robot files, made from the definition that validates them."""
    schema = RobotForm.model_json_schema()
    joint, body = (schema["$defs"][form]["properties"] for form in ("JointForm", "BodyForm"))
    schema["properties"]["name"]["pattern"] = f"^{NAME.pattern}$"
    joint["name"]["pattern"] = f"^({NAME.pattern})?$"
    body["name"]["pattern"] = f"^({BODY_NAME.pattern})?$"
    schema["properties"]["configurations"]["propertyNames"] = {"pattern": f"^{NAME.pattern}$"}
    schema["properties"]["parameters"]["propertyNames"] = {"pattern": f"^{PARAMETER_NAME.pattern}$"}
    for key in ("velocity", "effort"):
        joint[key]["exclusiveMinimum"] = 0
    body["mass"]["minimum"] = 0
    return titled_schema("dhkit robot file, format 1", schema)


def titled_schema(title: str, schema: Mapping[str, object]) -> JsonSchema:
    """Return a file format's JSON Schema, draft 2020-12, under another title."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return head | {key: value for key, value in schema.items() if key != "title"}


def validated(document: Document) -> RobotForm:
    """Check a parsed robot file's keys and types.

    Raises
    ------
    DescriptionError
        The first fault: where, the value found, the value expected.
    """
    try:
        return RobotForm.model_validate(document)
    except ValidationError as error:
        # A mistyped key is also a missing one: the unknown key is the more useful message.
        faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
        raise DescriptionError(_fault_text(faults[0], document)) from None


def _fault_text(error: ErrorDetails, document: Document) -> str:
    path = tuple(error["loc"])
    value = error["input"]
    where = _place_text(path, document)
    match error["type"]:
        case "missing":
            return f"{_place_text(path[:-1], document)}key {path[-1]!r} is missing"
        case "extra_forbidden":
            return f"{_place_text(path[:-1], document)}unknown key {str(path[-1])[:80]!r}{_key_hint(path)}"
        case "too_long" | "too_short":
            return f"{where}found {len(value)} entries; expected {length_bound(error)}"
        case "text":
            return f"{where}{error['msg']}"
        case "model_type" | "dict_type":
            expectation = "a table"
        case "literal_error":
            expectation = str(error["ctx"]["expected"])
        case _:
            expectation = error["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    return f"{where}found {shortened(value)}; expected {expectation}"


def length_bound(error: ErrorDetails) -> str:
    """Return how many entries a list may have that is too long or too short: ``at most 3``."""
    bounds = error["ctx"]
    return (
        f"at most {bounds['max_length']}"
        if "max_length" in bounds
        else f"at least {bounds['min_length']}"
    )


def shortened(value: object) -> str:
    """Return a value of a document as text of 60 characters at most, decimals as they were written."""
    text = str(value) if isinstance(value, Decimal) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def key_text(path: KeyPath) -> str:
    """Return a path of keys and indices as the beginning of a message: ``body.com[0]: ``; empty for no keys."""
    keys = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part[:80]}" for part in path
    ).removeprefix(".")
    return f"{keys}: " if keys else ""


def _place_text(path: KeyPath, document: Document) -> str:
    """Return where a value stands, joints by number and name: ``joint 2 (elbow): body.mass: ``."""
    if path[:1] != ("joint",) or len(path) < 2 or not isinstance(path[1], int):
        return key_text(path)
    row = document["joint"][path[1]]
    name = row.get("name") if isinstance(row, dict) else None
    return f"joint {path[1] + 1}{f' ({name[:40]})' if isinstance(name, str) else ''}: {key_text(path[2:])}"


def _key_hint(path: KeyPath) -> str:
    """Return the known key that is most similar to an unknown one, or all known keys."""
    form: type[Form] = RobotForm
    for part in path[:-1]:
        if isinstance(part, str) and part in form.model_fields:
            form = _form_in(form.model_fields[part].annotation) or form
    known = list(form.model_fields)
    close = difflib.get_close_matches(str(path[-1])[:80], known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; expected one of {', '.join(known)}"


def _form_in(annotation: object) -> type[Form] | None:
    """Return the form that a field's annotation is made of, such as that of a list's entries."""
    if isinstance(annotation, type) and issubclass(annotation, Form):
        return annotation
    return next(filter(None, map(_form_in, get_args(annotation))), None)
