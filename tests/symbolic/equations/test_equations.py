"""What is printed is what was derived, exactly; and it reads as in textbooks."""

import re
from fractions import Fraction

import numpy as np
import pytest

from acceptance import slow_if
from dhkit.description import library_robot, read_robot, robots
from dhkit.expressions import parse
from dhkit.symbolic.equations import equations_sympy, equations_text, plain_text, quantities
from dhkit.symbolic.equations.collected import collected
from dhkit.symbolic.exact.lagrangian import lagrangian
from dhkit.symbolic.ring import Constant, Ring, RingError
from dhkit.symbolic.ring.notation import notation

SMALL = [name for name in robots() if library_robot(name).n <= 4]
CLASHING = """
format = 1
name = "clashing"
convention = "standard"
gravity = [0, "-g1", 0]

[parameters]
g1 = 9.81
c1 = 0.5
qd1 = 2.0
s12 = 1.5
l_c1 = 0.2
lc1 = 0.3
int = 0.4
lambda = 0.7

[[joint]]
type = "revolute"
a = "c1"
alpha = 0
d = 0
theta = "lambda"
body = { mass = "qd1", com = ["-l_c1", "lc1", 0], inertia = { yy = "qd1*c1^2/12", zz = "qd1*c1^2/12" } }

[[joint]]
type = "revolute"
a = "int"
alpha = 0
d = 0
theta = 0
body = { mass = "s12/(qd1 + s12)", com = ["-int/2", 0, 0], inertia = { yy = "s12*int^2/12", zz = "s12*int^2/12" } }
"""
"""Parameters that are called like a joint's value, a cosine, an entry, or words of C and Python."""


@pytest.fixture
def clashing(tmp_path):
    path = tmp_path / "clashing.toml"
    path.write_text(CLASHING)
    return lagrangian(read_robot(path))


def read(ring, text):
    """Return the element that a text stands for, by the parser of robot files and answers."""
    written = notation(ring).names
    names = {
        g.text: ring._element((g.kind, g.joint)) for g in ring.generators if g.kind != "constant"
    }
    turning = [i for i in range(ring.n) if ring.kinds[i] == "R"]
    for k, first in enumerate(turning):
        s, c, joints = ring.sine(first), ring.cosine(first), str(first + 1)
        for last in turning[k + 1 :]:
            own, other = ring.sine(last), ring.cosine(last)
            s, c, joints = s * other + c * own, c * other - s * own, joints + str(last + 1)
            names |= {f"s{joints}": s, f"c{joints}": c}
    names |= {written[text]: ring.constant(text) for text in ring.constants if text in written}
    names_of_file = {after: before for before, after in written.items()}
    total = ring.zero
    for monomial, coefficient in parse(text, [*names, *written.values()]).terms:
        product = ring.number(coefficient)
        for atom, exponent in monomial:
            own = re.sub(r"\w+", lambda word: names_of_file.get(word[0], word[0]), atom.text)
            if exponent < 0:
                product = product * ring.constant(f"1/{own}") ** -exponent
            else:
                factor = names[atom.name] if atom.name in names else ring.constant(own)
                product = product * factor**exponent
        total = total + product
    return total


def expanded(ring, products):
    """Multiply collected products out."""
    generators = [g if g.kind == "constant" else (g.kind, g.joint) for g in ring.generators]

    def power(place):
        g = generators[place]
        return ring.constant(g.text) if not isinstance(g, tuple) else ring._element(g)

    total = ring.zero
    for product in products:
        value = ring.number(product.coefficient)
        for place, exponent in product.powers:
            value = value * power(place) ** exponent
        for part in (product.factor, product.motion):
            value = value * expanded(ring, part) if part else value
        total = total + value
    return total


@pytest.mark.parametrize("name", SMALL)
def test_text_reads_back_as_what_was_printed(name):
    lag = lagrangian(library_robot(name))
    for element in [*lag.M.flat, *lag.C.flat, *lag.g, lag.V]:
        assert read(lag.arm.ring, plain_text(element)) == element


@pytest.mark.parametrize("name", SMALL)
def test_what_is_printed_in_sums_of_angles_reads_back(name):
    lag = lagrangian(library_robot(name))
    printed = {
        head: right
        for line in re.sub(r"\n +", " ", lag.text(("M", "C", "g"))).splitlines()
        if re.match(r"[MCg]\d", line)
        for *heads, right in [line.split(" = ")]
        for head in heads
    }
    for quantity in ("M", "C", "g"):
        for place, element in np.ndenumerate(getattr(lag, quantity)):
            head = quantity + "".join(str(k + 1) for k in place)
            assert read(lag.arm.ring, printed[head]) == element


