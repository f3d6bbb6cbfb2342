"""`dhkit robots`, `dhkit info` and `dhkit fk`: the library, a robot, and the pose of its tool."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any

import numpy as np
import typer

from dhkit.arm import Arm
from dhkit.cli.arguments import joint_values
from dhkit.cli.extract import list_examples
from dhkit.cli.options import Degrees, Json, Robot, read_arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.cli.units import angle_key, joint_entry
from dhkit.description import Description, Joint, pose_parts, robots as library_names
from dhkit.description.parameters import resolved
from dhkit.expressions import substitute
from dhkit.kinematics import classify, tool_reach

app = typer.Typer(rich_markup_mode=None)


@app.command()
def robots(
    examples: Annotated[
        bool, typer.Option("--examples", help="List the chains of the package example-robot-data.")
    ] = False,
    json: Json = False,
) -> None:
    """List the robots of the library."""
    if examples:
        list_examples(json)
        return
    arms = [Arm.load(name).description for name in library_names()]
    if json:
        facts = []
        for arm in arms:
            named = {"name": arm.name, "n": arm.n, "source": arm.source, "kinds": arm.kinds}
            facts.append({**named, "reach_m": tool_reach(arm)})
        print_json(facts)
        return
    rows = [
        (
            arm.name,
            arm.kinds,
            arm.convention.value,
            f"{tool_reach(arm):.2f}",
            _shortened(arm.source),
        )
        for arm in arms
    ]
    print_table(("name", "joints", "DH", "reach [m]", "source"), rows)


@app.command()
def info(robot: Robot, json: Json = False) -> None:
    """Show a robot: its DH table, limits, masses, configurations and warnings."""
    arm = read_arm(robot)
    if json:
        print_json(_facts(arm))
        return
    description = arm.description
    numbers = arm.description.numbers
    reach = f"reach {tool_reach(description):.3g} m (tool from axis 1)"
    say(f"{arm.name}: {description.kinds}, {description.convention.value} DH, {reach}", "bold")
    if description.source:
        say(f"source: {description.source}")
    say(f"\n{arm.dh}\n")
    if description.parameters:
        say(
            "parameters (SI): "
            + ", ".join(f"{k} = {v:.6g}" for k, v in numbers.values.items())
            + "\n"
        )
    rows = [_joint_row(i, joint, description) for i, joint in enumerate(description.joints)]
    print_table(
        (
            "joint",
            "limits",
            "speed",
            "effort",
            "mass [kg]",
            "gear² J [kg m²]",
            "friction",
            "assumed",
        ),
        rows,
    )
    for i, joint in enumerate(description.joints, start=1):
        if len(joint.bodies) > 1:
            bodies = (
                f"{b['name']} of {b['mass_kg']:.4g} kg at {_vector(b['com_m'])} m"
                for b in _bodies(joint, arm)
            )
            say(f"link {i}: {', '.join(bodies)}")
    for coupling in description.couplings:
        i, j = coupling.joints
        say(
            f"joints {i} and {j} both turn a drive: {numbers.coupling[i - 1, j - 1]:.4g} in M{i}{j} (SI)"
        )
    base_mass = f" and {numbers.base_body[0]:.4g} kg of the base" if description.base.body else ""
    say(f"\ninverse kinematics: {arm.family}")
    mass = (
        f"total mass {np.nansum(numbers.mass):.4g} kg"
        if np.isfinite(numbers.mass).any()
        else "no link masses"
    )
    say(f"{mass}{base_mass}, gravity {_vector(numbers.gravity)} m/s²")
    for frame, T in (
        ("base in the world", numbers.T_world_base),
        ("tool in the last frame", numbers.T_last_tool),
    ):
        if not np.array_equal(T, np.eye(4)):
            xyz, angles = pose_parts(T, degrees=True)
            say(f"{frame}: {_vector(xyz)} m, XYZ {_vector(angles)}°")
    for name, q in numbers.configurations.items():
        entries = [_joint_text(x, joint) for x, joint in zip(q, description.joints, strict=True)]
        say(f"{name}: {', '.join(entries)}")
    for warning in description.warnings:
        say(f"warning: {warning}", "yellow")
    if description.notes:
        say(f"\n{description.notes}")


@app.command(context_settings={"ignore_unknown_options": True})
def fk(
    robot: Robot,
    q: Annotated[
        list[str],
        typer.Argument(help="Joint values, or the name of a configuration such as ready."),
    ],
    degrees: Degrees = False,
    frames: Annotated[bool, typer.Option("--frames", help="Print all DH frames too.")] = False,
    json: Json = False,
) -> None:
    """Print where the tool is for given joint values (rad and m)."""
    arm = read_arm(robot)
    values = joint_values(arm, q, degrees)
    T = arm.fk(values)
    link_frames = arm.frames(values)
    if json:
        xyz, angles = pose_parts(T, degrees=degrees)
        pose = {
            "T": T.tolist(),
            "xyz_m": xyz.tolist(),
            angle_key("euler_XYZ", degrees=degrees): angles.tolist(),
        }
        given = joint_entry(arm, "q", values, degrees=degrees)
        print_json(given | pose | ({"frames": link_frames.tolist()} if frames else {}))
        return
    named = [(f"frame {i}", frame) for i, frame in enumerate(link_frames)] if frames else []
    unit = "°" if degrees else "rad"
    rows = []
    for name, frame in [*named, ("tool", T)]:
        xyz, angles = pose_parts(frame, degrees=degrees)
        rows.append((name, *(f"{x:.6f}" for x in (*xyz + 0.0, *angles + 0.0))))
    print_table(
        ("", "x [m]", "y [m]", "z [m]", *(f"{axis} [{unit}]" for axis in ("X", "Y'", "Z''"))), rows
    )
    say(f"\n{np.array2string(T + 0.0, precision=6, suppress_small=True)}")


def _joint_row(i: int, joint: Joint, description: Description) -> tuple[str, ...]:
    numbers = description.numbers
    unit, force, scale = ("°", "N m", 180 / math.pi) if joint.is_revolute else (" m", "N", 1.0)
    limited = np.isfinite(numbers.lower[i])
    return (
        f"{i + 1} {joint.name}",
        f"{numbers.lower[i] * scale:.5g}{unit} to {numbers.upper[i] * scale:.5g}{unit}"
        if limited
        else "unlimited",
        f"{numbers.velocity[i] * scale:.4g}{unit}/s" if joint.velocity is not None else "unlimited",
        f"{numbers.effort[i]:.4g} {force}" if joint.effort is not None else "unlimited",
        "no body" if not joint.bodies else f"{numbers.mass[i]:.4g}",
        f"{numbers.armature[i]:.4g}",
        _friction(numbers.viscous[i], *numbers.coulomb[i].tolist()),
        ", ".join(joint.assumed),
    )


def _friction(viscous: float, forwards: float, backwards: float) -> str:
    """Return a joint's viscous friction, and its dry friction in both directions, as text; empty for no friction."""
    dry = f"{forwards:.3g}" if forwards == -backwards else f"{forwards:.3g}/{backwards:.3g}"
    parts = [
        f"{viscous:.3g} qd" if viscous else "",
        f"±{dry}" if forwards == -backwards and forwards else dry,
    ]
    return " ".join(part for part in parts if part and part != "0")


