"""Which public functions take an arm, joint values, a pose, a file or an angle, and how: read from their signatures."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum

from dhkit import Arm

PACKAGES = (
    "description",
    "kinematics",
    "dynamics",
    "symbolic",
    "verification",
    "trajectories",
    "planning",
    "control",
    "model",
    "grading",
    "execution",
    "programs",
    "viewer",
    "lab",
)
FILE = {
    "str | Path",
    "str | Path | None",
    "str | Path | Sequence[str]",
    "str | Path | Sequence[str] | None",
}
JOINTS = {"ArrayLike", "ArrayLike | None", "ArrayLike | str"}
KINDS: dict[str, tuple[str, dict[str, set[str]]]] = {
    "arm": (
        "an `Arm` or its `Description`",
        {
            "description": {"Description", "Robot"},
            "robot": {"Robot", "Robot | None"},
            "arm": {"Robot"},
            "plant": {"Robot | Plant | None", "Robot | Sequence[Robot] | None"},
        },
    ),
    "joint values": (
        "an array (..., n) in rad and m, or the name of a configuration",
        {
            "q": JOINTS,
            "q0": JOINTS,
            "q1": JOINTS,
            "near": JOINTS,
            "start": JOINTS,
            "goal": JOINTS,
            "seed": JOINTS,
            "via": {"Sequence[ArrayLike | str]"},
            "points": {"ArrayLike"},
        },
    ),
    "pose": (
        "an array (4, 4), batches (..., 4, 4) where they make sense; `goal` and `reference` may be one too",
        {"T": {"ArrayLike"}, "T0": {"ArrayLike"}, "T1": {"ArrayLike"}, "poses": {"ArrayLike"}},
    ),
    "file": (
        "a `str` or a `Path`",
        {
            "name": FILE,
            "path": FILE,
            "folder": FILE,
            "directory": FILE,
            "file": FILE,
            "solid": FILE,
            "own": FILE,
            "source": FILE,
            "package_dirs": {"Sequence[str | Path]"},
            "reports": {"Sequence[str | Path]"},
        },
    ),
    "angle": (
        "rad, or degrees where the function has `degrees=True`",
        {"angle": {"float"}, "euler": {"ArrayLike | None"}, "turn": {"float"}, "degrees": {"bool"}},
    ),
}
OTHER_MEANINGS = {
    "seed": {"int", "int | None"},  # of random numbers
    "points": {"int", "float"},  # how many; of a mark
    "path": {"JointPath"},  # of the joints
    "angle": {"str"},  # the unit of a table's angles
    "source": {"str"},  # whose a robot is
    "reports": {"Sequence[GradeReport]"},
    "file": {"str"},  # what messages call it
    "name": {"str", "str | None"},  # of a robot, a joint, a quantity
}
NOT_CALLED = {
    "description.Mesh",
    "grading.GradeReport",
    "grading.Rubric",
    "grading.Variant",
    "grading.VariantKey",
    "kinematics.IKPath",
    "model.ExampleChain",
    "model.Part",
    "programs.CheckReport",
    "symbolic.Lagrangian",
    "symbolic.TextbookDerivation",
    "verification.Agreement",
    "verification.VerificationReport",
    "control.BatchResult",
    "description.Numbers.of",
    "planning.Obstacle.capsule",
    "lab.Assignment",
    "lab.Assignment.require",
    "programs.random_states",
}
"""Results, values of a robot file and steps of other functions: they take what has been checked; points in space."""
COMPUTED = (
    "Array",
    "Array | None",
    "NDArray",
    "casadi.SX",
    "Elements",
    "Scalar",
    "Point",
    "ForwardRef",
)
"""Annotations of what dhkit hands to itself: results' fields, steps of a simulation, symbols."""


@dataclass
class Row:
    """What a public function takes, by kind; and what it takes otherwise than all others."""

    name: str
    takes: dict[str, list[str]] = field(default_factory=dict)
    odd: list[str] = field(default_factory=list)


def rows() -> list[Row]:
    """Return a row for every public function and constructor that takes anything of a kind."""
    found = []
    for name, function in _functions():
        if name in NOT_CALLED:
            continue
        row = Row(name)
        for argument in inspect.signature(function).parameters.values():
            _sort(row, argument)
        if row.takes or row.odd:
            found.append(row)
    return found


def table() -> str:
    """Return the table as Markdown."""
    lines = [
        "# What public functions accept",
        "",
        "Made from the functions' signatures by `tests/test_arguments.py`, which fails where one takes something",
        "otherwise than all others. Arguments of one meaning have one name:",
        "",
        "| kind | accepted | arguments |",
        "|---|---|---|",
    ]
    lines += [f"| {kind} | {words} | {_code(names)} |" for kind, (words, names) in KINDS.items()]
    lines += ["", f"| function | {' | '.join(KINDS)} |", f"|---|{'---|' * len(KINDS)}"]
    lines += [
        f"| `{row.name}` | {' | '.join(_code(row.takes.get(kind, ())) for kind in KINDS)} |"
        for row in rows()
    ]
    return "\n".join(lines) + "\n"


def _code(names: object) -> str:
    return ", ".join(f"`{name}`" for name in names)  # type: ignore[attr-defined]


def _sort(row: Row, argument: inspect.Parameter) -> None:
    annotation = str(argument.annotation)
    for kind, (_, names) in KINDS.items():
        if argument.name not in names or annotation in OTHER_MEANINGS.get(argument.name, ()):
            continue
        if annotation in names[argument.name]:
            row.takes.setdefault(kind, []).append(argument.name)
        elif not annotation.startswith(COMPUTED):
            row.odd.append(f"{argument.name}: {annotation}")


def _functions() -> Iterator[tuple[str, object]]:
    for name, one in _members(Arm):
        yield f"arm.{name}" if inspect.isfunction(vars(Arm).get(name)) else f"Arm.{name}", one
    seen = set()
    for package in PACKAGES:
        module = importlib.import_module(f"dhkit.{package}")
        for name in module.__all__:
            one = getattr(module, name)
            if id(one) in seen:
                continue
            seen.add(id(one))
            if inspect.isclass(one):
                if issubclass(one, (Exception, Enum)):
                    continue
                yield f"{package}.{name}", one
                yield from (
                    (f"{package}.{name}.{inner}", method) for inner, method in _members(one)
                )
            elif inspect.isroutine(inspect.unwrap(one)):
                yield f"{package}.{name}", inspect.unwrap(one)


def _members(owner: type) -> Iterator[tuple[str, object]]:
    bases = [base for base in owner.__mro__ if base.__module__.startswith("dhkit.")]
    members = {name: one for base in reversed(bases) for name, one in vars(base).items()}
    for name, one in members.items():
        function = one.__func__ if isinstance(one, (classmethod, staticmethod)) else one
        if not name.startswith("_") and inspect.isfunction(function):
            yield name, function
