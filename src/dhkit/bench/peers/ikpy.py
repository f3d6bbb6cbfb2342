"""ikpy: numeric inverse kinematics in Python, from the URDF that dhkit writes."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from dhkit.arm import Arm
from dhkit.bench.contenders import Contender, Mode, Task, Workload, import_peer, single_task
from dhkit.bench.geometry import bare
from dhkit.description import Array


def contenders() -> tuple[Contender, ...]:
    """Return ikpy's contenders; each call takes one state or pose."""
    return (
        Contender("ikpy forward_kinematics", "fk", Mode.SINGLE, _forward),
        Contender("ikpy inverse_kinematics_frame", "ik", Mode.SINGLE, _inverse),
    )


def _forward(workload: Workload) -> Task:
    chain, moving = _chain(workload.arm)
    # A state of the chain has an entry for each joint, fixed ones too.
    states = np.zeros((min(len(workload.q), 10_000), len(moving)))
    states[:, moving] = workload.q[: len(states)]
    return single_task(chain.forward_kinematics, states)


def _inverse(workload: Workload) -> Task:
    chain, moving = _chain(workload.arm)
    solve = partial(chain.inverse_kinematics_frame, orientation_mode="all")
    return single_task(solve, workload.T, lambda state: np.asarray(state)[None, moving])


def _chain(arm: Arm) -> tuple[Any, Array]:
    """Return ikpy's chain from the world to the tool, and which of its links move, shape (links,)."""
    package = import_peer("ikpy.chain")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        urdf = Arm(bare(arm.description)).urdf()
        path.write_text(urdf, encoding="utf-8")
        elements = _path_to_tool(urdf)
        names = {joint.name for joint in arm.description.joints}
        moving = [False, *(name in names for name in elements[1::2])]
        chain = package.Chain.from_urdf_file(
            str(path), base_elements=elements, active_links_mask=moving, symbolic=False
        )
    return chain, np.array(moving)


def _path_to_tool(urdf: str) -> list[str]:
    """Return the names from the world to the tool: a link, a joint, a link and so on."""
    joints = ElementTree.fromstring(urdf).findall("joint")  # noqa: S314 - our own text
    parents = {
        _link_name(joint, "child"): (_link_name(joint, "parent"), joint.get("name", ""))
        for joint in joints
    }
    path = ["tool"]
    while path[0] in parents:
        path[:0] = parents[path[0]]
    return path


def _link_name(joint: ElementTree.Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")