def _bodies(joint: Joint, arm: Arm) -> list[dict[str, Any]]:
    """Return the name, mass and centre of mass of each body of a link."""
    values = resolved(arm.description.parameters)
    bodies = []
    for body in joint.bodies:
        com = [float(substitute(x, values)) for x in body.com]
        bodies.append(
            {"name": body.name, "mass_kg": float(substitute(body.mass, values)), "com_m": com}
        )
    return bodies


def _joint_text(value: float, joint: Joint) -> str:
    return f"{math.degrees(value):.4g}°" if joint.is_revolute else f"{value:.4g} m"


def _vector(entries: Iterable[float]) -> str:
    return f"({', '.join(f'{entry + 0.0:.5g}' for entry in entries)})"


def _shortened(source: str) -> str:
    return source if len(source) <= 90 else f"{source[:87]}..."


def _number_keys(joint: Joint) -> dict[str, str]:
    """Return the keys, with units, of a joint's numbers, by their names in :class:`~dhkit.description.Numbers`."""
    q, drive = ("rad", "N_m") if joint.is_revolute else ("m", "N")
    armature = "armature_kg_m2" if joint.is_revolute else "armature_kg"
    table = {"theta": "theta_rad", "d": "d_m", "a": "a_m", "alpha": "alpha_rad", "mass": "mass_kg"}
    limits = {
        "lower": f"lower_{q}",
        "upper": f"upper_{q}",
        "velocity": f"velocity_{q}_s",
        "effort": f"effort_{drive}",
    }
    return table | limits | {"armature": armature}


def _facts(arm: Arm) -> dict[str, Any]:
    description = arm.description
    numbers = arm.description.numbers
    fit = classify(description).fit
    joints = []
    for i, joint in enumerate(description.joints):
        facts: dict[str, Any] = {
            "name": joint.name,
            "type": joint.type.value,
            "assumed": list(joint.assumed),
        }
        for column, key in _number_keys(joint).items():
            facts[key] = float(getattr(numbers, column)[i])
        facts["bodies"] = _bodies(joint, arm)
        joints.append(facts)
    return {
        "name": arm.name,
        "n": arm.n,
        "kinds": description.kinds,
        "convention": description.convention.value,
        "reach_m": tool_reach(description),
        "length_sum_m": description.reach,
        "inverse_kinematics": str(arm.family),
        "branches": [] if fit is None else list(fit.branches),
        "gravity_m_s2": numbers.gravity.tolist(),
        "parameters": numbers.values,
        "joints": joints,
        "couplings": [
            {
                "joints": list(c.joints),
                "inertia": float(numbers.coupling[c.joints[0] - 1, c.joints[1] - 1]),
            }
            for c in description.couplings
        ],
        "configurations_rad": {name: q.tolist() for name, q in numbers.configurations.items()},
        "warnings": list(description.warnings),
        "source": description.source,
        "notes": description.notes,
    }
