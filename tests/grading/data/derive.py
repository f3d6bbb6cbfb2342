"""Lagrange's equations from energies, in sympy, written without dhkit: the truths of the held-out corpus.

A robot is written down again from its table. Centres of mass come from products of link transforms, velocities by
differentiation, K = sum m v^2/2 + omega^T I omega/2 + N^2 J qd^2/2, V = -sum m gravity^T p, and the equations from
d/dt dL/dqd - dL/dq. ``Hooks`` change one step of that, which is how wrong answers are made.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import sympy as sp

pi = sp.pi


def q_(i):
    """Return joint variable i, from 1."""
    return sp.Symbol(f"q{i}")


def qd_(i):
    """Return the rate of joint i."""
    return sp.Symbol(f"qd{i}")


def qdd_(i):
    """Return the acceleration of joint i."""
    return sp.Symbol(f"qdd{i}")


def exact(value):
    """Return a number or a text as an exact expression."""
    return sp.sympify(
        value, locals={"I1": sp.Symbol("I1"), "beta": sp.Symbol("beta")}, rational=True
    )


@dataclass(frozen=True)
class Link:
    """A row of the table and the body after it."""

    kind: str
    theta: sp.Expr
    d: sp.Expr
    a: sp.Expr
    alpha: sp.Expr
    m: sp.Expr
    com: sp.Matrix
    inertia: sp.Matrix
    gear: sp.Expr
    rotor: sp.Expr
    viscous: sp.Expr


def link(
    kind, theta=0, d=0, a=0, alpha=0, m=0, com=(0, 0, 0), gear=1, rotor=0, viscous=0, **inertia
):
    """Write one row; angles in multiples of pi/2, inertias by key (xx, yy, zz, xz)."""
    I = sp.zeros(3)  # noqa: E741
    for key, value in inertia.items():
        i, j = ("xyz".index(k) for k in key)
        I[i, j] = I[j, i] = exact(value)
    return Link(
        kind,
        exact(theta) * pi / 2,
        exact(d),
        exact(a),
        exact(alpha) * pi / 2,
        exact(m),
        sp.Matrix([exact(c) for c in com]),
        I,
        exact(gear),
        exact(rotor),
        exact(viscous),
    )


@dataclass(frozen=True)
class Robot:
    """A robot as data."""

    name: str
    links: tuple[Link, ...]
    gravity: tuple
    values: dict[str, float] = field(default_factory=dict)
    base: sp.Matrix = field(default_factory=lambda: sp.eye(4))
    tool: sp.Matrix = field(default_factory=lambda: sp.eye(4))
    modified: bool = False
    payload: sp.Expr | int = 0  # a point mass at the tool

    @property
    def n(self):
        """Number of joints."""
        return len(self.links)


def Rz(t):
    """Turn about z."""
    c, s = sp.cos(t), sp.sin(t)
    return sp.Matrix([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def Rx(t):
    """Turn about x."""
    c, s = sp.cos(t), sp.sin(t)
    return sp.Matrix([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def Ry(t):
    """Turn about y."""
    c, s = sp.cos(t), sp.sin(t)
    return sp.Matrix([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def shift(x, y, z):
    """Translate."""
    T = sp.eye(4)
    T[:3, 3] = sp.Matrix([x, y, z])
    return T


@dataclass(frozen=True)
class Hooks:
    """One step of the derivation done otherwise; each gets the step's right result."""

    position: Callable | None = None  # (i, p, frames) -> p for velocities
    height: Callable | None = None  # (i, p, frames) -> p for V
    omega: Callable | None = None  # (i, omega in link axes) -> omega
    velocity: Callable | None = None  # (i, v) -> v
    kinetic: Callable | None = None  # (i, translation, rotation, rotor) -> K of link i
    potential: Callable | None = None  # (i, V_i) -> V_i
    momentum_rate: Callable | None = None  # (i, d/dt dK/dqd_i at qdd = 0) -> same
    gradient: Callable | None = None  # (i, dK/dq_i) -> same
    gravity_gradient: Callable | None = None  # (i, dV/dq_i) -> same
    bias: Callable | None = None  # (i, h_i) -> h_i