@pytest.mark.parametrize(
    ("name", "symbols", "what"),
    [("puma560", "none", "Mg"), ("jaco", "none", "g"), slow_if(True, "puma560", "inertial", "Mg")],
)
def test_collecting_keeps_every_term(name, symbols, what):
    lag = lagrangian(library_robot(name), symbols)
    for element in (element for quantity in what for element in getattr(lag, quantity).flat):
        assert expanded(lag.arm.ring, collected(element)) == element


def test_torques_are_collected_exactly():
    for name in ("planar3r", "cart_pendulum", "polar_rp"):
        lag = lagrangian(library_robot(name))
        for element in [*lag.tau, *lag.h, lag.K]:
            assert expanded(lag.arm.ring, collected(element)) == element
            assert read(lag.arm.ring, plain_text(element)) == element


def rods(text):
    """Put uniform rods in: the centre of mass half-way, I = m l^2/12 about it."""
    for i in "12":
        text = text.replace(f"lc{i}", f"(l{i}/2)").replace(f"I{i}", f"(m{i}*l{i}^2/12)")
    return text


def test_planar2r_is_the_planar_elbow_of_spong():
    """Spong, Hutchinson & Vidyasagar, Robot Modeling and Control (2006), sect. 7.4, planar elbow manipulator.

    With absolute angles resolved: cos(q1 + q2) = c1*c2 - s1*s2.
    """
    lag = lagrangian(library_robot("planar2r"))
    M = [
        ["m1*lc1^2 + m2*(l1^2 + lc2^2 + 2*l1*lc2*c2) + I1 + I2", "m2*(lc2^2 + l1*lc2*c2) + I2"],
        ["m2*(lc2^2 + l1*lc2*c2) + I2", "m2*lc2^2 + I2"],
    ]
    h = "(-m2*l1*lc2*s2)"
    C = [[f"{h}*qd2", f"{h}*qd2 + {h}*qd1"], [f"-{h}*qd1", "0"]]
    g = ["(m1*lc1 + m2*l1)*g*c1 + m2*lc2*g*(c1*c2 - s1*s2)", "m2*lc2*g*(c1*c2 - s1*s2)"]
    for ours, theirs in ((lag.M, M), (lag.C, C), (lag.g, g)):
        for element, text in zip(ours.flat, np.array(theirs).flat, strict=True):
            assert read(lag.arm.ring, plain_text(element)) == read(lag.arm.ring, rods(text))


def test_point_masses_give_craigs_equation(tmp_path):
    """Craig, Introduction to Robotics (3rd ed. 2005), sect. 6.7, eq. 6.58: two point masses at the links' ends."""
    toml = "\n".join(
        f'[[joint]]\ntype = "revolute"\na = "l{i}"\nalpha = 0\nd = 0\ntheta = 0\nbody = {{ mass = "m{i}" }}'
        for i in (1, 2)
    )
    head = 'format = 1\nname = "craig"\nconvention = "standard"\ngravity = [0, "-g", 0]\n[parameters]\n'
    head += "l1 = 1\nl2 = 1\nm1 = 1\nm2 = 1\ng = 9.81\n"
    (tmp_path / "craig.toml").write_text(head + toml)
    lag = lagrangian(read_robot(tmp_path / "craig.toml"))
    assert plain_text(lag.M[0, 0]) == "m1*l1^2 + m2*(l1^2 + l2^2 + 2*l1*l2*c2)"
    first = (
        "m2*l2^2*(qdd1 + qdd2) + m2*l1*l2*c2*(2*qdd1 + qdd2) + (m1 + m2)*l1^2*qdd1 - m2*l1*l2*s2*qd2^2"
        " - 2*m2*l1*l2*s2*qd1*qd2 + m2*l2*g*(c1*c2 - s1*s2) + (m1 + m2)*l1*g*c1"
    )
    second = (
        "m2*l1*l2*c2*qdd1 + m2*l1*l2*s2*qd1^2 + m2*l2*g*(c1*c2 - s1*s2) + m2*l2^2*(qdd1 + qdd2)"
    )
    for element, text in zip(lag.tau, (first, second), strict=True):
        assert read(lag.arm.ring, plain_text(element)) == read(lag.arm.ring, text)


