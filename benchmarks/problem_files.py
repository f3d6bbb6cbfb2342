"""Problems that any tool can solve (`python -m benchmarks.problem_files`): benchmarks/problems/NAME.json.

A file has an arm's table, states with their poses, poses with all joint values that reach them, states with their
torques, and motions among obstacles. A state defines a
pose, whose exact pose has the other solutions: each is found in doubles by two methods, and refined by Newton's
method with 50 digits until it changes by less than 1e-40. Poses without a solution lie outside by a known length.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

from benchmarks.motion_problem_files import motions_of
from dhkit import Arm, __version__
from dhkit.description import Array, Description, write_atomically
from dhkit.kinematics.numeric import solve_numerically

FOLDER = Path(__file__).parent / "problems"
ARMS = (
    "puma560",
    "puma560_cao",
    "stanford",
    "irb140",
    "kr5",
    "kuka_kr30_3",
    "adept_viper_s850",
    "ur5",
    "ur10",
    "jaco",
)
REGULAR, NEAR_SINGULAR, NEAR_LIMIT, UNREACHABLE, STATES = 20, 10, 10, 5, 10
"""Number of poses of each kind, and of states for dynamics."""
OFF_SINGULAR = 1e-4
"""Distance, rad or m, of near-singular states from a singular one."""
OFF_LIMIT = 1e-6
"""Distance of a joint from its limit, rad or m."""
LEAST_SINGULAR_VALUE = 0.05
"""Of the Jacobian of regular states, lengths over the reach."""
JUST = 1e-6
"""Distance of just unreachable poses from the last reachable one, share of the reach."""
STARTS = 300
"""Random starts of the second method for each pose."""
SAME = 1e-6
"""Difference of joint values, rad or m, below which two solutions are one."""
DIGITS = 50
REFINED = mp.mpf(10) ** -40


def main() -> None:
    """Write the files of all arms, or of those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="*", default=ARMS)
    for name in parser.parse_args().arms:
        content = problems_of(name)
        write_atomically(FOLDER / f"{name}.json", json.dumps(content, indent=1) + "\n")
        print(f"{name}: {len(content['inverse_kinematics'])} poses")


def problems_of(name: str) -> dict[str, Any]:
    """Return the content of an arm's file."""
    arm = Arm.load(name)
    exact = ExactArm(arm.description)
    rng = np.random.default_rng(sum(name.encode()))
    table = table_of(arm.description)
    return {
        "format": 1,
        "made_by": f"dhkit {__version__}",
        "arm": table,
        "forward_kinematics": [
            {"q": q.tolist(), "T": exact.rounded(exact.pose(q))} for q in states(arm, rng, REGULAR)
        ],
        "inverse_kinematics": [
            *(reachable(arm, exact, q, "regular") for q in states(arm, rng, REGULAR)),
            *(reachable(arm, exact, q, "near singular") for q in near_singular(arm, rng)),
            *(reachable(arm, exact, q, "near limit") for q in near_limit(arm, rng)),
            *unreachable(arm, rng),
        ],
        "dynamics": dynamics_of(arm, rng),
        "motions": motions_of(arm, table),
    }


def table_of(description: Description) -> dict[str, Any]:
    """Return an arm as plain numbers: degrees, since they are exact where radians are not, and metres."""
    numbers = description.numbers
    return {
        "name": description.name,
        "source": description.source,
        "convention": description.convention.value,
        "kinds": description.kinds,
        "theta_deg": [float(np.degrees(x)) for x in numbers.theta],
        "d": numbers.d.tolist(),
        "a": numbers.a.tolist(),
        "alpha_deg": [float(np.degrees(x)) for x in numbers.alpha],
        "base": numbers.T_world_base.tolist(),
        "tool": numbers.T_last_tool.tolist(),
        "lower": [x if np.isfinite(x) else None for x in numbers.lower.tolist()],
        "upper": [x if np.isfinite(x) else None for x in numbers.upper.tolist()],
    }


