"""The quantities of an arm that single calls get from compiled functions; see :mod:`dhkit.kernels.single_calls`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple, TypeAlias

from dhkit.description import Array, Description
from dhkit.dynamics.derivatives import ForwardDynamicsDerivatives, InverseDynamicsDerivatives
from dhkit.dynamics.programs import dynamics_kernel
from dhkit.dynamics.regressor import (
    base_parameter_count,
    base_regressor_kernel,
    regressor_kernel,
)
from dhkit.errors import DhkitError
from dhkit.kernels import FastCall, Kernel, SingleCall, never
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.forward import frames_kernel, tool_kernel
from dhkit.kinematics.jacobian import (
    jacobian_derivative_kernel,
    jacobian_dot_kernel,
    jacobian_kernel,
)
from dhkit.kinematics.numeric_call import NumericCall, numeric_call
from dhkit.kinematics.pose_call import (
    RedundantCall,
    pose_call,
    redundant_call,
)
from dhkit.kinematics.root_intervals import intervals_by_roots
from dhkit.kinematics.solutions import IKSolutions

ArrayCall: TypeAlias = Callable[..., Array | None]
PoseCallLike: TypeAlias = Callable[..., IKSolutions | None]


class _Quantity(NamedTuple):
    kernel: Callable[[Description], tuple[Kernel, Array]]
    tail: Callable[[Description], tuple[int, ...]]
    """Axes of the result after those of the batch."""
    refuses_nan: bool = False
    result_of: Callable[[Array], Any] | None = None
    """What the arm's method returns, from the function's array; the array itself if None."""


def _dynamic(
    name: str, tail: Callable[[Description], tuple[int, ...]], refuses_nan: bool = False
) -> _Quantity:
    return _Quantity(partial(dynamics_kernel, name), tail, refuses_nan)


_QUANTITIES: Mapping[str, _Quantity] = {
    "fk": _Quantity(tool_kernel, lambda _: (4, 4)),
    "frames": _Quantity(frames_kernel, lambda arm: (arm.n + 1, 4, 4)),
    "jacobian": _Quantity(lambda arm: jacobian_kernel(arm, "world"), lambda arm: (6, arm.n)),
    "jacobian_dot": _Quantity(
        lambda arm: jacobian_dot_kernel(arm, "world"), lambda arm: (6, arm.n)
    ),
    "jacobian_derivative": _Quantity(
        lambda arm: jacobian_derivative_kernel(arm, "world"), lambda arm: (arm.n, 6, arm.n)
    ),
    "mass_matrix_derivative": _dynamic("mass_matrix_derivative", lambda arm: (arm.n, arm.n, arm.n)),
    "mass_matrix": _dynamic("mass_matrix", lambda arm: (arm.n, arm.n)),
    "coriolis_matrix": _dynamic("coriolis_matrix", lambda arm: (arm.n, arm.n)),
    "gravity_torque": _dynamic("gravity_torque", lambda arm: (arm.n,)),
    "bias": _dynamic("bias", lambda arm: (arm.n,)),
    "inverse_dynamics": _dynamic("inverse_dynamics", lambda arm: (arm.n,)),
    "regressor": _Quantity(regressor_kernel, lambda arm: (arm.n, 10 * arm.n)),
    "base_regressor": _Quantity(
        base_regressor_kernel, lambda arm: (arm.n, base_parameter_count(arm))
    ),
    "inverse_dynamics_derivatives": _Quantity(
        partial(dynamics_kernel, "inverse_dynamics_derivatives"),
        lambda arm: (3, arm.n, arm.n),
        result_of=InverseDynamicsDerivatives.of,
    ),
    "forward_dynamics_derivatives": _Quantity(
        partial(dynamics_kernel, "forward_dynamics_derivatives"),
        lambda arm: (3, arm.n, arm.n),
        result_of=ForwardDynamicsDerivatives.of,
    ),
    # The ordinary way says why an acceleration is missing.
    "forward_dynamics": _dynamic("forward_dynamics", lambda arm: (arm.n,), refuses_nan=True),
}
"""Quantities by the name of the arm's method, for its default options."""
_SLOW_TO_DERIVE = ("base_regressor",)
"""Quantities that need the symbolic equations of motion: seconds for some arms."""


