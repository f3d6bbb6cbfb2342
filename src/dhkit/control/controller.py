"""Interface of a controller: called with a state and a setpoint, it returns torques."""

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
        """Return the torques from time t (s) on, shape (n,), N m and N; q and qd are (n,), rad, m and per second."""


@runtime_checkable
class ContinuousController(Protocol):
    """A controller with internal states, such as integrals, which a continuous run integrates with those of the arm."""

    def initial_state(self, q: Array) -> Array:
        """Return the internal states at time 0, shape (m,), for joint values q at the start, shape (n,), rad and m.

        Parameters
        ----------
        q
            Joint values, shape (n,), rad and m.
        """

    def continuous(
        self, t: float, q: Array, qd: Array, setpoint: Setpoint, state: Array
    ) -> tuple[ArrayLike, Array]:
        """Return the torques, shape (n,), N m and N, and the derivatives of the internal states, shape (m,).

        Parameters
        ----------
        t
            Time, s.
        q, qd
            Joint values and rates, shape (n,), rad, m and per second.
        setpoint
            What the reference asks for at this time.
        state
            The controller's own state.
        """


Law: TypeAlias = Callable[[float, Array, Array, Setpoint, Array], tuple[Any, Array]]
"""Function that returns torques and derivatives of internal states, as :meth:`ContinuousController.continuous`."""
NO_STATE: Array = np.zeros(0)


def reset(controller: object) -> None:
    """Call a controller's ``reset()`` if it has one.

    Raises
    ------
    TypeError
        The controller is a class, or cannot be called.
    """
    if isinstance(controller, type):
        raise TypeError(f"controller is the class {controller.__name__}; expected an object of it")
    if controller is not None and not callable(controller):
        raise TypeError(f"controller is {type(controller).__name__}; expected a callable")
    method = getattr(controller, "reset", None)
    if not callable(method):
        return
    try:
        method()
    except Exception as error:
        raise _failure("reset() of the controller", error) from error


def require_fits(controller: object, description: Description) -> None:
    """Require that a controller was made for an arm with the same joints.

    Raises
    ------
    ValueError
        The controller's arm has other joints.
    """
    own = getattr(controller, "description", None)
    if isinstance(own, Description) and own.kinds != description.kinds:
        raise ValueError(
            f"the controller is one of {own.name}, joints {own.kinds}; expected {description.kinds}"
        )


def name_of(controller: object) -> str:
    """Return a controller's name for figures: that of its class, or of the function."""
    if controller is None:
        return "no controller"
    inner = getattr(controller, "inner", None)
    name: str = getattr(controller, "__name__", type(controller).__name__)
    return f"{name}({name_of(inner)})" if inner is not None else name.strip("<>")


def continuous_law(controller: Controller | ContinuousController, q: Array) -> tuple[Array, Law]:
    """Return the internal states at time 0, shape (m,), and the law of a controller in continuous time.

    Parameters
    ----------
    controller
        The controller.
    q
        Joint values at the start, shape (n,), rad and m.

    Raises
    ------
    ValueError
        The controller has ``reset()``, and thus a memory, but no ``initial_state()`` and ``continuous(...)``.
    """
    if isinstance(controller, ContinuousController):
        try:
            state = np.array(controller.initial_state(q.copy()), dtype=float).reshape(-1)
        except Exception as error:
            raise _failure("initial_state of the controller", error) from error
        if not np.isfinite(state).all():
            raise SimulationError("initial_state of the controller has values that are not finite")
        return state, controller.continuous
    if callable(getattr(controller, "reset", None)):
        raise ValueError(
            f"{type(controller).__name__} has reset(), and so a memory between calls, but no initial_state() and"
            " continuous(...); expected a rate in Hz"
        )
    return NO_STATE, lambda t, q, qd, setpoint, state: (controller(t, q, qd, setpoint), NO_STATE)


def call_controller(controller: Callable[..., object], t: float, *arguments: object) -> Any:
    """Call a controller and return its result.

    Raises
    ------
    SimulationError
        The controller raises an exception.
    """
    try:
        return controller(t, *arguments)
    except Exception as error:
        raise _failure("the controller", error, f" at {t:g} s") from error


def _failure(what: str, error: Exception, when: str = "") -> SimulationError:
    """Return a run's error: one line with the method of the controller and the exception that it raised."""
    return SimulationError(
        f"{what} raised {type(error).__name__}{when}: {' '.join(str(error).split())}"
    )


def torques(returned: object, n: int, t: float) -> Array:
    """Return a controller's result as an array of torques, shape (n,), N m and N.

    Raises
    ------
    SimulationError
        Another shape, no numbers, or values that are not finite.
    """
    if returned is None:
        raise SimulationError(
            f"the controller returned None at {t:g} s; expected ({n},) finite torques"
        )
    array = np.asarray(returned)
    if array.dtype.kind not in "fiu" or isinstance(returned, np.ma.MaskedArray):
        kind = array.dtype if isinstance(returned, np.ndarray) else type(returned).__name__
        raise SimulationError(
            f"the controller returned {kind} at {t:g} s; expected ({n},) finite torques"
        )
    tau = array.astype(float)
    if tau.shape != (n,) or not np.isfinite(tau).all():
        found = f"shape {tau.shape}" if tau.shape != (n,) else f"{tau.tolist()}"
        raise SimulationError(
            f"the controller returned {found} at {t:g} s; expected ({n},) finite torques"
        )
    return tau
