"""What a controller is: called with a state and a setpoint, it returns torques."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.references import Setpoint
from dhkit.description import Array, Description
from dhkit.errors import SimulationError


class Controller(Protocol):
    """Anything that is called with the time, the joint values, their rates and a setpoint, and returns torques (n,).

    Where it has a method ``reset()``, that is called before each run.
    """

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint, /) -> ArrayLike:
        """Return the torques to give from now on, N m and N."""


@runtime_checkable
class ContinuousController(Protocol):
    """A controller whose internal states, such as integrals, a continuous run integrates with those of the arm."""

    def initial_state(self, q: Array) -> Array:
        """Return the internal states at time 0, shape (m,), of an arm that begins at joint values q (n,)."""

    def continuous(self, t: float, q: Array, qd: Array, setpoint: Setpoint, state: Array) -> tuple[ArrayLike, Array]:
        """Return the torques (n,) and the time derivatives of the internal states (m,)."""


Law: TypeAlias = Callable[[float, Array, Array, Setpoint, Array], tuple[Any, Array]]
"""Torques, and derivatives of internal states, as :meth:`ContinuousController.continuous`."""
NO_STATE: Array = np.zeros(0)


def reset(controller: Any) -> None:
    """Reset a controller that can be.

    Raises
    ------
    TypeError
        It is a class, or cannot be called.
    """
    if isinstance(controller, type):
        raise TypeError(f"controller is the class {controller.__name__}; expected an object of it")
    if controller is not None and not callable(controller):
        raise TypeError(f"controller is {type(controller).__name__}; expected what can be called")
    method = getattr(controller, "reset", None)
    if not callable(method):
        return
    try:
        method()
    except Exception as error:
        text = " ".join(str(error).split())
        raise SimulationError(f"reset() of the controller raised {type(error).__name__}: {text}") from error


def require_fits(controller: Any, description: Description) -> None:
    """Refuse a controller that was made for an arm of other joints.

    Raises
    ------
    ValueError
        Its arm has other joints.
    """
    own = getattr(controller, "description", None)
    if isinstance(own, Description) and own.kinds != description.kinds:
        raise ValueError(f"the controller is one of {own.name}, joints {own.kinds}; expected {description.kinds}")


def name_of(controller: Any) -> str:
    """Return what a controller is called in figures: its class's name, or its own where it is a function."""
    if controller is None:
        return "no controller"
    inner = getattr(controller, "inner", None)
    name: str = getattr(controller, "__name__", type(controller).__name__)
    return f"{name}({name_of(inner)})" if inner is not None else name.strip("<>")


def continuous_law(controller: Any, q: Array) -> tuple[Array, Law]:
    """Return the internal states at time 0, shape (m,), and the law of a controller in continuous time.

    Parameters
    ----------
    controller
        The controller.
    q
        Where the arm begins, shape (n,).

    Raises
    ------
    ValueError
        The controller has ``reset()``, and thus a memory, but no ``initial_state()`` and ``continuous(...)``.
    """
    if isinstance(controller, ContinuousController):
        try:
            state = np.array(controller.initial_state(q.copy()), dtype=float).reshape(-1)
        except Exception as error:
            text = " ".join(str(error).split())
            raise SimulationError(f"initial_state of the controller raised {type(error).__name__}: {text}") from error
        if not np.isfinite(state).all():
            raise SimulationError("initial_state of the controller has values that are not finite")
        return state, controller.continuous
    if callable(getattr(controller, "reset", None)):
        raise ValueError(
            f"{type(controller).__name__} has reset(), and so a memory between calls, but no initial_state() and"
            " continuous(...); expected a rate in Hz"
        )
    return NO_STATE, lambda t, q, qd, setpoint, state: (controller(t, q, qd, setpoint), NO_STATE)


def called(controller: Callable[..., Any], t: float, *arguments: Any) -> Any:
    """Return what a controller returns.

    Raises
    ------
    SimulationError
        It raises an exception.
    """
    try:
        return controller(t, *arguments)
    except Exception as error:
        text = " ".join(str(error).split())
        raise SimulationError(f"the controller raised {type(error).__name__} at {t:g} s: {text}") from error


def torques(returned: Any, n: int, t: float) -> Array:
    """Return what a controller returned as an array, shape (n,).

    Raises
    ------
    SimulationError
        Another shape, no numbers, or values that are not finite.
    """
    if returned is None:
        raise SimulationError(f"the controller returned None at {t:g} s; expected ({n},) finite torques")
    array = np.asarray(returned)
    if array.dtype.kind not in "fiu" or isinstance(returned, np.ma.MaskedArray):
        kind = array.dtype if isinstance(returned, np.ndarray) else type(returned).__name__
        raise SimulationError(f"the controller returned {kind} at {t:g} s; expected ({n},) finite torques")
    tau = array.astype(float)
    if tau.shape != (n,) or not np.isfinite(tau).all():
        found = f"shape {tau.shape}" if tau.shape != (n,) else f"{tau.tolist()}"
        raise SimulationError(f"the controller returned {found} at {t:g} s; expected ({n},) finite torques")
    return tau
