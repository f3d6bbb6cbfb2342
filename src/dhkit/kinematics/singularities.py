"""Singular configurations in closed form: zeros of the factors of the Jacobian's determinant.

For six joints with a spherical wrist on two parallel axes the determinant is

    abs(det J) = L2 L3 abs(sin(elbow)) abs(x) abs(sin(wrist)),

where x is the distance of the wrist centre from axis 1 along the arm's plane: only the first three joints move it
(Siciliano et al., Robotics, 2009, section 3.3). The same product holds for arms of the UR family, with x of
the point where axes 5 and 6 meet: in the plane, the velocities that joints 2, 3 and 4 give that point differ by those
of two links, and axes 2, 5 and 6 turn the tool like a wrist.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot, world_to_tool
from dhkit.display import html_table, repr_line
from dhkit.errors import ModelError
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import Fit
from dhkit.kinematics.singular_factors import (
    AngleFactor,
    Factor,
    Kind,
    Link,
    ShoulderFactor,
    SlideFactor,
)

_DRAWS = 256
"""Smallest number of random states that are drawn at once to find states that are singular inside limits."""
_MAX_BATCHES = 64
"""Largest number of batches of random states; the second half is drawn without limits if none was found inside."""
_STRETCHED = ("stretched", "folded")
_MAX_WORDS_LENGTH = 200
"""Longest description of a kind in a notebook, characters."""


@dataclass(frozen=True, eq=False)
class Singularities:
    """Singular configurations of an arm; as text, one line for each kind."""

    kinds: tuple[Kind, ...]
    """Names of the kinds: shoulder, elbow, wrist, as in :class:`dhkit.kinematics.IKFlag`."""
    factors: tuple[Factor, ...]
    """Factors of the determinant, one for each kind."""
    point: str
    """The point whose distance from axis 1 vanishes at the shoulder's singularity, such as the wrist centre."""
    task: Array
    """The twists that the arm controls, rows in the tool's axes, shape (n, 6); they make its Jacobian square.

    All six for an arm of six joints; the velocity alone for a turning plane with two joints.
    """

    @property
    def words(self) -> dict[str, str]:
        """The condition for each kind, such as ``q5 = 0° or 180°: axes 4 and 6 coincide``."""
        return {factor.kind: factor.words(self.point) for factor in self.factors}

    @property
    def values(self) -> dict[str, tuple[float, ...]]:
        """Singular positions of the one joint that decides a kind, rad or m; none for the shoulder.

        Angles are in (-pi, pi]; an elbow's first angle stretches the arm, the second folds it.
        """
        return {factor.kind: factor.values for factor in self.factors}

    @property
    def joints(self) -> dict[str, int | None]:
        """Index, from 0, of the joint that decides each kind; None for the shoulder."""
        return {
            factor.kind: None if isinstance(factor, ShoulderFactor) else factor.joint
            for factor in self.factors
        }

    def __str__(self) -> str:
        return "\n".join(f"{kind}: {text}" for kind, text in self.words.items())

    def __repr__(self) -> str:
        return repr_line("Singularities", summary=", ".join(self.kinds))

    def _repr_html_(self) -> str:
        return html_table(
            ("singular", "where"), list(self.words.items()), longest=_MAX_WORDS_LENGTH
        )


@takes_robot
@lru_cache(maxsize=512)
def singularities(description: Description) -> Singularities:
    """Return the singularities of an arm in closed form.

    Parameters
    ----------
    description
        The arm.

    Returns
    -------
    Singularities
        Conditions by kind, in words and as functions of q.

    Raises
    ------
    ModelError
        No closed form is known for this arm; says how its axes lie and which function to use.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> print(singularities(library_robot("irb140")))
    shoulder: the wrist centre is on axis 1: 0.07 + 0.36 cos q2 - 0.38 sin(q2 + q3) = 0
    elbow: q3 = -90° (stretched) or 90° (folded)
    wrist: q5 = 0° or 180°: axes 4 and 6 coincide
    """
    found = classify(description)
    build = None if found.family is None else _BUILDERS.get(found.family.name)
    if build is None or found.fit is None:
        raise ModelError(
            f"{description.name} is {found.words}; its singularities are not known in closed form: manipulability and"
            " singular_values find them numerically"
        )
    factors, point, task = build(found.fit)

    # The rows of a task are in the plane's axes x, u and v, those of the result in the tool's, at zero joint positions:
    # task diag(R, R) with R = R_plane_world R_world_tool, for the velocity and the angular velocity.
    rotation = world_to_tool(description, np.zeros(description.n))[:3, :3]
    rows = task @ np.kron(np.eye(2), _parameters(found.fit)["T_plane_world"][:, :3] @ rotation)
    rows.flags.writeable = False
    return Singularities(tuple(factor.kind for factor in factors), factors, point, rows)


