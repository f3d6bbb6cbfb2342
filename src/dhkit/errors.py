"""Exceptions of dhkit: a common base and a few kinds, with messages of one line that say what and where."""

from __future__ import annotations

from typing import Any


def from_checkout(extra: str) -> str:
    """Return the command that installs one of dhkit's extras; the distribution is not published yet.

    Parameters
    ----------
    extra
        Name of an extra in pyproject.toml, such as ``report``.

    Returns
    -------
    str
        A command line.

    Examples
    --------
    >>> from_checkout("report")
    "`.venv/bin/pip install -e '.[report]'` in dhkit's checkout"
    """
    return f"`.venv/bin/pip install -e '.[{extra}]'` in dhkit's checkout"


class DhkitError(Exception):
    """Base of every error that dhkit raises about its input."""


class ExpressionError(DhkitError):
    """Text that is not an expression, or an expression without a finite value."""


class DescriptionError(DhkitError):
    """A robot file, table or assignment that cannot be used.

    Its message names file, joint and key, the value found and the value expected.
    """


class ModelError(DhkitError):
    """A URDF, a mesh or a Pinocchio model that cannot be read or built."""


class MissingPackageError(DhkitError):
    """A package that is needed, and that this installation lacks; the message says how to install it."""


class PlanningError(DhkitError):
    """A trajectory that is infeasible or did not converge: names the constraint."""


class UnreachableError(PlanningError):
    """A pose that the arm cannot reach, where one was required."""


class SimulationError(DhkitError):
    """A simulation that cannot continue: names the time; ``result`` has the rows until then, or is None."""

    result: Any = None


class AnswerError(DhkitError):
    """An answer sheet that cannot be read."""
