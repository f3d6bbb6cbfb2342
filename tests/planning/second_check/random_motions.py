"""Random arms, scenes and motions, whose limits and clearances are the largest that a certificate accepts."""

from dataclasses import dataclass, replace

import numpy as np

import dhkit
from dhkit import Arm, Limits, Obstacle, pose
from dhkit.planning.obstacles import Floor
from random_arms import random_body, random_drive

LIBRARY = (
    "puma560",
    "ur5",
    "stanford",
    "al5d",
    "panda",
    "cobra600",
    "planar3r",
    "irb140",
    "jaco",
    "manutec_r3",
)
KINDS = (
    "library",
    "table",
    "locked",
    "small",
    "large",
    "tilted",
    "nearly parallel",
    "urdf",
    "wide",
    "narrow",
)
FREE = np.pi
"""rad: range of joints without limits."""


@dataclass(frozen=True)
class Case:
    """A motion and what a certificate is asked for."""

    arm: Arm
    motion: dhkit.Trajectory
    limits: Limits
    scene: tuple
    self_collision: bool
    clearance: float
    payload: object
    friction: object

    def certify(self, **options):
        """Return the certificate; ``options`` replace what the case has."""
        own = {
            "obstacles": self.scene,
            "clearance": self.clearance,
            "self_collision": self.self_collision,
        }
        return self.arm.certify(
            self.motion, self.limits, self.friction, self.payload, **(own | options)
        )


def random_case(rng, kind, folder):
    """Return a random motion of an arm of a kind; its limits and clearance are at the verge, or with room."""
    arm = random_arm(rng, kind, folder)
    lower, upper = ranges(arm, kind)
    points = rng.uniform(lower, upper, (int(rng.integers(2, 5)), arm.n))
    payload = (
        dhkit.Payload(rng.uniform(0.1, 2), rng.uniform(-0.1, 0.1, 3))
        if has_bodies(arm) and rng.random() < 0.3
        else None
    )
    friction = dhkit.Friction(0.05) if has_bodies(arm) and rng.random() < 0.3 else False
    free = Limits.of(arm, lower=-1e6, upper=1e6, velocity=1e6, torque=np.inf)
    if len(points) == 2:
        make = arm.quintic if rng.random() < 0.5 else arm.cubic
        motion = make(points[0], points[1], duration=rng.uniform(0.3, 3), limits=free)
    else:
        times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.5, len(points) - 1))])
        motion = arm.spline(points, times, limits=free)
    scene = random_scene(rng, arm, points)
    limits = verge_of(arm, motion, payload, friction)
    q = motion.q(np.linspace(0, motion.duration, 400))
    found = arm.distance(q, scene, self_collision=True)
    scene = tuple(
        item for item, gaps in zip(scene, found.per_obstacle.T, strict=True) if gaps.min() > 0
    )
    self_collision = bool(found.itself.min() > 0)
    gap = float(arm.distance(q, scene, self_collision).distance.min())
    clearance = gap * rng.choice([0.5, 0.9, 0.999]) if np.isfinite(gap) else 0.0
    return Case(arm, motion, limits, scene, self_collision, clearance, payload, friction)


