"""Mass matrices and gravity torques straight from the robot files, without descriptions, URDFs or kernels.

`arm.verify()` compares two computations that both start from ``description.numbers``, so that a wrong centre of mass,
body frame or gear would be wrong on both sides. Here a file is read by tomllib, frames are products of elementary
rotations and translations, and M and g are sums over bodies (Siciliano et al., Robotics, 2009, eq. 7.32 and 7.39).
"""

import tomllib
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

import dhkit
from dhkit import Arm, robots
from dhkit.description import library_robot
from dhkit.expressions import parse, substitute as put_in

LIBRARY = Path(dhkit.__file__).parent / "description" / "library"
CLOSE = 1e-12
"""Relative to the largest entry: some thousand roundings of products of up to nine matrices."""
LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254}
ANGLES = {"rad": 1.0, "deg": pi / 180}


class RobotFile:
    """A robot file's numbers in SI units; text is parsed, bare numbers are in the file's units."""

    def __init__(self, name):
        data = tomllib.loads((LIBRARY / f"{name}.toml").read_text("utf-8"))
        self.length = LENGTHS[data.get("units", {}).get("length", "m")]
        self.angle = ANGLES[data.get("units", {}).get("angle", "rad")]
        self.parameters = {}
        for key, value in data.get("parameters", {}).items():
            self.parameters[key] = value
        self.data = data

    def number(self, value, unit=1.0):
        if not isinstance(value, str):
            return value * unit
        expression = parse(value, tuple(self.parameters))
        values = {
            name: parse(str(self.parameters[name]), tuple(self.parameters))
            for name in expression.symbols
        }
        while expression.symbols:
            expression = put_in(expression, values)
            values = {
                name: parse(str(self.parameters[name]), tuple(self.parameters))
                for name in expression.symbols
            }
        return float(expression)

    def joints(self):
        return self.data["joint"]

    def bodies(self, joint):
        for body in joint.get("bodies", [joint["body"]] if "body" in joint else []):
            com = np.array([self.number(x, self.length) for x in body.get("com", (0, 0, 0))])
            inertia = np.zeros((3, 3))
            for key, value in body.get("inertia", {}).items():
                i, j = ("xyz".index(letter) for letter in key)
                inertia[i, j] = inertia[j, i] = self.number(value)
            yield self.number(body["mass"]), com, inertia

    def rows(self):
        for joint in self.joints():
            lengths = [self.number(joint.get(key, 0), self.length) for key in "ad"]
            angles = [self.number(joint.get(key, 0), self.angle) for key in ("alpha", "theta")]
            yield *lengths, *angles, joint["type"] == "revolute"

    def armature(self):
        for joint in self.joints():
            drive = joint.get("drive", {})
            yield self.number(drive.get("gear", 1)) ** 2 * self.number(
                drive.get("rotor_inertia", 0)
            )

    def coupling(self):
        B = np.zeros((len(self.joints()),) * 2)
        for entry in self.data.get("coupling", []):
            i, j = (number - 1 for number in entry["joints"])
            B[i, j] = B[j, i] = self.number(entry["inertia"])
        return B


def about(axis, angle):
    """Return the rotation about axis 0 (x) or 2 (z), 4 x 4."""
    T, (i, j) = np.eye(4), {0: (1, 2), 2: (0, 1)}[axis]
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i] = -np.sin(angle), np.sin(angle)
    return T


def along(axis, length):
    T = np.eye(4)
    T[axis, 3] = length
    return T


def frames_and_axes(file, q):
    """Return frames 1 ... n in frame 0, and each joint's axis (point, direction) there."""
    T, frames, axes = np.eye(4), [], []
    for (a, d, alpha, theta, revolute), value in zip(file.rows(), q, strict=True):
        z = about(2, theta + value * revolute) @ along(2, d + value * (not revolute))
        x = along(0, a) @ about(0, alpha)
        if file.data["convention"] == "standard":
            axes.append(T)
            T = T @ z @ x
        else:
            T = T @ x @ z
            axes.append(T)
        frames.append(T)
    return frames, [(A[:3, 3], A[:3, 2]) for A in axes]


def mass_matrix_and_gravity(file, q, gravity):
    """Return M and g by the Jacobians of every body's centre of mass; gravity in frame 0."""
    frames, axes = frames_and_axes(file, q)
    n = len(axes)
    M, g = np.diag(list(file.armature())) + file.coupling(), np.zeros(n)
    revolute = [row[-1] for row in file.rows()]
    for i, joint in enumerate(file.joints()):
        R, origin = frames[i][:3, :3], frames[i][:3, 3]
        for mass, com, inertia in file.bodies(joint):
            p = origin + R @ com
            linear, angular = np.zeros((3, n)), np.zeros((3, n))
            for k, (point, z) in enumerate(axes[: i + 1]):
                linear[:, k] = np.cross(z, p - point) if revolute[k] else z
                angular[:, k] = z if revolute[k] else 0
            M += mass * linear.T @ linear + angular.T @ R @ inertia @ R.T @ angular
            g -= mass * linear.T @ gravity
    return M, g


WITH_BODIES = [
    name for name in robots() if all(joint.bodies for joint in library_robot(name).joints)
]


@pytest.mark.parametrize("name", WITH_BODIES)
def test_dynamics_follow_from_the_numbers_of_the_file(name):
    file, arm = RobotFile(name), Arm.load(name)
    gravity = arm.description.numbers.T_world_base[:3, :3].T @ arm.description.numbers.gravity
    rng = np.random.default_rng(0)
    for q in rng.uniform(-2, 2, (5, arm.n)):
        M, g = mass_matrix_and_gravity(file, q, gravity)
        assert np.abs(arm.mass_matrix(q) - M).max() <= CLOSE * np.abs(M).max()
        assert np.abs(arm.gravity_torque(q) - g).max() <= CLOSE * max(1.0, np.abs(g).max())


def test_a_wrong_gear_and_a_moved_body_are_seen():
    file, arm = RobotFile("puma560"), library_robot("puma560")
    q = np.array([0.1, -0.4, 0.7, 0.2, -0.5, 0.3])
    M, _ = mass_matrix_and_gravity(file, q, np.array([0.0, 0.0, -9.81]))
    joint = arm.joints[2]
    geared = replace(joint, drive=replace(joint.drive, gear=-joint.drive.gear * 2))
    moved = replace(
        joint, bodies=tuple(replace(b, com=(b.com[1], b.com[0], b.com[2])) for b in joint.bodies)
    )
    for wrong in (geared, moved):
        other = Arm(replace(arm, joints=(*arm.joints[:2], wrong, *arm.joints[3:])))
        assert other.verify(20).ok  # both sides of verify() share the wrong number
        assert np.abs(other.mass_matrix(q) - M).max() > 1e-3 * np.abs(M).max()
