"""Mistakes of homework on plain arms, answers derived by hand: the name says what was done."""

import math

import pytest

import dhkit
from acceptance import slow_if
from dhkit.description import from_toml

ROW = """[[joint]]
type = "{kind}"
theta = {theta}
d = {d}
a = {a}
alpha = {alpha}
{body}
"""


def arm(name, parameters, rows, gravity="[0, 0, '-g']", further=""):
    """Return an arm of rows (kind, theta, d, a, alpha, body), each as it stands in a robot file."""
    text = f'format = 1\nname = "{name}"\nconvention = "standard"\ngravity = {gravity}\n{further}\n[parameters]\n'
    text += "\n".join(f"{key} = {value}" for key, value in {"g": 9.81, **parameters}.items()) + "\n"
    for kind, theta, d, a, alpha, body in rows:
        text += ROW.format(
            kind=kind, theta=theta, d=d, a=a, alpha=alpha, body=f"body = {body}" if body else ""
        )
    return dhkit.Arm(from_toml(text))


LIFT = arm(
    "lift",
    dict(m1=3.1, m2=1.3, r=0.21, J=0.04),
    [
        ("prismatic", 0, 0, 0, "'pi/2'", "{ mass = 'm1', com = [0, 0, 0] }"),
        (
            "revolute",
            0,
            0,
            0.5,
            0,
            "{ mass = 'm2', com = ['r - 0.5', 0, 0], inertia = { zz = 'J' } }",
        ),
    ],
)
TURRET = arm(
    "turret",
    dict(
        m2=2.1, m3=0.8, a=0.16, Az=0.07, Bx=0.012, By=0.05, Bz=0.055, Cx=0.003, Cy=0.012, Cz=0.014
    ),
    [
        ("revolute", 0, 0.4, 0, "'pi/2'", "{ mass = 1, com = [0, 0, 0], inertia = { yy = 'Az' } }"),
        (
            *("revolute", "'pi/2'", 0, 0, "'pi/2'"),
            "{ mass = 'm2', com = [0, 0, 'a'], inertia = { zz = 'Bx', yy = 'By', xx = 'Bz' } }",
        ),
        (
            *("prismatic", 0, 0, 0, 0),
            "{ mass = 'm3', com = [0, 0, 0], inertia = { zz = 'Cx', yy = 'Cy', xx = 'Cz' } }",
        ),
    ],
)
SHOULDER = arm(
    "shoulder",
    dict(e=0.13, a2=0.41, m2=2.3, m3=1.2, r2=0.19, r3=0.16, A=0.05, B=0.04, D=0.016),
    [
        ("revolute", 0, 0, 0, "'pi/2'", "{ mass = 1, com = [0, 0, 0], inertia = { yy = 'A' } }"),
        (
            "revolute",
            0,
            "'e'",
            "'a2'",
            0,
            "{ mass = 'm2', com = ['r2 - a2', 0, 0], inertia = { yy = 'B', zz = 'B' } }",
        ),
        (
            "revolute",
            0,
            0,
            0.3,
            0,
            "{ mass = 'm3', com = ['r3 - 0.3', 0, 0], inertia = { yy = 'D', zz = 'D' } }",
        ),
    ],
)
WITH_TOOL = arm(
    "with_tool",
    dict(a1=0.31, a2=0.22, u=0.09, v=0.05),
    [("revolute", 0, 0, "'a1'", 0, ""), ("revolute", 0, 0, "'a2'", 0, "")],
    further="[tool]\nxyz = ['u', 'v', 0]",
)
CRANE = arm(
    "crane",
    dict(e=0.12),
    [
        ("revolute", 0, 0, 0, 0, ""),
        ("prismatic", "'-pi/2'", 0, "'e'", "'-pi/2'", ""),
        ("prismatic", 0, 0, 0, 0, ""),
    ],
)
SWING = arm(
    "swing",
    dict(l1=0.44, l2=0.36, m1=1.6, m2=0.8),
    [
        ("revolute", 0, 0, "'l1'", 0, "{ mass = 'm1', com = [0, 0, 0] }"),
        ("revolute", 0, 0, "'l2'", 0, "{ mass = 'm2', com = [0, 0, 0] }"),
    ],
    gravity="['g', 0, 0]",
)

OFFSET_M12 = "e*(m2*r2*sin(q2) + m3*a2*sin(q2) + m3*r3*sin(q2 + q3))"
OFFSET_M13 = "e*m3*r3*sin(q2 + q3)"
M33 = "D + m3*r3^2"
M23 = f"{M33} + m3*a2*r3*cos(q3)"
M22 = "B + D + m2*r2^2 + m3*(a2^2 + r3^2 + 2*a2*r3*cos(q3))"
M11 = "A + B*cos(q2)^2 + D*cos(q2 + q3)^2 + m2*(e^2 + r2^2*cos(q2)^2) + m3*(e^2 + (a2*cos(q2) + r3*cos(q2 + q3))^2)"

