"""The cause that a student reads: of two explanations the one that the rest of the sheet allows, at the right place."""

import pytest

from dhkit import Arm
from dhkit.description import from_toml

PLANAR, POLAR, CART = (Arm.load(name) for name in ("planar2r", "polar_rp", "cart_pendulum"))
ELBOW = Arm(
    from_toml("""
format = 1
name = "elbow3"
convention = "standard"
gravity = [0, 0, "-g"]
[parameters]
g = 9.81
d1 = 0.5
a2 = 0.4
a3 = 0.3
m1 = 4
m2 = 3
m3 = 2
[[joint]]
type = "revolute"
a = 0
alpha = "pi/2"
d = "d1"
theta = 0
body = { mass = "m1", com = [0, "-d1/2", 0], inertia = { xx = "m1*d1^2/12", zz = "m1*d1^2/12" } }
[[joint]]
type = "revolute"
a = "a2"
alpha = 0
d = 0
theta = 0
body = { mass = "m2", com = ["-a2/2", 0, 0], inertia = { yy = "m2*a2^2/12", zz = "m2*a2^2/12" } }
[[joint]]
type = "revolute"
a = "a3"
alpha = 0
d = 0
theta = 0
body = { mass = "m3", com = ["-a3/2", 0, 0], inertia = { yy = "m3*a3^2/12", zz = "m3*a3^2/12" } }
""")
)
GEARED = Arm(
    from_toml("""
format = 1
name = "geared"
convention = "standard"
gravity = [0, "-g", 0]
[parameters]
g = 9.81
l = 0.5
m = 2
N = 50
J = 1e-4
[[joint]]
type = "revolute"
a = "l"
alpha = 0
d = 0
theta = 0
body = { mass = "m", com = ["-l/2", 0, 0], inertia = { yy = "m*l^2/12", zz = "m*l^2/12" } }
drive = { gear = "N", rotor_inertia = "J" }
""")
)
M = [
    ["m1*l1^2/3 + m2*(l1^2 + l2^2/3 + l1*l2*c2)", "m2*(l2^2/3 + l1*l2*c2/2)"],
    ["m2*(l2^2/3 + l1*l2*c2/2)", "m2*l2^2/3"],
]
K = "m1*l1^2*qd1^2/6 + m2*(l1^2*qd1^2 + l1*l2*c2*qd1*(qd1 + qd2) + l2^2*(qd1 + qd2)^2/3)/2"
V = "m1*g*l1*s1/2 + m2*g*(l1*s1 + l2*s12/2)"
G = ["m1*g*l1*c1/2 + m2*g*(l1*c1 + l2*c12/2)", "m2*g*l2*c12/2"]
H = ["-m2*l1*l2*s2*(qd1*qd2 + qd2^2/2)", "m2*l1*l2*s2*qd1^2/2"]
TAU = [f"({M[i][0]})*qdd1 + ({M[i][1]})*qdd2 + {H[i]}" for i in (0, 1)]
C = [["-m2*l1*l2*s2*qd2/2", "-m2*l1*l2*s2*(qd1 + qd2)/2"], ["m2*l1*l2*s2*qd1/2", "0"]]
ELBOW_V = "m1*g*d1/2 + m2*g*(d1 + a2*s2/2) + m3*g*(d1 + a2*s2 + {})"


def changed(rows, i, j, entry):
    return [
        [entry if (i, j) == (a, b) else old for b, old in enumerate(row)]
        for a, row in enumerate(rows)
    ]


def halved(rows):
    return [[f"({entry})/2" for entry in row] for row in rows]


