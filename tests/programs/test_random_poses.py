"""Random states are what their names say; a function that fails for good is not called again."""

import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import robots
from dhkit.execution.process import Failure, ProgramError
from dhkit.kinematics import classify, singular_values
from dhkit.programs.bounds import BOUNDS
from dhkit.programs.caller import Caller
from dhkit.programs.inverse import SOLUTION_ORDERS
from dhkit.programs.random_poses import (
    poses_out_of_reach,
    random_states,
    regular_states,
    singular_states,
)


@pytest.mark.parametrize("name", ["puma560", "planar2r", "panda", "scara"])
def test_states_are_inside_the_limits_and_regular_or_singular(name):
    if name not in robots():
        pytest.skip("not in the library")
    arm, rng = Arm.load(name), np.random.default_rng(2)
    numbers = arm.description.numbers
    for q in (random_states(arm, rng, 50), regular_states(arm, rng, 20)):
        assert np.all((q >= numbers.lower) & (q <= numbers.upper))

    def ratio(q):
        sigma = singular_values(arm.description, q, "whole")
        return sigma[min(arm.n, 6) - 1] / sigma[0]

    assert min(map(ratio, regular_states(arm, rng, 20))) > 1e-2
    singular = singular_states(arm, rng, 5)
    assert len(singular) if arm.n == 6 else not len(singular)
    assert all(ratio(q) < 1e-9 for q in singular)


def test_poses_out_of_reach_have_no_solutions():
    arm = Arm.load("puma560")
    assert not arm.ik(poses_out_of_reach(arm, np.random.default_rng(0), 20)).valid.any()


def test_orders_of_solving_are_of_the_family_s_own_joints():
    families = {classify(arm.description).name: arm for arm in map(Arm.load, robots())}
    for family in SOLUTION_ORDERS.keys() & families.keys():
        assert max(SOLUTION_ORDERS[family]) < families[family].n


def test_a_function_that_fails_for_good_is_not_called_again():
    class Ended:
        calls = 0
        processor_time = 0.0

        def fk(self, q):
            self.calls += 1
            raise ProgramError("the program ended", Failure.ENDED)

    program = Ended()
    caller = Caller(program, "fk")
    for _ in range(BOUNDS.fatal_failures + 2):
        with pytest.raises(ProgramError):
            caller(np.zeros(2))
    assert program.calls == BOUNDS.fatal_failures
    assert caller.failure_texts() == (f"the program ended ({BOUNDS.fatal_failures} times)",)