def row_transforms(robot: Robot):
    """Return A1 ... An."""
    result = []
    for k, one in enumerate(robot.links):
        theta = one.theta + (q_(k + 1) if one.kind == "R" else 0)
        d = one.d + (q_(k + 1) if one.kind == "P" else 0)
        if robot.modified:
            result.append(Rx(one.alpha) * shift(one.a, 0, 0) * Rz(theta) * shift(0, 0, d))
        else:
            result.append(Rz(theta) * shift(0, 0, d) * shift(one.a, 0, 0) * Rx(one.alpha))
    return result


def frames(robot: Robot):
    """Return the world transforms of frames 0 ... n."""
    T = [robot.base]
    for A in row_transforms(robot):
        T.append((T[-1] * A).applyfunc(fourier))
    return T


def fourier(expression):
    """Return a sum of sines and cosines of sums of joint variables: products are multiplied out."""
    expression = sp.sympify(expression)
    waves = defaultdict(list)
    angles = sorted(
        {s for s in expression.free_symbols if s.name[0] == "q" and s.name[1:].isdigit()}, key=str
    )
    turns = {a: sp.Symbol("E" + a.name) for a in angles}
    touched = [f for f in expression.atoms(sp.sin, sp.cos) if f.args[0].free_symbols & set(angles)]
    if not touched:
        return sp.expand(expression)
    exchange = {}
    for f in touched:
        argument = sp.expand(f.args[0])
        phase = argument.subs(dict.fromkeys(angles, 0))
        E = sp.Mul(*(turns[a] ** argument.coeff(a) for a in angles)) * (
            sp.cos(phase) + sp.I * sp.sin(phase)
        )
        inverse = sp.Mul(*(turns[a] ** (-argument.coeff(a)) for a in angles)) * (
            sp.cos(phase) - sp.I * sp.sin(phase)
        )
        exchange[f] = (E - inverse) / (2 * sp.I) if f.func is sp.sin else (E + inverse) / 2
    for term in sp.Add.make_args(sp.expand(expression.xreplace(exchange))):
        powers = term.as_powers_dict()
        wave = tuple(int(powers.get(turns[a], 0)) for a in angles)
        waves[wave].append(
            term / sp.Mul(*(turns[a] ** k for a, k in zip(angles, wave, strict=True)))
        )
    sums = {wave: sp.expand(sp.Add(*parts)) for wave, parts in waves.items()}
    result = sp.S(0)
    for wave, amplitude in sums.items():
        opposite = tuple(-k for k in wave)
        if not any(wave):
            result += amplitude
        elif next(k for k in wave if k) > 0 or opposite not in sums:
            argument = sum(k * a for k, a in zip(wave, angles, strict=True))
            other = sums.get(opposite, 0)
            result += sp.expand(amplitude + other) * sp.cos(argument)
            result += sp.expand(sp.I * (amplitude - other)) * sp.sin(argument)
    return sp.expand(result)


def dot(expression, robot):
    """Return the rate of an expression in q."""
    return sum((sp.diff(expression, q_(i)) * qd_(i) for i in range(1, robot.n + 1)), sp.S(0))