CASES = {
    # One entry of C: named there, and the others of its row are not blamed
    "C: a rate": (
        PLANAR,
        {"C": changed(C, 0, 1, "-m2*l1*l2*s2*qd1/2")},
        {"C12": "term_missing", "no C11": None},
    ),
    "C: sign": (
        PLANAR,
        {"C": changed(C, 0, 1, f"-({C[0][1]})")},
        {"C12": "entry_sign", "no C11": None},
    ),
    "C: half": (
        PLANAR,
        {"C": changed(C, 1, 0, f"({C[1][0]})/2")},
        {"C21": "term_factor", "no C22": None},
    ),
    "C: zero": (PLANAR, {"C": changed(C, 0, 1, "0")}, {"C12": "entry_zero", "no C11": None}),
    "C: polar": (
        POLAR,
        {"C": [["m2*q2*qd2", "m2*q2*qd2"], ["-m2*q2*qd1", "0"]]},
        {"C12": "term_rate", "no C11": None},
    ),
    "C: cart": (
        CART,
        {"C": [["0", "-mp*l*s2*qd2"], ["0", "0"]]},
        {"C12": "term_factor", "no C11": None},
    ),
    # What a right answer on the sheet denies
    "M halved": (PLANAR, {"K": K, "M": halved(M)}, {"M11": "entry_halved"}),
    "M halved alone": (PLANAR, {"M": halved(M)}, {"M11": "half_squared"}),
    "L and tau": (
        PLANAR,
        {"V": V, "L": f"{K} + {V}", "tau": [f"{TAU[i]} - ({G[i]})" for i in (0, 1)]},
        {"L": "lagrangian_sum", "tau1": "lagrangian_sum"},
    ),
    # Zeros
    "h = 0": (PLANAR, {"h": ["0", "0"]}, {"h1": "velocity_torques_missing"}),
    "C = 0": (PLANAR, {"C": [["0", "0"], ["0", "0"]]}, {"C11": "velocity_torques_missing"}),
    "g = 0": (PLANAR, {"g": ["0", "0"]}, {"g1": "gravity_torques_missing"}),
    "g2 = 0": (PLANAR, {"g": [G[0], "0"]}, {"g2": "entry_zero"}),
    "M12 = 0": (PLANAR, {"M12": "0"}, {"M12": "entry_zero"}),
    # The first wrong answer, not what follows from it
    "K, then h": (
        PLANAR,
        {"M": changed(changed(M, 0, 1, "m2*l1*l2*c2/2"), 1, 0, "m2*l1*l2*c2/2"), "h": H},
        {"M12": "term_missing"},
    ),
    # Angles, heights, bodies
    "own angle in the height": (
        ELBOW,
        {"V": ELBOW_V.format("a3*s3/2")},
        {"V": "height_relative_angle"},
    ),
    "height lacks a link": (
        ELBOW,
        {"V": ELBOW_V.format("a3*s23/2 - a2*s2")},
        {"V": "term_missing"},
    ),
    "cosine in the heights": (
        PLANAR,
        {"M": M, "g": ["-" + G[0].replace("c", "s").replace("+ m2", "- m2"), "-m2*g*l2*s12/2"]},
        {"g1": "height_sin_cos"},
    ),
    "discs at two links of three": (
        ELBOW,
        {
            "M33": "m3*a3^2/4 + m3*a3^2/2",
            "M22": "m2*a2^2/4 + m2*a2^2/2 + m3*(a2^2 + a2*a3*c3 + a3^2/4) + m3*a3^2/2",
        },
        {"M33": "disc_for_rod", "M22": "disc_for_rod"},
    ),
    "weight on the waist": (ELBOW, {"g1": "m2*g*a2*c1/2"}, {"g1": "weight_on_vertical_axis"}),
    "sum of angles in g only": (
        PLANAR,
        {"g": [e.replace("c12", "(c1 + c2)") for e in G]},
        {"g1": "sum_of_angles_split"},
    ),
    # Terms
    "square of a length": (Arm.load("planar3r"), {"M33": "m3*l3/3"}, {"M33": "exponent_dropped"}),
    "a factor": (PLANAR, {"g": [G[0], "m2*l2*c12/2"]}, {"g2": "factor_missing"}),
    "a cosine": (PLANAR, {"g": [G[0], "m2*g*l2/2"]}, {"g2": "factor_missing"}),
    "square of a rate": (PLANAR, {"h": [H[0], "m2*l1*l2*s2*qd1/2"]}, {"h2": "exponent_dropped"}),
    "square of a cosine": (ELBOW, {"g3": "m3*g*a3*c23^2/2"}, {"g3": "factor_extra"}),
    # Units, gears
    "1/N^2": (GEARED, {"M11": "m*l^2/3 + J/N^2"}, {"M11": "gear_inverted"}),
    "N": (GEARED, {"M11": "m*l^2/3 + J*N"}, {"M11": "rotor_gear"}),
    "millimetres": (
        PLANAR,
        {"g": ["m1*g*250*c1 + m2*g*(500*c1 + 200*c12)", "m2*g*200*c12"]},
        {"g1": "millimetres_for_metres"},
    ),
    "centimetres": (
        PLANAR,
        {"g": ["m1*g*25*c1 + m2*g*(50*c1 + 20*c12)", "m2*g*20*c12"]},
        {"g1": "centimetres_for_metres"},
    ),
    "inches": (
        PLANAR,
        {"g": ["m1*g*(0.25/0.0254)*c1 + m2*g*(0.5*c1 + 0.2*c12)/0.0254", "m2*g*(0.2/0.0254)*c12"]},
        {"g1": "inches_for_metres"},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_cause_is_the_one_that_was_made(case):
    arm, answers, expected = CASES[case]
    report = arm.grade(answers)
    named = {entry: one.mistake for one in report.diagnosis for entry in one.entries}
    wrong = {entry.name for entry in report.entries if entry.verdict.value == "wrong"}
    for entry, mistake in expected.items():
        if entry.startswith("no "):
            assert entry[3:] not in wrong, str(report)
        else:
            assert named.get(entry) == mistake, str(report)


def test_a_parameter_stays_as_it_is_written():
    doubled = [[entry.replace("m2", "(2*m2)") for entry in row] for row in M]
    report = PLANAR.grade(M=doubled, g=[entry.replace("m2", "(2*m2)") for entry in G])
    assert "m2: a parameter counts twice." in str(report)
