"""Arms of six and seven joints of the kinds that are solved by elimination or at a given redundancy."""

from dhkit import Arm

RIGHT = "pi/2"
LEFT = "-pi/2"


def arm(rows, name):
    return Arm.from_dh([tuple(row) for row in rows], name=name)


# Published dimensions are given with their makers' names.
SIX = {
    "FANUC CRX-10iA": arm(
        [
            (0, 0, 0, LEFT),
            (0, 0, 0.54, 0),
            (0, 0, 0, LEFT),
            (0, 0.54, 0, RIGHT),
            (0, -0.15, 0, LEFT),
            (0, 0.16, 0, 0),
        ],
        "crx",
    ),
    "UFACTORY xArm 6": arm(
        [
            (0, 0.267, 0, LEFT),
            (0, 0, 0.28949, 0),
            (0, 0, 0.0775, LEFT),
            (0, 0.3425, 0, RIGHT),
            (0, 0, 0.076, LEFT),
            (0, 0.097, 0, 0),
        ],
        "xarm6",
    ),
    "Kinova Gen3 Lite": Arm.from_dh(
        [
            (0, 0, 0, 243.3),
            (90, 0, 90, 30),
            (180, 280, 90, 20),
            (90, 0, 90, 245),
            (90, 0, 180, 57),
            (90, 0, 90, 235),
        ],
        order=("alpha", "a", "theta", "d"),
        angle="deg",
        length="mm",
        convention="modified",
        name="gen3_lite",
    ),
    "oblique wrist": arm(
        [
            (0, 0.3, 0.1, LEFT),
            (0, 0.05, 0.5, "pi"),
            (0, 0.1, 0.1, LEFT),
            (0, 0.5, 0, "pi/3"),
            (0, 0.2, 0.05, "-pi/4"),
            (0, 0.1, 0.1, "0.3"),
        ],
        "oblique",
    ),
    "axes 5 and 6 meet": arm(
        [
            (0, 0.3, 0.1, LEFT),
            (0, 0.05, 0.5, 0),
            (0, 0.1, 0.1, LEFT),
            (0, 0.5, 0.1, "pi/3"),
            (0, 0.2, 0, "-pi/4"),
            (0, 0.1, 0.1, "0.3"),
        ],
        "meets_56",
    ),
    "axis 1 is tilted": arm(
        [
            (0, 0.3, 0.1, "0.7"),
            (0, 0.05, 0.5, 0),
            (0, 0.1, 0.1, LEFT),
            (0, 0.5, 0, "pi/3"),
            (0, 0.2, 0.1, "-pi/4"),
            (0, 0.1, 0.1, "0.3"),
        ],
        "tilted",
    ),
}
"""Arms with parallel axes 2 and 3."""

GENERAL = {
    "general": arm(
        [
            (0, 0.3, 0.1, "1.2"),
            (0, 0.1, 0.4, "0.3"),
            (0, 0.05, 0.3, "-1.0"),
            (0, 0.2, 0.1, "0.9"),
            (0, 0.1, 0.05, "-1.3"),
            (0, 0.1, 0.02, "0.4"),
        ],
        "general",
    ),
    "right angles": arm(
        [
            (0, 0.3, 0.1, RIGHT),
            (0, 0.1, 0.4, LEFT),
            (0, 0.2, 0.1, RIGHT),
            (0, 0.3, 0.05, LEFT),
            (0, 0.1, 0.07, RIGHT),
            (0, 0.1, 0, 0),
        ],
        "right",
    ),
    "three parallel axes, offset wrist": arm(
        [
            (0, 0.3, 0.1, LEFT),
            (0, 0.05, 0.5, 0),
            (0, 0.1, 0.4, 0),
            (0, 0.1, 0, RIGHT),
            (0, 0.1, 0.1, LEFT),
            (0, 0.1, 0, 0),
        ],
        "three",
    ),
    "two parallel axes, offsets at both ends of the wrist": arm(
        [
            (0, 0.3, 0.1, LEFT),
            (0, 0.05, 0.5, 0),
            (0, 0.1, 0.1, LEFT),
            (0, 0.5, 0.06, "pi/3"),
            (0, 0.2, 0.1, "-pi/4"),
            (0, 0.1, 0.1, "0.3"),
        ],
        "both",
    ),
}
"""Arms of any geometry."""

SEVEN = {
    "Franka Panda": Arm.load("panda"),
    "UFACTORY xArm 7": arm(
        [
            (0, 0.267, 0, LEFT),
            (0, 0, 0, RIGHT),
            (0, 0.293, 0.0525, RIGHT),
            (0, 0, 0.0775, RIGHT),
            (0, 0.3425, 0, RIGHT),
            (0, 0, 0.076, LEFT),
            (0, 0.097, 0, 0),
        ],
        "xarm7",
    ),
    "KUKA iiwa 14": arm(
        [
            (0, 0.36, 0, LEFT),
            (0, 0, 0, RIGHT),
            (0, 0.42, 0, RIGHT),
            (0, 0, 0, LEFT),
            (0, 0.4, 0, LEFT),
            (0, 0, 0, RIGHT),
            (0, 0.126, 0, 0),
        ],
        "iiwa",
    ),
    "an iiwa with offsets": arm(
        [
            (0, 0.36, 0, LEFT),
            ("0.2", 0, 0, RIGHT),
            (0, 0.42, 0.05, RIGHT),
            (0, 0, 0.07, LEFT),
            (0, 0.4, 0, RIGHT),
            (0, 0, 0, RIGHT),
            ("0.3", 0.126, 0.1, "0.4"),
        ],
        "iiwa_offset",
    ),
    "oblique elbow and wrist": arm(
        [
            (0, 0.36, 0, LEFT),
            (0, 0, 0, RIGHT),
            (0, 0.42, 0.05, "1.1"),
            (0, 0.1, 0.1, "-1.3"),
            (0, 0.4, 0, "-0.7"),
            (0, 0.2, 0.1, "0.9"),
            (0, 0.126, 0.1, "0.2"),
        ],
        "oblique7",
    ),
}
"""Arms of seven joints with a closed form at a given redundancy."""

GEN3 = arm(
    [
        (0, -0.2848, 0, RIGHT),
        (0, -0.0118, 0, RIGHT),
        (0, -0.4208, 0, RIGHT),
        (0, -0.0128, 0, RIGHT),
        (0, -0.3143, 0, RIGHT),
        (0, 0, 0, RIGHT),
        (0, -0.1674, 0, "pi"),
    ],
    "gen3",
)
"""Kinova Gen3: offsets of 12 mm keep axes 1, 2 and 3 from meeting."""