def test_planar2r_prints_as_textbooks_write():
    text = lagrangian(library_robot("planar2r")).text(("M", "C", "g", "h"))
    assert text.splitlines() == [
        "M11 = m1*l1^2/3 + m2*(l1^2 + l2^2/3 + l1*l2*c2)",
        "M12 = M21 = m2*l2*(l2/3 + l1*c2/2)",
        "M22 = m2*l2^2/3",
        "",
        "C11 = -m2*l1*l2*s2*qd2/2",
        "C12 = -m2*l1*l2*s2*(qd1 + qd2)/2",
        "C21 = m2*l1*l2*s2*qd1/2",
        "C22 = 0",
        "",
        "g1 = g*(m1*l1*c1/2 + m2*(l1*c1 + l2*c12/2))",
        "g2 = m2*g*l2*c12/2",
        "",
        "h1 = -m2*l1*l2*s2*qd1*qd2 - m2*l1*l2*s2*qd2^2/2",
        "h2 = m2*l1*l2*s2*qd1^2/2",
        "",
        "where c1 = cos(q1), c2 = cos(q2), s2 = sin(q2), c12 = cos(q1 + q2)",
    ]


def test_sums_of_angles_are_explained():
    ring = Ring("RR", [Constant("l1")], {0: (0,), 1: (0, 1)})
    from dhkit.symbolic.equations import Quantity

    element = np.array([ring.constant("l1") * ring.cosine(1)], dtype=object)
    assert equations_text([Quantity("g", element)]) == "g1 = l1*c12\n\nwhere c12 = cos(q1 + q2)"


def test_numbers_are_exact():
    ring = Ring("R")
    c = ring.cosine(0)
    assert plain_text(c * Fraction(4318, 10_000)) == "0.4318*c1"
    assert plain_text(c * Fraction(2, 3) - 1) == "-1 + 2*c1/3"
    assert plain_text(c * Fraction(1, 300_000)) == "c1/300000"
    assert plain_text(c * Fraction(123, 10**12)) == "1.23e-10*c1"
    assert plain_text(ring.zero) == "0"


def test_clashing_names_are_written_otherwise(clashing):
    text = clashing.text(("M", "C", "g", "tau"))
    assert "note: qd1 is written qd1_" in text
    assert "note: c1 is written c1_" in text
    assert "note: g1 is written g1_" in text
    for element in [*clashing.M.flat, *clashing.g, *clashing.tau]:
        assert read(clashing.arm.ring, plain_text(element)) == element


def test_what_nobody_could_read_is_refused_in_one_line():
    lag = lagrangian(library_robot("panda"))
    with pytest.raises(RingError, match=r"tau1 has \d+ terms.*code .* has no limit"):
        lag.text(("tau",))
    with pytest.raises(ValueError, match="no quantity 'X'; expected some of M, C, h, g, tau, K, V"):
        lag.text(("X",))
    assert "terms)" in str(lag.tau[0])
    assert str(lag).startswith("panda: M qdd + C qd + g = tau, M of ")


def test_sympy_gives_the_same_numbers(clashing):
    import sympy

    q, qd, qdd = (0.3, -0.7), (0.5, 1.1), (-0.2, 0.4)
    for lag in (
        lagrangian(library_robot("planar2r")),
        lagrangian(library_robot("cart_pendulum")),
        clashing,
    ):
        found = equations_sympy(quantities(lag, ["M", "tau", "V"]))
        state = {
            f"{kind}{i + 1}": x
            for kind, values in (("q", q), ("qd", qd), ("qdd", qdd))
            for i, x in enumerate(values)
        }
        written = notation(lag.arm.ring).names
        values = dict(lag.description.numbers.values) | lag.constants
        state |= {written[name]: values[name] for name in written}
        tau = np.array(found["tau"].subs(state).evalf(), dtype=float)[:, 0]
        assert np.abs(tau - lag.evaluate(lag.tau, *map(np.array, (q, qd, qdd)))).max() < 1e-12
        assert found["M"].is_symmetric()
        assert isinstance(found["V"], sympy.Expr)


@pytest.mark.slow
def test_sympy_form_of_a_puma_takes_no_simplification():
    lag = lagrangian(library_robot("puma560"), "inertial")
    assert lag.sympy(("M",))["M"].shape == (6, 6)
