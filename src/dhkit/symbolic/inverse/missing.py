"""Why an arm has no closed form: which of its axes do not meet or are not parallel, and by how much."""

from __future__ import annotations

import numpy as np

from dhkit.symbolic.inverse.chain import ExactChain
from dhkit.symbolic.ring import Element

_INSTEAD = "use arm.ik_numeric, or arm.ik with the package ssik (pip install 'dhkit-robotics[ik]')"


def why_not(chain: ExactChain) -> str:
    """Return one sentence that says what is missing for a closed form, and what to use instead."""
    n = chain.n
    kinds = chain.description.kinds
    count = f"{n}R" if set(kinds) == {"R"} else kinds
    return f"no closed form is known for these {count} axes: {_missing(chain)}; {_INSTEAD}"


def _missing(chain: ExactChain) -> str:
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
    if not (chain.alpha[3][0].is_zero and chain.alpha[4][0].is_zero):
        found += [_angle(chain, i) for i in (4, 5) if not chain.alpha[i - 1][0].is_zero]
    found += [
        f"axes {i} and {i + 1} miss each other by {_length(chain, chain.a[i - 1])}" for i in (4, 5) if chain.a[i - 1]
    ]
    if chain.d[4]:
        found.append(f"axes 4 and 6 meet axis 5 {_length(chain, chain.d[4])} apart")
    return ", ".join(found) or "its links have no length where two axes are parallel"


def _number(chain: ExactChain, element: Element) -> float:
    return float(element.value([chain.values.get(g.text, 0.0) for g in chain.ring.generators]))


def _degrees(chain: ExactChain, i: int) -> float:
    c, s = (_number(chain, x) for x in chain.alpha[i - 1])
    return float(np.degrees(np.arctan2(abs(s), abs(c))))


def _angle(chain: ExactChain, i: int) -> str:
    """Return how axes i and i + 1 lie to each other; neither parallel nor at right angles as is needed."""
    angle = _degrees(chain, i)
    text = f"{angle:.4g}" if min(abs(angle), abs(angle - 90)) > 1e-3 or angle in (0.0, 90.0) else f"{angle:.12g}"
    return f"axes {i} and {i + 1} are at {text} degrees"


def _relation(chain: ExactChain, i: int) -> str:
    length = _length(chain, chain.a[i - 1])
    return f"{_angle(chain, i)} and {length} apart"


def _length(chain: ExactChain, element: Element) -> str:
    return f"{1000 * abs(_number(chain, element)):.4g} mm"
