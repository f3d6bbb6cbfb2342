"""Every chain of example-robot-data: tables against Pinocchio on the original file; `make accept` prints them all."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pinocchio as pin
import pytest

from dhkit import Arm, dynamics
from dhkit.description import Convention, world_to_tool
from dhkit.errors import ModelError
from dhkit.model import example_chains, example_robots, example_urdf
from dhkit.model.extraction import extracted
from dhkit.model.urdf_chain import BASE_FRAME, TIP_FRAME, chain_model, chain_of
from dhkit.model.urdf_reader import read_urdf

try:
    INSTALLED = version("example-robot-data")
except PackageNotFoundError:
    INSTALLED = ""
needed = pytest.mark.skipif(
    not INSTALLED, reason="example-robot-data is not installed (414 MB, extra robots)"
)

AGREED = 1e-9
"""m and rotation entries of the tool, and relative of M and g."""
UNROUNDED = 1e-11
"""The tool's, where numbers are kept as computed."""
CHAINS = 200
"""Chains of 2 to 7 joints that version 6.0.0 has at least; fewer mean that the package was not read whole."""


def states(chain, count: int):
    """Return random joint values inside the limits, shape (count, n)."""
    low, high = np.array([one.limits or (-np.pi, np.pi) for one in chain.joints]).T
    return np.random.default_rng(1).uniform(
        np.maximum(low, -10), np.minimum(high, 10), (count, len(chain.joints))
    )


def compare(chain, description, count: int):
    """Return the largest differences of tool, M and g from Pinocchio on the original, by dhkit's own mechanics."""
    model, q = chain_model(chain), states(chain, count)
    data = model.createData()
    base, tip = model.getFrameId(BASE_FRAME), model.getFrameId(TIP_FRAME)
    T, M, g = [], [], []
    for state in q:
        pin.framesForwardKinematics(model, data, state)
        T.append((data.oMf[base].inverse() * data.oMf[tip]).homogeneous)
        upper = np.triu(np.reshape(pin.crba(model, data, state), (model.nv, model.nv)))
        M.append(upper + np.triu(upper, 1).T)
        g.append(np.reshape(pin.computeGeneralizedGravity(model, data, state), model.nv))
    tool = float(np.abs(world_to_tool(description, q) - np.array(T)).max())
    if not all(joint.bodies for joint in description.joints):
        return tool, 0.0, 0.0
    scale_M, scale_g = float(np.abs(M).max()), float(np.abs(g).max())
    weight = float(np.sum(description.numbers.mass)) * 9.81 * description.reach
    return (
        tool,
        float(np.abs(dynamics.mass_matrix(description, q) - M).max()) / (scale_M or 1.0),
        float(np.abs(dynamics.gravity_torque(description, q) - g).max())
        / (max(scale_g, 1e-6 * weight) or 1.0),
    )


@needed
@pytest.mark.slow
@pytest.mark.parametrize("convention", list(Convention))
def test_all_chains_have_tables(law, convention, capsys):
    chains = [chain for chain in example_chains() if 2 <= len(chain.joints) <= 7]
    assert len(chains) >= CHAINS
    count = law.samples(1000)
    with capsys.disabled():
        for example in chains if count == 1000 else chains[::12]:
            chain = chain_of(read_urdf(example.path), example.base, example.tip)
            extraction = extracted(chain, convention=convention, exact=True)
            tool, M, g = compare(chain, extraction.description, count)
            law.holds("tool", tool, AGREED, example.name)
            law.holds("M", M, AGREED, example.name)
            law.holds("g", g, AGREED, example.name)
            if extraction.decimals is None:
                law.holds("tool, numbers as computed", tool, UNROUNDED, example.name)
            if count == 1000:
                rounded = (
                    "as computed"
                    if extraction.decimals is None
                    else f"{extraction.decimals} decimals"
                )
                print(
                    f"\n  {example.name:58s} {convention.value:9s} {tool:.1e} {M:.1e} {g:.1e} {rounded}",
                    end="",
                )


@needed
def test_arms_load_by_name_and_work():
    arm = Arm.load("example:ur5")
    assert arm.n == 6
    assert (
        "spherical" in str(arm.family)
        or "parallel" in str(arm.family)
        or "UR" in str(arm.family).upper()
    )
    T = arm.fk([0.1, -1, 1.2, -0.5, 0.7, 0.2])
    assert arm.ik(T).valid.any()
    assert arm.verify(samples=20).ok
    assert sum(len(joint.shapes) for joint in arm.description.joints) >= 6
    assert Arm.load("example:panda#panda_hand_tcp").n == 7
    with pytest.raises(ModelError, match="no example robot 'r2d2'; there are"):
        Arm.load("example:r2d2")


@needed
def test_names_are_unique_and_the_empty_robot_is_left_out():
    robots = example_robots()
    assert {"ur3", "ur5", "anymal_b_simple", "anymal_c_simple", "panda", "talos_left_arm"} <= set(
        robots
    )
    assert example_urdf("ur3").name == "ur3_robot.urdf"
    names = [chain.name for chain in example_chains()]
    assert len(set(names)) == len(names)


def test_without_the_package_the_message_says_what_to_install(monkeypatch):
    from dhkit.model import example_robots as module

    def missing(name):
        raise PackageNotFoundError(name)

    import sys

    monkeypatch.setattr(sys.modules["dhkit.model.example_robots"], "distribution", missing)
    module.cache_clear()
    try:
        with pytest.raises(
            ModelError, match="example-robot-data is not installed; pip install example-robot-data"
        ):
            Arm.load("example:ur5")
    finally:
        module.cache_clear()
