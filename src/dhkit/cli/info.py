"""What `dhkit robots`, `dhkit info` and `dhkit fk` show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.description import Array, Description, Joint, pose_parts, robots
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import parse

__all__ = ["forward", "list_robots", "show"]


def kinds(description: Description) -> str:
    """Return one letter a joint, R or P."""
    return "".join("R" if joint.is_revolute else "P" for joint in description.joints)


def list_robots(json: bool) -> None:
    """Print the library."""
    arms = [Arm.load(name).description for name in robots()]
    if json:
        keys = ("name", "n", "source")
        print_json([{key: getattr(arm, key) for key in keys} | {"kinds": kinds(arm)} for arm in arms])
        return
    rows = [(arm.name, kinds(arm), arm.convention.value, f"{arm.reach:.2f}", _first(arm.source)) for arm in arms]
    print_table(("name", "joints", "DH", "reach [m]", "source"), rows)


def show(arm: Arm, json: bool) -> None:
    """Print a robot."""
    if json:
        print_json(_facts(arm))
        return
    description, numbers = arm.description, arm.description.numbers
    say(f"{arm.name}: {kinds(description)}, {description.convention.value} DH, reach {description.reach:.4g} m", "bold")
    if description.source:
        say(f"source: {description.source}")
    say(f"\n{arm.dh}\n")
    if description.parameters:
        say("parameters (SI): " + ", ".join(f"{k} = {v:.6g}" for k, v in numbers.values.items()) + "\n")
    rows = [_joint_row(i, joint, description) for i, joint in enumerate(description.joints)]
    print_table(("joint", "limits", "speed", "effort", "mass [kg]", "gear² J [kg m²]", "assumed"), rows)
    base_mass = f" and {numbers.base_body[0]:.4g} kg of the base" if description.base.body else ""
    say(f"\ntotal mass {np.nansum(numbers.mass):.4g} kg{base_mass}, gravity {_vector(numbers.gravity)} m/s²")
    for what, T in (("base in the world", numbers.T_world_base), ("tool in the last frame", numbers.T_last_tool)):
        if not np.array_equal(T, np.eye(4)):
            xyz, angles = pose_parts(T, degrees=True)
            say(f"{what}: {_vector(xyz)} m, XYZ {_vector(angles)}°")
    for name, q in numbers.configurations.items():
        entries = [_motion(x, joint) for x, joint in zip(q, description.joints, strict=True)]
        say(f"{name}: {', '.join(entries)}")
    for warning in description.warnings:
        say(f"warning: {warning}", "yellow")
    if description.notes:
        say(f"\n{description.notes}")


def forward(arm: Arm, q: Sequence[str], *, degrees: bool, with_frames: bool, json: bool) -> None:
    """Print the tool's pose."""
    values = _joint_values(arm, q, degrees)
    T, frames = arm.fk(values), arm.frames(values)
    if json:
        xyz, angles = pose_parts(T, degrees=degrees)
        shown = {"T": T.tolist(), "position": xyz.tolist(), "euler_XYZ": angles.tolist()}
        print_json({"q": values.tolist()} | shown | ({"frames": frames.tolist()} if with_frames else {}))
        return
    named = [(f"frame {i}", frame) for i, frame in enumerate(frames)] if with_frames else []
    unit = "°" if degrees else "rad"
    rows = []
    for name, pose in [*named, ("tool", T)]:
        xyz, angles = pose_parts(pose, degrees=degrees)
        rows.append((name, *(f"{x:.6f}" for x in (*xyz + 0.0, *angles + 0.0))))
    print_table(("", "x [m]", "y [m]", "z [m]", *(f"{axis} [{unit}]" for axis in ("X", "Y'", "Z''"))), rows)
    say(f"\n{np.array2string(T + 0.0, precision=6, suppress_small=True)}")


def _joint_values(arm: Arm, q: Sequence[str], degrees: bool) -> Array:
    if len(q) == 1 and q[0] in arm.configurations:
        return arm.configurations[q[0]]
    words = [word for part in q for word in part.replace(",", " ").split()]
    if len(words) == 1 and not words[0][:1].isdigit() and words[0][:1] not in "+-.(":
        names = ", ".join(arm.configurations)
        raise DescriptionError(f"{arm.name} has no configuration {words[0]!r}; it has {names or 'none'}")
    if typo := next((word for word in words if word.startswith("--")), None):
        raise DescriptionError(f"no such option: {typo}")
    if len(words) != arm.n:
        raise DescriptionError(f"{len(words)} joint values; expected {arm.n} for {arm.name}")
    try:
        values = np.array([float(parse(word)) for word in words])
    except ExpressionError as error:
        raise DescriptionError(f"joint values: {error}") from None
    return np.where(arm.description.numbers.prismatic, values, np.radians(values)) if degrees else values


def _joint_row(i: int, joint: Joint, description: Description) -> tuple[str, ...]:
    numbers = description.numbers
    unit, force, scale = ("°", "N m", 180 / math.pi) if joint.is_revolute else (" m", "N", 1.0)
    limited = np.isfinite(numbers.lower[i])
    return (
        f"{i + 1} {joint.name}",
        f"{numbers.lower[i] * scale:.5g}{unit} to {numbers.upper[i] * scale:.5g}{unit}" if limited else "unlimited",
        f"{numbers.velocity[i] * scale:.4g}{unit}/s" if joint.velocity is not None else "unlimited",
        f"{numbers.effort[i]:.4g} {force}" if joint.effort is not None else "unlimited",
        "no body" if joint.body is None else f"{numbers.mass[i]:.4g}",
        f"{numbers.armature[i]:.4g}",
        ", ".join(joint.assumed),
    )


def _motion(value: float, joint: Joint) -> str:
    return f"{math.degrees(value):.4g}°" if joint.is_revolute else f"{value:.4g} m"


def _vector(entries: Array) -> str:
    return f"({', '.join(f'{entry + 0.0:.5g}' for entry in entries)})"


def _first(source: str) -> str:
    return source if len(source) <= 90 else f"{source[:87]}..."


def _facts(arm: Arm) -> dict[str, Any]:
    description, numbers = arm.description, arm.description.numbers
    columns = ("theta", "d", "a", "alpha", "lower", "upper", "velocity", "effort", "mass", "armature")
    joints = [
        {"name": joint.name, "type": joint.type.value, "assumed": list(joint.assumed)}
        | {column: float(getattr(numbers, column)[i]) for column in columns}
        for i, joint in enumerate(description.joints)
    ]
    return {
        "name": arm.name,
        "n": arm.n,
        "kinds": kinds(description),
        "convention": description.convention.value,
        "reach": description.reach,
        "gravity": numbers.gravity.tolist(),
        "parameters": numbers.values,
        "joints": joints,
        "configurations": {name: q.tolist() for name, q in numbers.configurations.items()},
        "warnings": list(description.warnings),
        "source": description.source,
        "notes": description.notes,
    }