def energies(robot: Robot, hooks: Hooks | None = None):
    """Return K and V, each a list by link."""
    hooks = hooks or Hooks()
    T = frames(robot)
    gravity = sp.Matrix([exact(c) for c in robot.gravity])
    K, V = [], []
    spin = sp.zeros(3, 1)  # angular velocity in world axes
    for k, one in enumerate(robot.links):
        frame = T[k + 1]
        axis = (T[k + 1] if robot.modified else T[k])[:3, 2]
        own = axis * qd_(k + 1) if one.kind == "R" else sp.zeros(3, 1)
        spin = spin + own
        R = frame[:3, :3]
        p = (frame * sp.Matrix([*one.com, 1]))[:3, 0]
        moved = hooks.position(k + 1, p, T) if hooks.position else p
        v = moved.applyfunc(lambda e: dot(e, robot))
        if hooks.velocity:
            v = hooks.velocity(k + 1, v)
        omega = (R.T * spin).applyfunc(fourier)
        if hooks.omega:
            omega = hooks.omega(k + 1, omega)
        translation = fourier(one.m * (v.T * v)[0]) / 2
        rotation = fourier((omega.T * one.inertia * omega)[0]) / 2
        rotor = one.gear**2 * one.rotor * qd_(k + 1) ** 2 / 2
        K.append(
            hooks.kinetic(k + 1, translation, rotation, rotor)
            if hooks.kinetic
            else translation + rotation + rotor
        )
        high = hooks.height(k + 1, p, T) if hooks.height else p
        height = fourier(-one.m * (gravity.T * high)[0])
        V.append(hooks.potential(k + 1, height) if hooks.potential else height)
    if robot.payload:
        p = (T[-1] * robot.tool)[:3, 3]
        moved = hooks.position(robot.n + 1, p, T) if hooks.position else p
        v = moved.applyfunc(lambda e: dot(e, robot))
        high = hooks.height(robot.n + 1, p, T) if hooks.height else p
        K.append(fourier(robot.payload * (v.T * v)[0]) / 2)
        V.append(fourier(-robot.payload * (gravity.T * high)[0]))
    return K, V


def derive(robot: Robot, hooks: Hooks | None = None) -> dict:
    """Return K, V, L, M, h, C, g, tau, friction torque separately as ``friction``."""
    hooks = hooks or Hooks()
    K, V = (fourier(sum(part, sp.S(0))) for part in energies(robot, hooks))
    return equations(robot, K, V, hooks)


def equations(robot: Robot, K, V, hooks: Hooks | None = None) -> dict:
    """Return the equations of motion of given energies."""
    hooks = hooks or Hooks()
    n = robot.n
    M = sp.Matrix(n, n, lambda i, j: fourier(sp.diff(K, qd_(i + 1), qd_(j + 1))))
    h, g, tau = [], [], []
    for i in range(1, n + 1):
        rate = dot(sp.diff(K, qd_(i)), robot)
        gradient = sp.diff(K, q_(i))
        rise = sp.diff(V, q_(i))
        rate = hooks.momentum_rate(i, rate) if hooks.momentum_rate else rate
        gradient = hooks.gradient(i, gradient) if hooks.gradient else gradient
        rise = hooks.gravity_gradient(i, rise) if hooks.gravity_gradient else rise
        bias = fourier(rate - gradient)
        h.append(hooks.bias(i, bias) if hooks.bias else bias)
        g.append(fourier(rise))
        tau.append(sum((M[i - 1, j] * qdd_(j + 1) for j in range(n)), sp.S(0)) + h[-1] + g[-1])
    return {
        "K": K,
        "V": V,
        "L": sp.expand(K - V),
        "M": M.tolist(),
        "C": christoffel(M, n),
        "h": h,
        "g": g,
        "tau": [sp.expand(t) for t in tau],
        "friction": [one.gear**2 * one.viscous * qd_(i + 1) for i, one in enumerate(robot.links)],
    }


def christoffel(M, n, sign=1):
    """Return C by Christoffel symbols."""
    rows = []
    for k in range(n):
        row = []
        for j in range(n):
            entry = sum(
                (
                    (
                        sp.diff(M[k, j], q_(i + 1))
                        + sp.diff(M[k, i], q_(j + 1))
                        - sp.diff(M[i, j], q_(k + 1))
                    )
                    * qd_(i + 1)
                    for i in range(n)
                ),
                sp.S(0),
            )
            row.append(fourier(entry / 2))
        rows.append(row)
    return rows


