"""The programs of dynamics, and their kernels: each belongs to a pattern of arms, whose numbers are its arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.dynamics.loads import friction_kernel, wrench_kernel
from dhkit.dynamics.regressor import regressor_kernel
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import (
    Graph,
    InertialTable,
    composite_coriolis_matrix,
    composite_mass_matrix,
    inertial_pattern,
    joint_symbols,
    kinetic_energy,
    mass_matrix_derivative,
    potential_energy,
    recursive_bias,
    recursive_forward_dynamics,
    recursive_forward_dynamics_derivatives,
    recursive_gravity,
    recursive_inverse_dynamics,
    recursive_inverse_dynamics_derivatives,
)

if TYPE_CHECKING:
    import casadi

_EXPRESSIONS: Mapping[str, Callable[..., casadi.SX]] = {
    "mass_matrix": composite_mass_matrix,
    "mass_matrix_derivative": mass_matrix_derivative,
    "coriolis_matrix": composite_coriolis_matrix,
    "gravity_torque": recursive_gravity,
    "bias": recursive_bias,
    "inverse_dynamics": recursive_inverse_dynamics,
    "forward_dynamics": recursive_forward_dynamics,
    "inverse_dynamics_derivatives": recursive_inverse_dynamics_derivatives,
    "forward_dynamics_derivatives": recursive_forward_dynamics_derivatives,
    "kinetic_energy": kinetic_energy,
    "potential_energy": potential_energy,
}
"""Derivations of each quantity, as functions of the table and of the joint vectors of ``_STATES``."""
_STATES: Mapping[str, tuple[str, ...]] = {
    "mass_matrix": ("q",),
    "mass_matrix_derivative": ("q",),
    "coriolis_matrix": ("q", "qd"),
    "gravity_torque": ("q",),
    "bias": ("q", "qd"),
    "inverse_dynamics": ("q", "qd", "qdd"),
    "forward_dynamics": ("q", "qd", "tau"),
    "inverse_dynamics_derivatives": ("q", "qd", "qdd"),
    "forward_dynamics_derivatives": ("q", "qd", "tau"),
    "kinetic_energy": ("q", "qd"),
    "potential_energy": ("q",),
}
"""The joint vectors that each quantity depends on."""

_pattern_of = lru_cache(maxsize=512)(inertial_pattern)


def evaluate(
    quantity: str,
    description: Description,
    states: Mapping[str, ArrayLike],
    tail: tuple[int, ...],
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return a quantity of ``_EXPRESSIONS``, shape (..., *tail), at joint vectors by name, each (..., n), in SI units.

    Raises
    ------
    DescriptionError
        A link without a body.
    ValueError, TypeError
        A joint vector of another shape, or not numeric; ``out`` does not fit.
    """
    arrays = [joint_array(description, state, name) for name, state in states.items()]
    run, parameters = dynamics_kernel(quantity, description)
    return fill(run, parameters, arrays, tail, out, threads)


@lru_cache(maxsize=4096)
def dynamics_kernel(quantity: str, description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of a quantity and the arm's values of its parameters, shape (p,), in SI units.

    Raises
    ------
    DescriptionError
        A link without a body.
    """
    pattern, parameters = _pattern_of(description)
    return kernel(quantity, pattern, lambda: dynamics_graph(quantity, description)), parameters


def dynamics_graph(quantity: str, description: Description) -> Graph:
    """Return the program of a quantity, parametric in the arm's numbers.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    quantity
        Name of the quantity, such as ``"inverse_dynamics"``.

    Returns
    -------
    Graph
        Inputs ``parameters`` (see :func:`dhkit.symbolic.inertial_pattern`) and the states, output ``result``.

    Raises
    ------
    KeyError
        No such quantity.
    DescriptionError
        A link without a body.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> graph = dynamics_graph("gravity_torque", library_robot("planar2r"))
    >>> [variable.name for variable in graph.inputs]
    ['parameters', 'q']
    """
    table, parameters = InertialTable.parametric(description)
    symbols = {name: joint_symbols(name, description.n) for name in _STATES[quantity]}
    expression = _EXPRESSIONS[quantity](table, *symbols.values())
    return Graph.of(quantity, {"parameters": parameters, **symbols}, {"result": expression})


@takes_robot
def dynamic_kernels(description: Description) -> list[Kernel]:
    """Return the kernels of friction, wrenches and regressor and, for an arm with bodies, of its equation of motion.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    list[Kernel]
        The kernels that ``arm.compile`` compiles: the first ones alone where a link has no body.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> len(dynamic_kernels(library_robot("planar2r")))
    15
    """
    kernels = [friction_kernel(description.n, smooth) for smooth in (False, True)]
    kernels.append(wrench_kernel(description)[0])
    kernels.append(regressor_kernel(description)[0])
    if all(joint.bodies for joint in description.joints):
        kernels += [dynamics_kernel(quantity, description)[0] for quantity in _EXPRESSIONS]
    return kernels