@takes_robot
def measures(description: Description, q: ArrayLike) -> dict[str, Array]:
    """Return a measure of the distance from each kind of singularity, 0 at the singularity, without unit.

    For elbow and wrist it is abs(sin) of the angle; for the shoulder and a prismatic joint, the length over the reach.
    Inverse kinematics flag a branch where one is below 1e-5.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    dict
        For each of :attr:`Singularities.kinds` an array of shape (...).

    Raises
    ------
    ModelError
        See :func:`singularities`.
    ValueError
        q has not shape (..., n).

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("puma560")
    >>> {kind: float(value.round(4)) for kind, value in measures(arm, [0.1, 0.4, -0.8, 0.3, 0.0, 0.2]).items()}
    {'shoulder': 0.3427, 'elbow': 0.6623, 'wrist': 0.0}
    """
    q = joint_array(description, q)
    return {factor.kind: factor.measure(q) for factor in singularities(description).factors}


@takes_robot
def determinant(description: Description, q: ArrayLike) -> Array:
    """Return abs(det J) as the product of its factors, shape (...), at joint positions (..., n), rad and m.

    J is the Jacobian, or for an arm of fewer than six joints ``task @ jacobian(description, q, "tool")``: see
    :attr:`Singularities.task`. SI; raises as :func:`measures` does.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    Array
        Shape (...), SI: for a six-joint arm of revolute joints m^3.

    Raises
    ------
    ModelError
        No closed form is known for this arm.
    ValueError
        q has not shape (..., n).

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> round(float(determinant(library_robot("planar2r"), [0.3, np.pi / 2])), 6)  # 0.5 m and 0.4 m long
    0.2
    """
    q = joint_array(description, q)
    product = np.ones(q.shape[:-1])
    for factor in singularities(description).factors:
        product = product * (factor.size * factor.measure(q))
    return product


@takes_robot
def singular_configurations(
    description: Description, kind: str, count: int, seed: int = 0
) -> Array:
    """Return random joint positions at one kind of singularity, inside the joint limits where possible.

    Parameters
    ----------
    description
        The arm.
    kind
        One of its :attr:`Singularities.kinds`.
    count
        Number of configurations.
    seed
        Seed of the other joints' positions. These are uniform inside limits; without limits over a full turn, or over
        twice the reach to both sides for a prismatic joint. For the shoulder, joint 2 is solved for.

    Returns
    -------
    Array
        Shape (count, n), rad and m.

    Raises
    ------
    ModelError
        See :func:`singularities`; or the arm has no such singularity.
    ValueError
        Another kind.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> q = singular_configurations(library_robot("puma560"), "wrist", 3)
    >>> q.shape, q[:, 4].round(9)
    ((3, 6), array([0., 0., 0.]))
    """
    factor = _factor(description, kind)
    lower, upper = _ranges(description)
    rng = np.random.default_rng(seed)
    inside = [np.empty((0, description.n))]
    outside = [np.empty((0, description.n))]
    for batch in range(_MAX_BATCHES):
        limited = batch < _MAX_BATCHES / 2 or bool(sum(map(len, inside)))
        low, high = (lower, upper) if limited else (-_room(description), _room(description))
        drawn = low + (high - low) * rng.random((max(_DRAWS, count), description.n))
        moved = factor.moved_onto_singularity(drawn, lower, upper, rng)
        moved = moved[np.isfinite(moved).all(axis=1)]
        within = ((moved >= lower) & (moved <= upper)).all(axis=1)
        inside.append(moved[within])
        outside.append(moved[~within])
        if sum(map(len, inside)) >= count:
            break
    found: Array = np.concatenate([*inside, *outside])[:count]
    if len(found) < count:
        where = singularities(description).words[kind]
        raise ModelError(
            f"{description.name}: found {len(found)} of {count} {kind} singularities ({where})"
        )
    return found


def _factor(description: Description, kind: str) -> Factor:
    for factor in singularities(description).factors:
        if factor.kind == kind:
            return factor
    known = ", ".join(map(repr, singularities(description).kinds))
    raise ValueError(f"kind is {kind!r}; {description.name} has {known}")


def _ranges(description: Description) -> tuple[Array, Array]:
    numbers = description.numbers
    room = _room(description)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -room)
    return lower, np.where(np.isfinite(numbers.upper), numbers.upper, room)


def _room(description: Description) -> Array:
    """Return the range to both sides for joints without limits, shape (n,), rad and m; prismatic: twice the reach."""
    return np.where(description.numbers.prismatic, 2 * (description.reach or 1.0), np.pi)


# Factors from the parameters of the families in closed_form. A task is given in the axes x, u, v of the arm's plane.
# x is the distance of the point from axis 1 along that plane, elbow and wrist are the angles of the two AngleFactors.

