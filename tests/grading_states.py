"""A state of the planar arm in general position, to tell formulas by their numbers."""

STATE = {
    "q1": 0.7,
    "q2": -1.1,
    "qd1": 0.9,
    "qd2": -0.4,
    "qdd1": 1.3,
    "qdd2": 0.6,
    "g": 9.81,
    "l1": 0.53,
    "l2": 0.41,
    "m1": 2.3,
    "m2": 1.7,
}