CASES = [
    # the velocity of the pendulum is that beside the lift
    (LIFT, {"K": "m1*qd1^2/2 + (m2*r^2 + J)*qd2^2/2"}, "slide_forgotten"),
    # the angular velocity has the axes of the column: all of Bz and Cz, nothing of Bx and Cx
    (
        TURRET,
        {
            "M": [
                ["Az + Bz + Cz + (m2*a^2 + m3*q3^2)*c2^2", 0, 0],
                [0, "By + Cy + m2*a^2 + m3*q3^2", 0],
                [0, 0, "m3"],
            ]
        },
        "omega_unturned",
    ),
    # the offset lies on the other side
    (
        SHOULDER,
        {"M": [[M11, OFFSET_M12, OFFSET_M13], [OFFSET_M12, M22, M23], [OFFSET_M13, M23, M33]]},
        "parameter_sign",
    ),
    # the tool's offset is added in the axes of the world
    (
        WITH_TOOL,
        {"T14": "a1*c1 + a2*c12 + u", "T24": "a1*s1 + a2*s12 + v"},
        "translations_unrotated",
    ),
    (
        CRANE,
        {
            "J": [
                ["e*c1 - q3*s1", "c1", "0"],
                ["e*s1 + q3*c1", "s1", "0"],
                ["0", "0", "1"],
                ["0", "0", "0"],
                ["0", "0", "0"],
                ["1", "0", "0"],
            ]
        },
        "columns_exchanged",
    ),
    (
        CRANE,
        {
            "ik": {
                "steps": [
                    {"joint": 2, "solution": "pz"},
                    {"joint": 1, "solution": "atan2(py, px)"},
                    {"joint": 3, "solution": "sqrt(px^2 + py^2)"},
                ]
            }
        },
        "length_forgotten",
    ),
    (SWING, {"C": [["0", "-m2*l1*l2*s2"], ["m2*l1*l2*s2", "0"]]}, "rates_missing"),
]


@pytest.mark.parametrize(
    ("robot", "answers", "mistake"),
    [slow_if("ik" in answers, robot, answers, mistake) for robot, answers, mistake in CASES],
    ids=[mistake for *_, mistake in CASES],
)
def test_the_mistake_is_named(robot, answers, mistake):
    report = robot.grade(answers)
    assert report.verdict.value == "wrong"
    assert mistake in [one.mistake for one in report.diagnosis], str(report)


def test_the_matrix_with_the_offset_on_its_side_is_right():
    turned = [f"-{entry}" for entry in (OFFSET_M12, OFFSET_M13)]
    right = [[M11, *turned], [turned[0], M22, M23], [turned[1], M23, M33]]
    assert SHOULDER.grade({"M": right}).verdict.passes


def test_squares_of_absolute_rates_have_an_index():
    inertial = "m2*l1*l2*cos(phi1 - phi2)"
    turning = "m2*l1*l2*sin(phi1 - phi2)"
    tau = [
        f"(m1 + m2)*l1^2*phi1dd + {inertial}*phi2dd {{}} + (m1 + m2)*g*l1*sin(phi1)",
        f"m2*l2^2*phi2dd + {inertial}*phi1dd {{}} + m2*g*l2*sin(phi2)",
    ]
    names = {
        "q": ["phi1", "phi2"],
        "qd": ["phi1d", "phi2d"],
        "qdd": ["phi1dd", "phi2dd"],
        "angles": "absolute",
    }
    right = [tau[0].format(f"+ {turning}*phi2d^2"), tau[1].format(f"- {turning}*phi1d^2")]
    wrong = [tau[0].format(f"- {turning}*phi1d^2"), tau[1].format(f"+ {turning}*phi2d^2")]
    assert SWING.grade({"tau": right}, names=names).verdict.passes
    report = SWING.grade({"tau": wrong}, names=names)
    assert {one.mistake for one in report.diagnosis} == {"centrifugal_index"}, str(report)
    # Difference and state are those of the student's angles: the answer at the state is the answer's value there.
    entry = report.entries[0]
    assert entry.difference == "m2*l1*l2*sin(q2 - q1)*qd1^2 + m2*l1*l2*sin(q2 - q1)*qd2^2"
    values = dict(entry.witness.state)
    plain = (
        wrong[0]
        .replace("phi1dd", "qdd1")
        .replace("phi2dd", "qdd2")
        .replace("phi1d", "qd1")
        .replace("phi2d", "qd2")
    )
    plain = plain.replace("phi1", "q1").replace("phi2", "q2").replace("^", "**")
    assert eval(plain, {"sin": math.sin, "cos": math.cos}, values) == pytest.approx(
        entry.witness.answer, rel=1e-9
    )