def kinematics(robot: Robot) -> dict:
    """Return A1 ... An, T and J of the tool in world axes."""
    result = {f"A{i + 1}": A.tolist() for i, A in enumerate(row_transforms(robot))}
    F = frames(robot)
    T = (F[-1] * robot.tool).applyfunc(fourier)
    p = T[:3, 3]
    columns = []
    for k, one in enumerate(robot.links):
        axis = (F[k + 1] if robot.modified else F[k])[:3, 2]
        angular = axis if one.kind == "R" else sp.zeros(3, 1)
        columns.append(sp.Matrix([*(sp.diff(c, q_(k + 1)) for c in p), *angular]))
    return {**result, "T": T.tolist(), "J": sp.Matrix.hstack(*columns).tolist()}


def with_link(robot: Robot, i: int, **changes) -> Robot:
    """Return a robot with changes to link i, from 1."""
    links = list(robot.links)
    links[i - 1] = replace(
        links[i - 1],
        **{k: exact(v) if not isinstance(v, sp.MatrixBase) else v for k, v in changes.items()},
    )
    return replace(robot, links=tuple(links))


def rod(m, length, *axes):
    """Return the moments of a thin rod about its centre, for the axes across it."""
    return {axis * 2: f"{m}*{length}**2/12" for axis in axes}