def _with_result(call: FastCall, result_of: Callable[[Array], Any]) -> FastCall:
    """Return a function whose results are made from the arrays of another one."""

    def converted(*arguments: object) -> Any:
        array = call(*arguments)
        return None if array is None else result_of(array)

    return converted


class ArmCalls:
    """Functions of single states of one arm, by the names of its methods.

    Each takes the states, and ``out`` or None, all by position, and returns None for whatever it does not take.
    """

    fk: ArrayCall
    frames: ArrayCall
    jacobian: ArrayCall
    jacobian_dot: ArrayCall
    jacobian_derivative: ArrayCall
    mass_matrix_derivative: ArrayCall
    mass_matrix: ArrayCall
    coriolis_matrix: ArrayCall
    gravity_torque: ArrayCall
    bias: ArrayCall
    inverse_dynamics: ArrayCall
    forward_dynamics: ArrayCall
    regressor: ArrayCall
    base_regressor: ArrayCall
    inverse_dynamics_derivatives: Callable[..., InverseDynamicsDerivatives | None]
    forward_dynamics_derivatives: Callable[..., ForwardDynamicsDerivatives | None]
    ik: PoseCallLike
    ik_at_redundancy: PoseCallLike
    ik_numeric: PoseCallLike

    def __init__(self, description: Description) -> None:
        self._description = description

    def __getattr__(self, name: str) -> FastCall:
        """Return the function of a quantity that is asked for the first time."""
        call: FastCall | None
        if name == "ik":
            call = self._pose_call()
        elif name == "ik_at_redundancy":
            call = redundant_call(self._description)
        elif name == "ik_numeric":
            call = numeric_call(self._description)
        elif name in _QUANTITIES:
            call = self._single_call(name)
        else:
            raise AttributeError(name)
        setattr(self, name, never if call is None else call)
        function: FastCall = self.__dict__[name]
        return function

    def _pose_call(self) -> FastCall | None:
        """Return the function of inverse kinematics; None of arms that only the ordinary way solves."""
        description = self._description
        found = classify(description)
        if found.family is not None:
            return pose_call(description)
        if found.neighbour is not None or description.kinds != "RRRRRR":
            return None
        from dhkit.kinematics.eliminated_call import elimination_call  # with SciPy's rotations

        return elimination_call(description, partial(setattr, self, "ik"))

    def compile(self) -> Iterator[str]:
        """Compile every quantity now, but for those that are slow to derive, and yield its name."""
        for name in _QUANTITIES:
            if name in _SLOW_TO_DERIVE:
                continue
            call = self._single_call(name)
            if call is not None:
                call.compile()
            yield name
        if hasattr(self.ik, "compile"):
            self.ik.compile()
        if isinstance(self.ik_at_redundancy, RedundantCall):
            self.ik_at_redundancy.compile()
        intervals = intervals_by_roots(self._description)
        if intervals is not None:
            intervals.compile()
        yield "ik"
        if isinstance(self.ik_numeric, NumericCall):
            self.ik_numeric.compile()
        yield "ik_numeric"

    def count(self) -> int:
        """Return the number of quantities."""
        return len(_QUANTITIES) - len(_SLOW_TO_DERIVE) + 2

    def _install(self, name: str, call: FastCall) -> None:
        result_of = _QUANTITIES[name].result_of
        if result_of is not None and call is not never:
            call = _with_result(call, result_of)
        setattr(self, name, call)

    def _single_call(self, name: str) -> SingleCall | None:
        """Return a quantity that is not compiled yet; None where the ordinary way says why not."""
        quantity = _QUANTITIES[name]
        try:
            kernel, parameters = quantity.kernel(self._description)
        except DhkitError:
            return None
        return SingleCall(
            kernel,
            parameters,
            quantity.tail(self._description),
            install=partial(self._install, name),
            refuses_nan=quantity.refuses_nan,
        )
