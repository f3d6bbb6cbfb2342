"""py-opw-kinematics against our own kinematics, where it is installed (`pip install -e '.[bench]'`)."""

from __future__ import annotations

import numpy as np
import pytest

from dhkit import Arm, pose
from dhkit.bench import Workload
from dhkit.bench.agreement import judge
from dhkit.bench.peers import opw

pytest.importorskip("py_opw_kinematics")

SAME = 1e-9
"""rad between joint values of one branch: both solve in closed form, and random states are not near singular ones."""
ARMS = ("puma560", "puma560_akb", "irb140", "kr5", "kuka_kr30_3", "adept_viper_s850")


def moved_puma():
    base, tool = pose((0.1, 0.2, 0.3), euler=(0.4, 0.5, 0.6)), pose((0, 0, 0.1), euler=(1, 2, 3))
    return Arm.load("puma560").with_base(base).with_tool(tool)


@pytest.fixture(params=[*ARMS, "moved"])
def arm(request):
    return moved_puma() if request.param == "moved" else Arm.load(request.param)


@pytest.mark.parametrize("contender", opw.contenders(), ids=lambda contender: contender.name)
@pytest.mark.parametrize("threads", [1, 2])
def test_each_contender_agrees_and_can_be_timed(arm, contender, threads):
    workload = Workload.of(arm, 12, threads, seed=0)
    task = contender.setup(workload)
    verdict = judge(workload, contender.quantity, task)
    assert verdict.ok, verdict
    for items in (1, 12):
        task.prepare(items)()


@pytest.mark.parametrize("name", ["py-opw-kinematics inverse", "py-opw-kinematics reach"])
def test_its_branches_are_ours(arm, name):
    workload = Workload.of(arm, 12, 1, seed=0)
    contender = next(contender for contender in opw.contenders() if contender.name == name)
    ours = arm.ik(workload.T)
    for theirs, q, valid in zip(
        contender.setup(workload).answers(12), ours.q, ours.valid, strict=True
    ):
        apart = np.abs(np.remainder(theirs[:, None] - q[valid] + np.pi, 2 * np.pi) - np.pi).max(
            axis=-1
        )
        assert apart.shape == (valid.sum(), valid.sum())
        assert apart.min(axis=0).max() < SAME
        assert apart.min(axis=1).max() < SAME
