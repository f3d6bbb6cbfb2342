"""The assignment file's form, format 1: one definition that validates files and prints as JSON Schema."""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Annotated, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic_core import ErrorDetails, PydanticCustomError

from dhkit.control import CONTROLLERS
from dhkit.description.schema import (
    JsonSchema,
    KeyPath,
    key_text,
    length_bound,
    shortened,
    titled_schema,
)
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import parse
from dhkit.lab.run_settings import OWN
from dhkit.lab.tool_panel import EULER_ORDERS

CONDITIONS = ("pose", "joints", "motion", "own", "answer", "number", "control")
MAX_STEPS = 20
MAX_GOALS = 20
MAX_JOINTS = 32
MAX_TEXT_LENGTH = 4_000
"""Longest text of a step, characters."""
MAX_LINE_LENGTH = 200
"""Longest title, text of a goal and name, characters."""
MAX_EXPRESSION_LENGTH = 200
"""Longest number that is written as an expression, characters."""
MAX_NUMBER = 1e4
"""Largest number, rad or m."""
PANELS = (
    "joints",
    "tool",
    "motion",
    "table",
    "dynamics",
    "workspace",
    "control",
    "transforms",
    "answers",
    "own",
)
"""Names of the lab's panels that an assignment may show, in the order in which the page lists them."""
EARLIER_PANELS = {"submit": "answers"}
"""Names that panels had in earlier versions, which assignments may still have."""
DIRECTION_CONTROLS = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that change the direction of the text after them, and so the text that a reader sees."""


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise PydanticCustomError("expected", "a number, or an expression in quotes")
    if isinstance(value, str) and len(value) > MAX_EXPRESSION_LENGTH:
        raise PydanticCustomError(
            "expected", f"an expression of at most {MAX_EXPRESSION_LENGTH} characters"
        )
    try:
        number = float(parse(value)) if isinstance(value, str) else float(value)
    except ExpressionError as error:
        reason = " ".join(str(error).split())[:150]
        raise PydanticCustomError(
            "expected", "an expression such as pi/2 ({reason})", {"reason": reason}
        ) from None
    except OverflowError:
        number = float("inf")
    if not abs(number) <= MAX_NUMBER:
        raise PydanticCustomError("expected", f"a finite number of at most {MAX_NUMBER:g}")
    return number


def _joint_values(value: object) -> str | tuple[float, ...]:
    if isinstance(value, str) and 0 < len(value) <= MAX_LINE_LENGTH:
        return value
    if not isinstance(value, list) or len(value) > MAX_JOINTS:
        raise PydanticCustomError("expected", "a configuration's name, or a list of joint values")
    return tuple(map(_number, value))


def _readable(text: str) -> str:
    for letter in text:
        if letter in DIRECTION_CONTROLS or (
            unicodedata.category(letter) in ("Cc", "Cs") and letter not in "\n\t"
        ):
            raise PydanticCustomError(
                "text", f"found the control character U+{ord(letter):04X}; expected plain text"
            )
    if not text.strip():
        raise PydanticCustomError("text", "found an empty text; expected words")
    return text


def _in_one_line(text: str) -> str:
    if len(text.splitlines()) > 1:
        raise PydanticCustomError("text", "found several lines; expected one")
    return text


def _panel(name: str) -> str:
    name = EARLIER_PANELS.get(name, name)
    if name not in PANELS:
        raise PydanticCustomError("text", f"no panel {name[:40]!r}{_hint(name, PANELS)}")
    return name


def _order(name: str) -> str:
    if name not in EULER_ORDERS:
        raise PydanticCustomError("expected", f"one of {', '.join(EULER_ORDERS)}")
    return name


def _controller(name: str) -> str:
    if name not in (*CONTROLLERS, OWN):
        raise PydanticCustomError("expected", f"one of {', '.join((*CONTROLLERS, OWN))}")
    return name


STRICT = ConfigDict(extra="forbid")
NUMBER = {"type": ["number", "string"], "description": "a number, or an expression such as pi/2"}
NAME = {"type": "string", "minLength": 1, "maxLength": MAX_LINE_LENGTH}
Number = Annotated[float, PlainValidator(_number), WithJsonSchema(NUMBER)]
Triple = Annotated[tuple[Number, ...], Field(min_length=3, max_length=3)]
JointValues: TypeAlias = Annotated[
    str | tuple[float, ...],
    PlainValidator(_joint_values),
    WithJsonSchema({"anyOf": [NAME, {"type": "array", "items": NUMBER, "maxItems": MAX_JOINTS}]}),
]
Line = Annotated[
    str, Field(max_length=MAX_LINE_LENGTH), AfterValidator(_readable), AfterValidator(_in_one_line)
]
Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH), AfterValidator(_readable)]
Panel = Annotated[
    str, AfterValidator(_panel), Field(json_schema_extra=lambda s: s.update(enum=list(PANELS)))
]
Order = Annotated[
    str, AfterValidator(_order), Field(json_schema_extra=lambda s: s.update(enum=[*EULER_ORDERS]))
]
ControllerName = Annotated[
    str,
    AfterValidator(_controller),
    Field(json_schema_extra=lambda s: s.update(enum=[*CONTROLLERS, OWN])),
]
Points = Annotated[float, Field(strict=True, ge=0, le=1000, allow_inf_nan=False)]
Within = Annotated[float, Field(strict=True, gt=0, le=1, allow_inf_nan=False)]
Seconds = Annotated[float, Field(strict=True, gt=0, le=600, allow_inf_nan=False)]


@dataclass(frozen=True, config=STRICT)
class PoseForm:
    """A pose of the tool: position, m, and Euler angles, rad; without angles the position alone counts."""

    xyz: Triple
    euler: Triple | None = None
    order: Order = "XYZ"


@dataclass(frozen=True, config=STRICT)
class ToleranceForm:
    """Largest differences: position, m; angle between two rotations, rad; joint values, rad or m."""

    position: Within = 0.005
    angle: Within = 0.02
    joint: Within = 0.01


@dataclass(frozen=True, config=STRICT)
class MotionForm:
    """A motion from one configuration to another, within the limits, in at most ``duration`` seconds."""

    begin: JointValues = Field(alias="from")
    end: JointValues = Field(alias="to")
    duration: Seconds | None = None


@dataclass(frozen=True, config=STRICT)
class OwnForm:
    """A function of the person's own program, and the smallest share of its points."""

    function: Literal["fk", "ik", "controller"]
    share: Within = 1.0


