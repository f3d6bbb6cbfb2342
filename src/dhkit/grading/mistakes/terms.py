"""What a wrong answer's terms show where no mistake of the library fits: what is missing, extra, or off by a factor."""

from __future__ import annotations

from fractions import Fraction

from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.exact.compact import shortened_alike
from dhkit.symbolic.ring import Element

SHOWN = 3
"""Terms of each kind that are named."""


def describe(arm: ExactArm, answer: Element, truth: Element) -> str:
    """Return in words how the terms of an answer differ from those of the truth.

    Parameters
    ----------
    arm
        Whose ring they are of.
    answer, truth
        Elements of it.
    """
    # All three in the angles in which they differ least: c12 is one term where c1*c2 - s1*s2 is two.
    truth, answer, _ = shortened_alike(arm, [truth, answer, answer - truth])
    ours, theirs, ring = truth.terms, answer.terms, truth.ring

    def text(terms: dict[tuple[int, ...], Fraction]) -> str:
        return plain_text(ring.from_terms(terms))

    missing = [text({m: c}) for m, c in ours.items() if m not in theirs]
    extra = [text({m: c}) for m, c in theirs.items() if m not in ours]
    factors = [
        f"{text({m: theirs[m]})} in place of {text({m: c})}" for m, c in ours.items() if m in theirs and theirs[m] != c
    ]
    parts = [
        f"{what} {_listed(found)}"
        for what, found in (("missing:", missing), ("too much:", extra), ("another factor:", factors))
        if found
    ]
    return "; ".join(parts) or "the terms are the same"


def _listed(found: list[str]) -> str:
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return ", ".join(found[:SHOWN]) + more
