"""The PUMA 560's forward and inverse kinematics, as a student writes them: dhkit check puma560 puma_ik.py."""

from math import acos, asin, atan2, cos, hypot, pi, sin, sqrt

import numpy as np

d1, a2, a3, d3, d4 = 0.67183, 0.4318, 0.0203, 0.15005, 0.4318
alpha = [pi / 2, 0, -pi / 2, pi / 2, -pi / 2, 0]
a = [0, a2, a3, 0, 0, 0]
d = [d1, 0, d3, d4, 0, 0]


def link(i, q):
    c, s, ca, sa = cos(q), sin(q), cos(alpha[i]), sin(alpha[i])
    return np.array(
        [
            [c, -s * ca, s * sa, a[i] * c],
            [s, c * ca, -c * sa, a[i] * s],
            [0, sa, ca, d[i]],
            [0, 0, 0, 1],
        ]
    )


def fk(q):
    T = np.eye(4)
    for i in range(6):
        T = T @ link(i, q[i])
    return T


def ik(T):
    x, y, z = T[:3, 3]
    rho = hypot(x, y)
    if rho < d3 - 1e-9:
        return []
    solutions = []
    for shoulder in (1, -1):
        beta = asin(min(1, d3 / rho))
        q1 = atan2(y, x) + (beta if shoulder == 1 else pi - beta)
        X, Z = x * cos(q1) + y * sin(q1), z - d1
        K = (X**2 + Z**2 - a2**2 - a3**2 - d4**2) / (2 * a2)
        R = sqrt(a3**2 + d4**2)
        if abs(K) > R + 1e-9:
            continue
        for elbow in (1, -1):  # rounding may lead beyond 1 where the arm is stretched
            q3 = elbow * acos(max(-1, min(1, K / R))) - atan2(d4, a3)
            q2 = atan2(Z, X) - atan2(a3 * sin(q3) + d4 * cos(q3), a2 + a3 * cos(q3) - d4 * sin(q3))
            R03 = (link(0, q1) @ link(1, q2) @ link(2, q3))[:3, :3]
            W = R03.T @ T[:3, :3]
            for wrist in (1, -1):
                q5 = wrist * atan2(hypot(W[0, 2], W[1, 2]), W[2, 2])
                if abs(sin(q5)) > 1e-9:
                    q4 = atan2(-wrist * W[1, 2], -wrist * W[0, 2])
                    q6 = atan2(-wrist * W[2, 1], wrist * W[2, 0])
                else:  # axes 4 and 6 are in line: only their sum counts
                    q4, q6 = 0.0, atan2(W[1, 0], W[0, 0] if W[2, 2] > 0 else -W[0, 0])
                solutions.append([q1, q2, q3, q4, q5, q6])
    return solutions