@dataclass(frozen=True, config=STRICT)
class AnswerForm:
    """An entry of the robot's equations or kinematics, such as M11 or T, that the Answers panel judges to be right."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,29}$")]


@dataclass(frozen=True, config=STRICT)
class NumberForm:
    """A number that is typed beside the goal, and its largest difference from the value."""

    value: Number
    tolerance: Annotated[float, Field(strict=True, gt=0, le=1e4, allow_inf_nan=False)]


@dataclass(frozen=True, config=STRICT)
class ControlForm:
    """A simulated run whose joint errors, rad and m, stay below ``error`` for a time, s.

    ``reference`` is what it follows, ``payload`` the smallest load, kg, that the controller does not know of.
    """

    error: Within
    seconds: Annotated[float, Field(strict=True, gt=0, le=60, allow_inf_nan=False)] = 3.0
    reference: Literal["sine", "motion"] = "sine"
    payload: Annotated[float, Field(strict=True, ge=0, le=100, allow_inf_nan=False)] = 0.0
    controller: ControllerName | None = None


@dataclass(
    frozen=True,
    config=ConfigDict(
        extra="forbid", json_schema_extra={"oneOf": [{"required": [name]} for name in CONDITIONS]}
    ),
)
class GoalForm:
    """Goal of a step: one of pose, joints, motion, own, answer, number and control."""

    text: Line
    points: Points = 1.0
    pose: PoseForm | None = None
    joints: JointValues | None = None
    motion: MotionForm | None = None
    own: OwnForm | None = None
    answer: AnswerForm | None = None
    number: NumberForm | None = None
    control: ControlForm | None = None
    tolerance: ToleranceForm = Field(default_factory=ToleranceForm)

    @model_validator(mode="after")
    def _exactly_one(self) -> GoalForm:
        given = [name for name in CONDITIONS if getattr(self, name) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "text",
                f"found {' and '.join(given) or 'none'}; expected exactly one of {', '.join(CONDITIONS)}",
            )
        return self


@dataclass(frozen=True, config=STRICT)
class StepForm:
    """A step: a text to read, and goals to reach."""

    title: Line
    text: Text | None = None
    panel: Panel | None = None
    goal: Annotated[tuple[GoalForm, ...], Field(max_length=MAX_GOALS)] = ()


@dataclass(frozen=True, config=STRICT)
class AssignmentForm:
    """An assignment file."""

    kind: Literal["assignment"]
    format: Literal[1]
    title: Line
    robot: Annotated[str, Field(min_length=1, max_length=MAX_LINE_LENGTH)]
    step: Annotated[tuple[StepForm, ...], Field(min_length=1, max_length=MAX_STEPS)]
    start: JointValues | None = None
    panels: Annotated[tuple[Panel, ...], Field(min_length=1, max_length=40)] | None = None


FORMS: dict[str, type] = {
    "step": StepForm,
    "goal": GoalForm,
    "pose": PoseForm,
    "tolerance": ToleranceForm,
    "motion": MotionForm,
    "own": OwnForm,
    "answer": AnswerForm,
    "number": NumberForm,
    "control": ControlForm,
}
"""The forms of tables inside the file, by the keys of the tables."""


def assignment_schema() -> JsonSchema:
    """Return the JSON Schema of assignment files, made from the definition that validates them."""
    return titled_schema("dhkit assignment, format 1", TypeAdapter(AssignmentForm).json_schema())


def validated(document: Mapping[str, object]) -> AssignmentForm:
    """Check a parsed assignment's keys, types and sizes.

    Raises
    ------
    DescriptionError
        The message names the first fault: its place, the value found and the value expected.
    """
    try:
        return TypeAdapter(AssignmentForm).validate_python(dict(document))
    except ValidationError as error:
        # A mistyped key is also a missing one: the unknown key is the more useful message.
        faults = sorted(
            error.errors(), key=lambda fault: fault["type"] != "unexpected_keyword_argument"
        )
        raise DescriptionError(_fault_text(faults[0])) from None


def _fault_text(error: ErrorDetails) -> str:
    path = tuple(error["loc"])
    value = error["input"]
    where = _place_text(path)
    match error["type"]:
        case "missing":
            return f"{_place_text(path[:-1])}key {path[-1]!r} is missing"
        case "unexpected_keyword_argument":
            key = str(path[-1])
            return f"{_place_text(path[:-1])}unknown key {key[:80]!r}{_hint(key, _known_keys(path[:-1]))}"
        case "text":
            return f"{where}{error['msg']}"
        case "too_long" | "too_short":
            return f"{where}found {len(value)} entries; expected {length_bound(error)}"
        case "string_too_long":
            return f"{where}found {len(value)} characters; expected {length_bound(error)}"
        case "dataclass_type":
            expectation = "a table"
        case "tuple_type":
            expectation = "a list"
        case _:
            expectation = error["msg"].removeprefix("Input should be ").replace("a valid ", "a ")
    return f"{where}found {shortened(value)}; expected {expectation}"


def _place_text(path: KeyPath) -> str:
    """Return where a value stands, steps and goals by number: ``step 2: goal 1: pose.xyz[0]: ``."""
    if len(path) > 1 and path[0] in ("step", "goal") and isinstance(path[1], int):
        return f"{path[0]} {path[1] + 1}: {_place_text(path[2:])}"
    return key_text(path)


def _known_keys(path: KeyPath) -> list[str]:
    """Return the keys of the table that a path leads to."""
    names = [part for part in path if isinstance(part, str)]
    form = FORMS[names[-1]] if names else AssignmentForm
    aliases = {"begin": "from", "end": "to"}
    return [aliases.get(field.name, field.name) for field in fields(form)]


def _hint(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name[:80].lower(), known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; expected one of {', '.join(known)}"
