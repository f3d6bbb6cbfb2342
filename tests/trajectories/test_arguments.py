"""Arguments of motions that are slips: complex numbers, and durations that no double can count with."""

import numpy as np
import pytest

from acceptance import slow_if
from dhkit import Arm, JointPath, Payload, Push, ToolDirection, ToolSpeed
from dhkit.control import LQR

ARM = Arm.load("planar2r")
COMPLEX = np.array([0.5 + 0j, 0.1])
TURN = np.eye(4) + 0j
CALLS = {
    "plan, goal": lambda: ARM.plan([0, 0], COMPLEX),
    "plan, goal with a small imaginary part": lambda: ARM.plan([0, 0], [1.0, 0.5 + 1e-12j]),
    "plan, start": lambda: ARM.plan(COMPLEX, [1, 1]),
    "plan, pose": lambda: ARM.plan([0, 0], TURN),
    "plan, via": lambda: ARM.plan([0, 0], [1, 1], via=[COMPLEX]),
    "plan, velocity": lambda: ARM.plan([0, 0], [1, 1], start_velocity=COMPLEX),
    "fk": lambda: ARM.fk(COMPLEX),
    "jacobian": lambda: ARM.jacobian(COMPLEX),
    "ik": lambda: ARM.ik(TURN),
    "ik, seed": lambda: ARM.ik(ARM.fk([0.1, 0.2]), seed=COMPLEX),
    "ik_numeric": lambda: ARM.ik_numeric(TURN),
    "within_limits": lambda: ARM.ik(ARM.fk([0.1, 0.2])).within_limits(COMPLEX),
    "quintic": lambda: ARM.quintic([0, 0], COMPLEX),
    "spline": lambda: ARM.spline([[0, 0], COMPLEX]),
    "straight_line": lambda: ARM.straight_line(ARM.fk([0.1, 0.2]), TURN),
    "circle": lambda: ARM.circle(ARM.fk([0.1, 0.2]), [0.5 + 0j, 0, 0], [0, 0, 1]),
    "with_tool": lambda: ARM.with_tool(TURN),
    "with_base": lambda: ARM.with_base(TURN),
    "with_payload": lambda: ARM.with_payload(1.0, inertia=np.eye(3) + 0j),
    "Payload": lambda: Payload(1.0, (0, 0, 1j)),
    "inverse_dynamics": lambda: ARM.inverse_dynamics([0, 0], COMPLEX, [0, 0]),
    "simulate": lambda: ARM.simulate(None, COMPLEX, duration=0.1),
    "Push": lambda: Push([1j, 0, 0], begin=0, end=1),
    "LQR": lambda: LQR(ARM, [0, 0], Q=np.eye(4) + 0j),
    "ToolSpeed": lambda: ToolSpeed(1j),
    "ToolDirection": lambda: ToolDirection([1j, 0, 0], [0, 0, 1], 0.1),
    "path": lambda: JointPath.straight(ARM.description, [0, 0], COMPLEX),
    "distance": lambda: ARM.distance(COMPLEX),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", CALLS)
def test_complex_numbers_are_refused(name):
    with pytest.raises(TypeError, match="complex"):
        CALLS[name]()


MOTIONS = {
    "quintic": lambda duration: ARM.quintic([0, 0], [1, 1], duration),
    "cubic": lambda duration: ARM.cubic([0, 0], [1, 1], duration),
    "trapezoidal": lambda duration: ARM.trapezoidal([0, 0], [1, 1], duration),
    "straight_line": lambda duration: ARM.straight_line(
        ARM.fk([0.1, 0.9]), ARM.fk([0.3, 0.9]), [0.1, 0.9], duration
    ),
    "plan": lambda duration: ARM.plan([0, 0], [1, 1], duration=duration, intervals=16),
    "plan, effort": lambda duration: ARM.plan(
        [0, 0], [1, 1], "effort", duration=duration, intervals=16
    ),
    "plan_path": lambda duration: ARM.plan_path(
        JointPath.straight(ARM.description, [0, 0], [1, 1]), "effort", duration=duration
    ),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("duration", [1e300, 1e-300, 0, -1.0, np.inf, np.nan, "2"])
def test_a_duration_that_is_none_is_refused_in_one_line(name, duration, capfd):
    with pytest.raises(
        (ValueError, TypeError), match=r"duration is .*; expected 1e-06 to 1e\+06 s"
    ):
        MOTIONS[name](duration)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["quintic", "plan, effort", slow_if(True, "plan_path")])
def test_long_durations_are_taken(name):
    assert MOTIONS[name](1e4).duration == pytest.approx(1e4)