def library() -> dict[str, Robot]:
    """Return the robots of the corpus, from their tables."""
    g = sp.Symbol("g")
    planar = (
        link("R", a="l1", m="m1", com=("-l1/2", 0, 0), viscous="1/20", **rod("m1", "l1", "y", "z")),
        link("R", a="l2", m="m2", com=("-l2/2", 0, 0), viscous="1/50", **rod("m2", "l2", "y", "z")),
    )
    third = link(
        "R", a="l3", m="m3", com=("-l3/2", 0, 0), viscous="1/200", **rod("m3", "l3", "y", "z")
    )
    two = {"g": 9.81, "l1": 0.5, "l2": 0.4, "m1": 2.0, "m2": 1.5}
    polar = (
        link("R", theta=1, alpha=1, m="m1", com=(0, 0, "l1"), xx="I1", yy="I1", viscous="1/20"),
        link("P", m="m2", xx="I2", yy="I2", viscous=2),
    )
    polar_values = {"g": 9.81, "l1": 0.25, "m1": 2.0, "m2": 1.2, "I1": 0.04, "I2": 0.01}
    sine, cosine = sp.sin(sp.Symbol("beta")), sp.cos(sp.Symbol("beta"))
    robots = [
        Robot("planar2r", planar, (0, -g, 0), two),
        Robot("planar3r", (*planar, third), (0, -g, 0), {**two, "l3": 0.2, "m3": 0.5}),
        Robot("polar_rp", polar, (0, -g, 0), polar_values),
        Robot(
            "cart_pendulum",
            (
                link("P", alpha=1, m="mc", xx="mc/150", yy="mc/150", zz="mc/150", viscous="1/2"),
                link(
                    "R",
                    a="l",
                    m="mp",
                    com=("-l/2", 0, 0),
                    viscous="1/500",
                    **rod("mp", "l", "y", "z"),
                ),
            ),
            (0, 0, -g),
            {"g": 9.81, "mc": 1.0, "mp": 0.3, "l": 0.6},
            base=Ry(pi / 2),
        ),
        Robot(
            "pan_tilt",
            (
                link(
                    "R",
                    d="0.08",
                    alpha=1,
                    m="0.35",
                    com=(0, "-0.04", 0),
                    xx="0.0002654",
                    yy="0.0001575",
                    zz="0.0002654",
                    gear=260,
                    rotor="1e-8",
                    viscous="5.7e-8",
                ),
                link(
                    "R",
                    a="0.05",
                    m="0.25",
                    com=("-0.025", 0, 0),
                    xx="7.813e-5",
                    yy="9.115e-5",
                    zz="9.115e-5",
                    gear=260,
                    rotor="5e-9",
                    viscous="5.7e-8",
                ),
            ),
            (0, 0, "-9.81"),
        ),
        Robot(
            "cobra600",
            (
                link(
                    "R",
                    a="0.325",
                    d="0.387",
                    m=13,
                    com=("-0.1625", 0, "-0.1935"),
                    xx="0.1995",
                    yy="0.303",
                    zz="0.1562",
                    xz="-0.1233",
                    gear=80,
                    rotor="0.00012",
                    viscous="9e-5",
                ),
                link(
                    "R",
                    a="0.275",
                    alpha=2,
                    m=11,
                    com=("-0.1375", 0, 0),
                    xx="0.02695",
                    yy="0.0828",
                    zz="0.0828",
                    gear=50,
                    rotor="6e-5",
                    viscous="4.1e-5",
                ),
                link(
                    "P",
                    m="1.5",
                    com=(0, 0, "-0.105"),
                    xx="0.005597",
                    yy="0.005597",
                    zz="0.0001687",
                    gear=400,
                    rotor="6e-6",
                    viscous="2.3e-5",
                ),
                link(
                    "R",
                    m="0.5",
                    xx="0.00018",
                    yy="0.00018",
                    zz="0.00018",
                    gear=20,
                    rotor="5e-6",
                    viscous="3.6e-6",
                ),
            ),
            (0, 0, "-9.81"),
        ),
        Robot(
            "puma3",
            (
                link("R", alpha=1, yy="I1"),
                link("R", a="a2", m="m2", com=("-r2", 0, 0), yy="I2", zz="I2"),
                link("R", a="a3", alpha=-1, d="d3", m="m3", com=(0, 0, "r3"), xx="I3", yy="I3"),
            ),
            (0, 0, -g),
            {
                "g": 9.81,
                "a2": 0.4318,
                "a3": 0.0203,
                "d3": 0.15005,
                "m2": 17.4,
                "m3": 4.8,
                "r2": 0.3638,
                "r3": 0.07,
                "I1": 0.35,
                "I2": 0.53,
                "I3": 0.08,
            },
        ),
        # Robots of our own, in robots/.
        Robot(
            "pendulum1",
            (link("R", a="l", m="m", com=("lc - l", 0, 0), zz="Ic", viscous="b"),),
            (g, 0, 0),
            {"g": 9.81, "m": 1.3, "l": 0.7, "lc": 0.3, "Ic": 0.05, "b": 0.02},
        ),
        Robot(
            "rpr",
            (
                link("R", theta=1, alpha=1, m="m1", com=(0, 0, "lc1"), yy="I1"),
                link("P", alpha=-1, m="m2", zz="I2"),
                link("R", theta=-1, a="l3", m="m3", com=("lc3 - l3", 0, 0), zz="I3"),
            ),
            (0, -g, 0),
            {
                "g": 9.81,
                "lc1": 0.2,
                "l3": 0.3,
                "lc3": 0.12,
                "m1": 3.0,
                "m2": 2.0,
                "m3": 0.8,
                "I1": 0.05,
                "I2": 0.02,
                "I3": 0.007,
            },
        ),
        Robot(
            "cart_double",
            (
                link("P", alpha=1, m="m0"),
                link("R", a="l1", m="m1"),
                link("R", a="l2", m="m2"),
            ),
            (0, 0, -g),
            {"g": 9.81, "m0": 2.0, "m1": 0.5, "m2": 0.4, "l1": 0.6, "l2": 0.45},
            base=Ry(pi / 2),
        ),
        Robot(
            "gantry",
            (link("P", alpha=1, m="m1"), link("P", m="m2")),
            (0, 0, -g),
            {"g": 9.81, "m1": 8.0, "m2": 3.0},
            base=Rx(-pi / 2),
        ),
        Robot(
            "stanford3",
            (
                link("R", alpha=-1, d="d1", yy="I1"),
                link("R", alpha=1, d="d2", m="m2", xx="I2", yy="I2", zz="J2"),
                link("P", m="m3", com=(0, 0, "-lc3"), xx="I3", yy="I3"),
            ),
            (0, 0, -g),
            {
                "g": 9.81,
                "d1": 0.4,
                "d2": 0.15,
                "lc3": 0.25,
                "m2": 4.0,
                "m3": 1.5,
                "I1": 0.3,
                "I2": 0.06,
                "J2": 0.02,
                "I3": 0.03,
            },
        ),
        Robot(
            "payload2r",
            (
                link("R", a="l1", m="m1", com=("lc1 - l1", 0, 0), zz="I1"),
                link("R", a="l2", m="m2", com=("lc2 - l2", 0, 0), zz="I2"),
            ),
            (0, -g, 0),
            {
                "g": 9.81,
                "l1": 0.45,
                "l2": 0.35,
                "lc1": 0.2,
                "lc2": 0.15,
                "m1": 2.2,
                "m2": 1.4,
                "mp": 0.6,
                "I1": 0.04,
                "I2": 0.02,
            },
            payload=sp.Symbol("mp"),
        ),
        Robot(
            "geared2r",
            (
                link(
                    "R",
                    a="l1",
                    m="m1",
                    com=("-l1/2", 0, 0),
                    gear="N1",
                    rotor="J1",
                    viscous="b1",
                    **rod("m1", "l1", "y", "z"),
                ),
                link(
                    "R",
                    a="l2",
                    m="m2",
                    com=("-l2/2", 0, 0),
                    gear="N2",
                    rotor="J2",
                    viscous="b2",
                    **rod("m2", "l2", "y", "z"),
                ),
            ),
            (0, -g, 0),
            {**two, "N1": 80, "N2": 50, "J1": 1e-4, "J2": 4e-5, "b1": 1e-3, "b2": 5e-4},
        ),
        Robot(
            "incline_rp",
            (
                link("R", theta=1, alpha=1, m="m1", com=(0, 0, "l1"), xx="I1", yy="I1"),
                link("P", m="m2", xx="I2", yy="I2"),
            ),
            (g * sine, -g * cosine, 0),
            {**polar_values, "beta": 0.3},
        ),
        Robot(
            "craig2r",
            (
                link("R", m="m1", com=("r1", 0, 0), zz="J1"),
                link("R", a="l1", m="m2", com=("r2", 0, 0), zz="J2"),
            ),
            (0, -g, 0),
            {
                "g": 9.81,
                "l1": 0.5,
                "l2": 0.4,
                "r1": 0.22,
                "r2": 0.17,
                "m1": 2.0,
                "m2": 1.5,
                "J1": 0.05,
                "J2": 0.02,
            },
            tool=shift(sp.Symbol("l2"), 0, 0),
            modified=True,
        ),
        Robot(
            "double_pendulum",
            (link("R", a="l1", m="m1"), link("R", a="l2", m="m2")),
            (g, 0, 0),
            {"g": 9.81, "l1": 0.5, "l2": 0.4, "m1": 1.1, "m2": 0.7},
        ),
        Robot(
            "scara3",
            (
                link("R", a="l1", d="h", m="m1", com=("-l1/2", 0, 0), **rod("m1", "l1", "y", "z")),
                link(
                    "R", a="l2", alpha=2, m="m2", com=("-l2/2", 0, 0), **rod("m2", "l2", "y", "z")
                ),
                link("P", m="m3", zz="I3"),
            ),
            (0, 0, -g),
            {
                "g": 9.81,
                "h": 0.4,
                "l1": 0.35,
                "l2": 0.25,
                "m1": 6.0,
                "m2": 4.0,
                "m3": 1.5,
                "I3": 0.01,
            },
        ),
        Robot(
            "telescope_mm",
            (
                link("R", theta=1, alpha=1, m=4, com=(0, 0, "0.2"), xx="0.06", yy="0.06"),
                link("P", d="0.15", m=2, com=(0, 0, "-0.05"), xx="0.015", yy="0.015"),
            ),
            (0, "-9.81", 0),
        ),
    ]
    return {one.name: one for one in robots}