class ExactArm:
    """Forward kinematics with 50 digits."""

    def __init__(self, description: Description) -> None:
        mp.mp.dps = DIGITS
        table = table_of(description)
        self.is_standard = table["convention"] == "standard"
        self.slides = [kind == "P" for kind in table["kinds"]]
        angles = (table["theta_deg"], table["alpha_deg"])
        self.theta, self.alpha = ([mp.radians(mp.mpf(x)) for x in values] for values in angles)
        self.d, self.a = ([mp.mpf(x) for x in table[key]] for key in ("d", "a"))
        self.base, self.tool = (mp.matrix(table[key]) for key in ("base", "tool"))

    def pose(self, q: Any) -> mp.matrix:
        """Return the tool's pose."""
        T = self.base
        for i, slides in enumerate(self.slides):
            theta = self.theta[i] + (0 if slides else q[i])
            d = self.d[i] + (q[i] if slides else 0)
            about_z = _turn_and_move(2, theta, d)
            about_x = _turn_and_move(0, self.alpha[i], self.a[i])
            T = T * about_z * about_x if self.is_standard else T * about_x * about_z
        return T * self.tool

    def refined(self, q: Array, goal: mp.matrix) -> list[mp.mpf]:
        """Return the joint values near q that reach a pose, by Newton's method on the pose's difference."""
        found = [mp.mpf(x) for x in q]
        for _ in range(20):
            T = self.pose(found)
            columns = []
            step = mp.mpf(10) ** -25
            for i in range(len(found)):
                moved = [x + (step if k == i else 0) for k, x in enumerate(found)]
                columns.append([x / step for x in _difference(self.pose(moved), T)])
            J = mp.matrix(columns).T
            change = mp.lu_solve(J, mp.matrix(_difference(goal, T)))
            found = [x + dx for x, dx in zip(found, change, strict=True)]
            if max(abs(dx) for dx in change) < REFINED:
                return found
        raise ValueError(f"no convergence from {q}")

    @staticmethod
    def rounded(T: mp.matrix) -> list[list[float]]:
        """Return a pose in doubles, shape (4, 4)."""
        return [[float(T[i, j]) for j in range(4)] for i in range(4)]


def _turn_and_move(axis: int, angle: mp.mpf, length: mp.mpf) -> mp.matrix:
    """Return the transform that turns about a coordinate axis, z or x, and moves along it."""
    c, s = mp.cos(angle), mp.sin(angle)
    T = mp.eye(4)
    i, j = ((axis + 1) % 3, (axis + 2) % 3)
    T[i, i], T[i, j], T[j, i], T[j, j] = c, -s, s, c
    T[axis, 3] = length
    return T


def _difference(goal: mp.matrix, T: mp.matrix) -> list[mp.mpf]:
    """Return the translation and the small rotation from T to a pose near it, each 3."""
    R = goal[:3, :3] * T[:3, :3].T
    turn = [(R[2, 1] - R[1, 2]) / 2, (R[0, 2] - R[2, 0]) / 2, (R[1, 0] - R[0, 1]) / 2]
    return [goal[k, 3] - T[k, 3] for k in range(3)] + turn


# States


def states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return random joint values inside the limits, shape (count, n), rounded to 6 digits, not near singular ones."""
    numbers = arm.description.numbers
    room = np.where(numbers.prismatic, 1.0, np.pi)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -room)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, room)
    q = np.round(rng.uniform(lower, upper, (50 * count, arm.n)), 6)
    return q[is_regular(arm, q)][:count]


def is_regular(arm: Arm, q: Array) -> NDArray[np.bool_]:
    """Return whether states (N, n) are well away from singular ones, shape (N,)."""
    J = arm.jacobian(q)
    J[:, :3] /= np.linalg.norm(arm.fk(q)[:, :3, 3], axis=1).max()
    smallest = np.linalg.svd(J, compute_uv=False)[:, -1]
    return np.asarray(smallest > LEAST_SINGULAR_VALUE)


def near_singular(arm: Arm, rng: np.random.Generator) -> Iterator[Array]:
    """Yield states beside singular ones, which lie between states whose Jacobians have determinants of other signs."""
    found = 0
    while found < NEAR_SINGULAR:
        begin, end = states(arm, rng, 2)
        sign = np.sign(np.linalg.det(arm.jacobian(begin)))
        if sign == np.sign(np.linalg.det(arm.jacobian(end))):
            continue
        low, high = 0.0, 1.0
        while high - low > 1e-15:
            middle = (low + high) / 2
            same = np.sign(np.linalg.det(arm.jacobian(begin + middle * (end - begin)))) == sign
            low, high = (middle, high) if same else (low, middle)
        way = (end - begin) / np.linalg.norm(end - begin)
        found += 1
        yield begin + low * (end - begin) - OFF_SINGULAR * way


def near_limit(arm: Arm, rng: np.random.Generator) -> Iterator[Array]:
    """Yield states of which one joint is just inside its limit."""
    numbers = arm.description.numbers
    limited = np.flatnonzero(np.isfinite(numbers.lower))
    found = 0
    while found < NEAR_LIMIT:
        (q,) = states(arm, rng, 1)
        if len(limited):
            joint = rng.choice(limited)
            ends = numbers.lower[joint] + OFF_LIMIT, numbers.upper[joint] - OFF_LIMIT
            q[joint] = ends[rng.integers(2)]
        # Some limits are singular: a whole turn stretches the elbow of a UR.
        if is_regular(arm, q[None])[0]:
            found += 1
            yield q


# Poses


def reachable(arm: Arm, exact: ExactArm, q: Array, kind: str) -> dict[str, Any]:
    """Return a pose that a state has, and all solutions, to the last digit of a double."""
    goal = exact.pose(q)
    T = np.array(exact.rounded(goal))
    closed = arm.ik(T)
    first = distinct(closed.q[np.isfinite(closed.q).all(axis=1)])
    second = by_iteration(arm, T)
    if kind != "near singular" and not same_sets(first, second):
        raise ValueError(
            f"{arm.name}, {kind}, {q}: {len(first)} solutions, and {len(second)} by iteration"
        )
    refined = [exact.refined(one, goal) for one in first]
    refined.append([mp.mpf(x) for x in q])
    solutions = distinct(np.array([[float(x) for x in one] for one in refined]))
    return {"kind": kind, "T": T.tolist(), "solutions": sorted(wrapped(arm, solutions).tolist())}


def by_iteration(arm: Arm, T: Array) -> Array:
    """Return the solutions that Newton's method finds from random starts, shape (k, n)."""
    numbers = arm.description.numbers
    room = np.where(numbers.prismatic, 2.0, np.pi)
    starts = np.random.default_rng(0).uniform(-room, room, (STARTS, arm.n))
    goals = np.broadcast_to(T, (STARTS, 4, 4))
    found = solve_numerically(
        arm.description, goals, starts, restarts=0, tolerance=1e-11, limits=False
    )
    return distinct(found.q[found.valid[:, 0], 0])