def random_arm(rng, kind, folder):
    if kind in ("library", "wide", "narrow"):
        return Arm.load(str(rng.choice(LIBRARY)))
    if kind == "locked":
        arm = Arm.load(str(rng.choice([name for name in LIBRARY if name != "manutec_r3"])))
        lower, upper = ranges(arm, kind)
        count = int(rng.integers(1, max(2, arm.n - 1)))
        joints = rng.permutation(arm.n)[:count]
        return arm.lock({int(i): float(rng.uniform(lower[i], upper[i])) for i in joints})
    if kind == "urdf":
        source = Arm.load(str(rng.choice(["puma560", "ur5", "stanford", "irb140"])))
        file = folder / f"{source.name}_{rng.integers(1 << 30)}" / "arm.urdf"
        source.write_urdf(file)
        return Arm.from_urdf(file)
    size = {"small": 10 ** rng.uniform(-3, -1), "large": 10 ** rng.uniform(1, 3)}.get(kind, 1.0)
    n = int(rng.integers(2, 7))
    rows = []
    for _ in range(n):
        twist = float(rng.choice([0, np.pi / 2, -np.pi / 2, rng.uniform(-np.pi, np.pi)]))
        if kind == "nearly parallel":
            twist = float(rng.choice([0, np.pi / 2])) + 10 ** rng.uniform(-8, -3) * rng.choice(
                [-1, 1]
            )
        d, a = (
            float(x)
            for x in size * rng.choice([0.0, 1.0], 2, p=[0.3, 0.7]) * rng.uniform(0.1, 0.5, 2)
        )
        rows.append((float(rng.uniform(-np.pi, np.pi)), d, a, twist))
    kinds = "".join(rng.choice(["R", "R", "R", "P"], n))
    arm = Arm.from_dh(
        rows, kinds=kinds, convention=str(rng.choice(["standard", "modified"])), name="random"
    )
    if kind == "table":
        joints = tuple(
            replace(joint, bodies=(random_body(rng),), drive=random_drive(rng))
            for joint in arm.description.joints
        )
        arm = Arm(replace(arm.description, joints=joints))
    if kind == "tilted":
        arm = arm.with_base(pose(rng.uniform(-1, 1, 3), euler=rng.uniform(-np.pi, np.pi, 3)))
    return arm


def ranges(arm, kind=""):
    """Return the ranges of the joint values of motions, shape (n,) each."""
    numbers = arm.description.numbers
    free = np.where(numbers.prismatic, arm.description.reach or 1.0, FREE)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -free)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, free)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    share = {"wide": np.where(numbers.prismatic, 0.9, 1.5), "narrow": 0.2}.get(kind, 0.9)
    return middle - share * half, middle + share * half


def has_bodies(arm):
    return bool(np.isfinite(arm.description.numbers.mass).all())


def random_scene(rng, arm, points):
    """Return some solids where the arm moves, and sometimes a floor."""
    frames = arm.frames(points)
    size = float(np.ptp(frames[..., :3, 3].reshape(-1, 3), axis=0).max()) or 1.0
    scene = []
    for k in range(int(rng.integers(0, 4))):
        near = frames.reshape(-1, 4, 4)[rng.integers(frames.size // 16), :3, 3]
        centre = near + rng.uniform(-0.5, 0.5, 3) * size
        small = rng.uniform(0.02, 0.15) * size
        match rng.integers(3):
            case 0:
                scene.append(Obstacle.sphere(small, centre, name=f"ball {k}"))
            case 1:
                T = pose(centre, euler=rng.uniform(-np.pi, np.pi, 3))
                scene.append(Obstacle.box(rng.uniform(0.5, 1.5, 3) * small, T, name=f"box {k}"))
            case _:
                end = centre + rng.uniform(-0.3, 0.3, 3) * size
                scene.append(Obstacle.capsule(small / 3, centre, end, name=f"rod {k}"))
    if rng.random() < 0.2:
        scene.append(Floor(float(frames[..., 2, 3].min() - rng.uniform(0, 0.3) * size)))
    return tuple(scene)


def verge_of(arm, motion, payload, friction):
    """Return limits that the motion just keeps according to the certificate: the worst joint of each kind is at its."""
    t = np.linspace(0, motion.duration, 500)
    q = motion.q(t)
    most = {
        "velocity": np.abs(motion.qd(t)).max(axis=0),
        "acceleration": np.abs(motion.qdd(t)).max(axis=0),
    }
    if has_bodies(arm):
        loaded = arm if payload is None else arm.with_payload(payload)
        tau = loaded.inverse_dynamics(q, motion.qd(t), motion.qdd(t), friction=friction)
        most["torque"] = np.abs(tau).max(axis=0)
    guess = {name: 0.99 * np.maximum(values, 1e-6) for name, values in most.items()}
    first = Limits.of(
        arm, lower=q.min(axis=0) - 0.01, upper=q.max(axis=0) + 0.01, **{"torque": np.inf} | guess
    )
    found = arm.certify(motion, first, friction, payload)
    worst = {check.what: check.excess for check in found.checks}
    exact = {name: values * (1 + max(worst[name], 0) + 1e-9) for name, values in guess.items()}
    return replace(first, **exact)