_Parts: TypeAlias = tuple[tuple[Factor, ...], str, Array]
_WHOLE = np.eye(6)
"""Task of all six coordinates of a twist."""
_VELOCITY = np.eye(6)[:3]
"""Task of the velocity alone."""
_TURNING_TOO = np.eye(6)[[0, 1, 2, 5]]
"""Task of the velocity and the angular velocity about v."""


def _elbow_wrist(fit: Fit) -> _Parts:
    # abs(det J) = abs(x) L2 L3 abs(sin(elbow)) abs(sin(wrist))
    p = _parameters(fit)
    return (
        (_side(p, _links(p)), _elbow(p), _wrist(p, "axes 4 and 6 coincide")),
        "the wrist centre",
        _WHOLE,
    )


def _slide_wrist(fit: Fit) -> _Parts:
    # abs(det J) = abs(x) abs(start + q3) abs(sin(wrist)), with x = a1 + Re(e^(i q2) boom (q3 + start + i lift)).
    p = _parameters(fit)
    boom = complex(*p["boom"])
    length = complex(p["start"], p["lift"])
    side = _side(p, (Link(boom, slide=2), Link(boom * length)))
    return (side, _slide(p, 2), _wrist(p, "axes 4 and 6 coincide")), "the wrist centre", _WHOLE


def _three_parallel(fit: Fit) -> _Parts:
    # The product of the arms with a spherical wrist, where x has a third link: the lever from axis 4 to the point.
    p = _parameters(fit)
    factors = (
        _side(p, (*_links(p), _lever(p))),
        _elbow(p),
        _wrist(p, "axis 6 is parallel to axes 2, 3 and 4"),
    )
    return factors, "the point where axes 5 and 6 meet", _WHOLE


def _yaw_two(fit: Fit) -> _Parts:
    # abs(det J) = abs(x) L2 L3 abs(sin(elbow)) for the velocity alone.
    p = _parameters(fit)
    return (_side(p, _links(p)), _elbow(p)), "the tool", _VELOCITY


def _yaw_three(fit: Fit) -> _Parts:
    # The same product with the turn about v as a fourth coordinate; the lever is a third link in x.
    p = _parameters(fit)
    return (_side(p, (*_links(p), _lever(p))), _elbow(p)), "the tool", _TURNING_TOO


def _parallel_chain(fit: Fit) -> _Parts:
    p = _parameters(fit)
    kinds = fit.structure
    second = [i for i, letter in enumerate(kinds) if letter == "R"][1]

    # abs(det J) = L2 L3 abs(sin(elbow)) for the velocity in the plane, along v too if a joint slides, and the turn
    # about v with three revolute joints.
    rows = [0, 1, *([2] if "P" in kinds else []), *([5] if kinds.count("R") == 3 else [])]
    return (_elbow(p, second, float(p["senses"][second])),), "the tool", np.eye(6)[rows]


def _polar(fit: Fit) -> _Parts:
    # abs(det J) = abs(start + q2) for the velocity in the plane.
    return (_slide(_parameters(fit), 1),), "the tool", np.eye(6)[:2]


_BUILDERS: Mapping[str, Callable[[Fit], _Parts]] = {
    "elbow_wrist": _elbow_wrist,
    "slide_wrist": _slide_wrist,
    "three_parallel": _three_parallel,
    "yaw_two": _yaw_two,
    "yaw_three": _yaw_three,
    "parallel_chain": _parallel_chain,
    "polar": _polar,
}
"""Builders of factors and task, by the family's name."""


def _parameters(fit: Fit) -> dict[str, Array]:
    return {name: np.asarray(value, dtype=float) for name, value in fit.parameters.items()}


def _links(p: Mapping[str, Array]) -> tuple[Link, Link]:
    upper = complex(*p["upper"])
    bend = complex(*p["bend"])
    return Link(float(p["L2"]) * upper), Link(float(p["L3"]) * upper * bend, (float(p["sense3"]),))


def _lever(p: Mapping[str, Array]) -> Link:
    return Link(complex(*p["lever"]), (float(p["sense3"]), float(p["sense4"])))


def _side(p: Mapping[str, Array], links: tuple[Link, ...]) -> ShoulderFactor:
    return ShoulderFactor(float(p["a1"]), links, float(p["offset"]), float(p["reach"]))


def _elbow(p: Mapping[str, Array], joint: int = 2, sense: float | None = None) -> AngleFactor:
    sense = float(p["sense3"]) if sense is None else sense
    size = float(p["L2"] * p["L3"])
    return AngleFactor(
        "elbow", joint, sense, float(np.angle(complex(*p["bend"]))), size, _STRETCHED
    )


def _wrist(p: Mapping[str, Array], words: str) -> AngleFactor:
    return AngleFactor("wrist", 4, 1.0, float(np.angle(complex(*p["wrist"]))), 1.0, (words, words))


def _slide(p: Mapping[str, Array], joint: int) -> SlideFactor:
    return SlideFactor(joint, float(p["start"]), abs(float(p["lift"])), float(p["reach"]))
