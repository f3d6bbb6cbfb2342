"""Ten solutions of the PUMA's inverse kinematics as students hand them in: edits of docs/examples/puma_ik.py."""

from pathlib import Path

RIGHT = (Path(__file__).parents[2] / "docs" / "examples" / "puma_ik.py").read_text()

EDITS = {
    "right": [],
    "one branch": [
        ("for shoulder in (1, -1)", "for shoulder in (1,)"),
        ("for elbow in (1, -1)", "for elbow in (1,)"),
        ("for wrist in (1, -1)", "for wrist in (1,)"),
    ],
    "atan for atan2": [
        ("q1 = atan2(y, x) +", "q1 = atan(y / x) +"),
        ("import acos, asin,", "import acos, asin, atan,"),
    ],
    "no shoulder offset": [("beta = asin(min(1, d3 / rho))", "beta = 0.0")],
    "degrees": [
        (
            "solutions.append([q1, q2, q3, q4, q5, q6])",
            "solutions.append(np.degrees([q1, q2, q3, q4, q5, q6]))",
        )
    ],
    "fails at singular poses": [
        ("q4, q6 = 0.0, atan2(W[1, 0], W[0, 0] if W[2, 2] > 0 else -W[0, 0])", "q4 = q6 = 0 / 0")
    ],
    "slow": [
        ("    solutions = []\n", "    solutions = []\n    import time\n\n    time.sleep(0.05)\n")
    ],
    "sign of the elbow": [("- atan2(d4, a3)", "+ atan2(d4, a3)")],
    "wrist transposed": [("W = R03.T @ T[:3, :3]", "W = (R03.T @ T[:3, :3]).T")],
    "raises out of reach": [
        ("        if abs(K) > R + 1e-9:\n            continue\n", ""),
        ("max(-1, min(1, K / R))", "K / R"),
        ("    if rho < d3 - 1e-9:\n        return []\n", ""),
    ],
}
"""What was replaced by what."""


def solution(name):
    """Return the text of a solution."""
    text = RIGHT
    for old, new in EDITS[name]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text