def unreachable(arm: Arm, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """Yield poses outside: just beyond the last one on a ray that has a solution, and far away."""
    reach = np.linalg.norm(arm.fk(states(arm, rng, 200))[:, :3, 3], axis=1).max()
    for q in states(arm, rng, UNREACHABLE):
        T = arm.fk(q)
        direction = T[:3, 3] / np.linalg.norm(T[:3, 3])

        def at(distance: float, T: Array = T, direction: Array = direction) -> Array:
            moved = T.copy()
            moved[:3, 3] = distance * direction
            return moved

        low, high = np.linalg.norm(T[:3, 3]), 4 * reach
        distances = np.linspace(low, high, 4_000)
        inside = distances[arm.ik(np.array([at(x) for x in distances])).valid.any(axis=-1)].max()
        if inside == distances[-1]:  # a slide without limits reaches as far as one likes
            return
        outside = inside + distances[1] - distances[0]
        while outside - inside > 1e-10 * reach:
            middle = (inside + outside) / 2
            has = bool(arm.ik(at(middle)).valid.any())
            inside, outside = (middle, outside) if has else (inside, middle)
        for kind, beyond in (("just unreachable", JUST * reach), ("far unreachable", reach)):
            goal = at(outside + beyond)
            if arm.ik(goal).valid.any() or len(by_iteration(arm, goal)):
                raise ValueError(f"{arm.name}: {kind}: has a solution")
            yield {"kind": kind, "T": goal.tolist(), "solutions": [], "outside": float(beyond)}


def distinct(q: Array) -> Array:
    """Return joint values (k, n) without repetitions; angles that differ by whole turns are the same."""
    kept: list[Array] = []
    for one in q:
        if all(apart(one, other) > SAME for other in kept):
            kept.append(one)
    return np.array(kept).reshape(len(kept), q.shape[-1] if q.ndim > 1 else 0)


def apart(p: Array, q: Array) -> float:
    """Return the largest difference of two states, angles modulo whole turns; slides differ by less than a turn."""
    return float(np.abs(2 * np.sin((p - q) / 2)).max())


def same_sets(first: Array, second: Array) -> bool:
    """Return whether two sets of solutions are the same."""
    return len(first) == len(second) and all(
        min((apart(one, other) for other in second), default=np.inf) < SAME for one in first
    )


def wrapped(arm: Arm, q: Array) -> Array:
    """Return solutions with angles in (-pi, pi]."""
    turned = q - 2 * np.pi * np.ceil((q - np.pi) / (2 * np.pi))
    return np.where(arm.description.numbers.prismatic, q, turned) + 0.0


# Dynamics


def dynamics_of(arm: Arm, rng: np.random.Generator) -> dict[str, Any] | None:
    """Return bodies, and states with their torques, as dhkit and Pinocchio agree on them; None without bodies."""
    description = arm.description
    if not all(joint.bodies for joint in description.joints):
        return None
    import pinocchio

    numbers = description.numbers
    model = arm.model
    data = model.createData()
    rows = []
    for q in states(arm, rng, STATES):
        qd, qdd = np.round(rng.uniform(-1, 1, (2, arm.n)), 6)
        tau = arm.inverse_dynamics(q, qd, qdd)
        other = pinocchio.rnea(model, data, q, qd, qdd)
        if np.abs(tau - other).max() > 1e-12 * max(1.0, np.abs(tau).max()):
            raise ValueError(f"{arm.name}: torques differ by {np.abs(tau - other).max():.1e}")
        row = {
            "q": q,
            "qd": qd,
            "qdd": qdd,
            "M": arm.mass_matrix(q),
            "g": arm.gravity_torque(q),
            "tau": tau,
        }
        rows.append({key: value.tolist() for key, value in row.items()})
    bodies = {"mass": numbers.mass, "com": numbers.com, "inertia": numbers.inertia}
    drives = {"armature": numbers.armature, "coupling": numbers.coupling}
    return {
        **{key: value.tolist() for key, value in (bodies | drives).items()},
        "gravity": numbers.gravity.tolist(),
        "states": rows,
    }


if __name__ == "__main__":
    main()
