"""The reason for which an arm has no closed form: axes that do not meet or are not parallel, and by how much."""

from __future__ import annotations

import numpy as np

from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.ring import Element

_ANY_ARM = "use arm.ik_numeric"
_SIX = "use arm.ik, which finds its solutions without, or arm.ik_numeric"
_SEVEN = (
    "no closed form for a pose alone: 7 joints have more freedom than a pose asks for; "
    "use arm.ik(T, redundancy=...), which returns all solutions at a redundancy, or arm.ik_numeric"
)


def why_not(chain: ExactChain) -> str:
    """Return one sentence on the condition of a closed form that is not met, and on the alternatives."""
    n = chain.n
    kinds = chain.description.kinds
    if kinds == "RRRRRRR":
        return _SEVEN
    count = f"{n}R" if set(kinds) == {"R"} else kinds
    instead = _SIX if count == "6R" else _ANY_ARM
    return f"no closed form is known for these {count} axes: {_missing(chain)}; {instead}"


def _missing(chain: ExactChain) -> str:
    """Return the properties of a known family that the arm lacks, or the relations of its axes."""
    n = chain.n
    kinds = chain.description.kinds
    if n > 6:
        return f"{n} joints have more freedom than a pose asks for"
    if n < 2:
        return "one joint alone meets no pose"
    if kinds not in ("RRRRRR", "RRPRRR"):
        return ", ".join(_relation(chain, i) for i in range(1, n))
    found = []
    if not chain.alpha[0][0].is_zero:
        found.append(_angle(chain, 1))
    if kinds == "RRRRRR" and not chain.alpha[1][1].is_zero:
        found.append(_angle(chain, 2))
    if kinds == "RRPRRR" and not chain.alpha[1][0].is_zero:
        found.append(_angle(chain, 2))

    # A spherical wrist: axes 4, 5 and 6 at right angles in turn, through one point.
    found += [_angle(chain, i) for i in (4, 5) if not chain.alpha[i - 1][0].is_zero]
    apart = [i for i in (4, 5) if chain.a[i - 1]]
    found += [
        f"axes {i} and {i + 1} miss each other by {_length(chain, chain.a[i - 1])}" for i in apart
    ]
    if chain.d[4]:
        found.append(f"axes 4 and 6 meet axis 5 {_length(chain, chain.d[4])} apart")
    return ", ".join(found) or "its links have no length where two axes are parallel"


def _number(chain: ExactChain, element: Element) -> float:
    """Return the value of an element where all joint values are 0."""
    return float(element.value([chain.values.get(g.text, 0.0) for g in chain.ring.generators]))


def _degrees(chain: ExactChain, i: int) -> float:
    """Return the angle between axes i and i + 1, 0 to 90 degrees."""
    c, s = (_number(chain, x) for x in chain.alpha[i - 1])
    return float(np.degrees(np.arctan2(abs(s), abs(c))))


def _angle(chain: ExactChain, i: int) -> str:
    """Return the angle between axes i and i + 1 in words; near 0 and 90 degrees with more digits."""
    angle = _degrees(chain, i)
    off = min(abs(angle), abs(angle - 90))
    text = f"{angle:.12g}" if 0.0 < off <= 1e-3 else f"{angle:.4g}"
    return f"axes {i} and {i + 1} are at {text} degrees"


def _relation(chain: ExactChain, i: int) -> str:
    """Return the angle and the distance between axes i and i + 1 in words."""
    length = _length(chain, chain.a[i - 1])
    return f"{_angle(chain, i)} and {length} apart"


def _length(chain: ExactChain, element: Element) -> str:
    return f"{1000 * abs(_number(chain, element)):.4g} mm"
