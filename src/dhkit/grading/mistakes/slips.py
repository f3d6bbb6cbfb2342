"""Slips in single terms of an entry: missing, doubled, with another sign, factor, exponent, index or function."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.exact.compact import shortened_alike
from dhkit.symbolic.ring import Element, Generator, Ring

Terms = Mapping[tuple[int, ...], Fraction]
UNITS = frozenset((Fraction(1000), Fraction(1000) ** 2, Fraction(1, 1000), Fraction(1, 1000) ** 2))
"""Factors of a term in millimetres."""
MAX_CHANGED = 16
"""Terms in which an answer and the truth may differ for a slip to be looked for."""
MAX_TERMS = 4
"""Terms that one slip changes alike: m2*(l1^2 + l2^2) may stand multiplied out."""


@dataclass(frozen=True)
class Slip:
    """A slip in one entry.

    Attributes
    ----------
    identity
        Of the mistake.
    detail
        Which term, and what stands in its place.
    """

    identity: str
    detail: str


def slip_in(arm: ExactArm, answer: Element, truth: Element) -> Slip | None:
    """Return the one slip in a term that makes an answer of the truth; None where there is none, or more.

    Parameters
    ----------
    arm
        Whose ring they are of.
    answer, truth
        Elements of it, which differ.
    """
    short_truth, short_answer, _ = shortened_alike(arm, [truth, answer, answer - truth])
    return _slip(short_answer, short_truth) or _slip(answer, truth)


def _slip(answer: Element, truth: Element) -> Slip | None:
    ring, right, wrong = truth.ring, truth.terms, answer.terms
    changed = {m: wrong.get(m, Fraction(0)) - right.get(m, Fraction(0)) for m in {*right, *wrong}}
    changed = {m: c for m, c in changed.items() if c}
    if not changed or len(changed) > MAX_CHANGED:
        return None
    gone = {m: right[m] for m, c in changed.items() if m not in wrong}
    come = {m: c for m, c in changed.items() if m not in gone}
    if gone and len(gone) == len(come) and (slip := _replaced(ring, gone, come)):
        return slip
    shared = {m: c for m, c in changed.items() if m in right}
    extra = {m: c for m, c in changed.items() if m not in right}
    if not extra:
        return _rescaled(ring, shared, right)
    if not shared:
        if len(extra) > 1:
            return None
        (term,) = extra.items()
        return Slip("term_extra", plain_text(ring.from_terms(dict([term]))))
    return None


def _rescaled(ring: Ring, shared: Terms, right: Terms) -> Slip | None:
    """Return a slip by which terms have another factor, all the same one."""
    factors = {(right[m] + c) / right[m] for m, c in shared.items()}
    # What stands beside one and the same sine is one term of a person's, however many parameters multiply it.
    is_one = len(shared) <= MAX_TERMS or len({_state_part(ring, m) for m in shared}) == 1
    if len(factors) != 1 or not is_one or (len(shared) > 1 and len(shared) == len(right)):
        return None
    (factor,) = factors
    terms = plain_text(ring.from_terms({m: right[m] for m in shared}))
    if factor == 0:
        mixed = all(_is_mixed_term(m, right) for m in shared)
        return Slip("square_of_sum" if mixed else "term_missing", terms)
    if factor == -1:
        return Slip("term_sign", terms)
    if factor in UNITS:
        return Slip("millimetres_for_metres", terms)
    wrong = plain_text(ring.from_terms({m: right[m] * factor for m in shared}))
    return Slip("term_factor", f"{wrong} in place of {terms}")


def _state_part(ring: Ring, term: tuple[int, ...]) -> tuple[int, ...]:
    """Return a term without its parameters."""
    return tuple(0 if g.kind == "constant" else e for g, e in zip(ring.generators, term, strict=True))


def _is_mixed_term(term: tuple[int, ...], right: Terms) -> bool:
    """Whether a term is the 2ab of a square of which a^2 and b^2 are there."""
    for a in right:
        if a == term or right[a] <= 0:
            continue
        b = tuple(2 * t - x for t, x in zip(term, a, strict=True))
        if b in right and b != a and min(b) >= 0 and right[term] ** 2 == 4 * right[a] * right[b]:
            return True
    return False


def _replaced(ring: Ring, gone: Terms, come: Terms) -> Slip | None:
    """Return a slip by which terms stand in others' places: all of them with the same exchange of generators."""
    pairs = _paired(gone, come)
    if pairs is None:
        return None
    exchanges = {tuple(b - a for a, b in zip(old, new, strict=True)) for old, new in pairs.items()}
    if len(exchanges) != 1:
        return None
    (exchange,) = exchanges
    less = [(ring.generators[k], -e) for k, e in enumerate(exchange) if e < 0]
    more = [(ring.generators[k], e) for k, e in enumerate(exchange) if e > 0]
    new, old = plain_text(ring.from_terms(dict(come))), plain_text(ring.from_terms(dict(gone)))
    return Slip(_kind(ring, less, more, next(iter(pairs))), f"{new} in place of {old}")


def _paired(old: Terms, new: Terms) -> dict[tuple[int, ...], tuple[int, ...]] | None:
    """Return which new term stands for which old one, by their coefficients and what they have in common."""
    pairs: dict[tuple[int, ...], tuple[int, ...]] = {}
    left = dict(new)
    for m, c in old.items():
        near = sorted(
            (sum(abs(a - b) for a, b in zip(m, other, strict=True)), other) for other in left if left[other] == c
        )
        if not near:
            return None
        pairs[m] = near[0][1]
        del left[near[0][1]]
    return pairs


def _kind(
    ring: Ring, gone: list[tuple[Generator, int]], come: list[tuple[Generator, int]], old: tuple[int, ...]
) -> str:
    """Return what an exchange of generators in a term is called."""
    if not come:
        left = [old[ring.generators.index(generator)] - exponent for generator, exponent in gone]
        return "exponent_dropped" if all(left) else "factor_missing"
    if not gone:
        return "factor_extra"
    kinds = {generator.kind for generator, _ in (*gone, *come)}
    if kinds == {"sine", "cosine"} and len(gone) == len(come) == 1 and gone[0][0].joints == come[0][0].joints:
        return "term_function"
    if kinds <= {"sine", "cosine"}:
        return "term_angle"
    if kinds <= {"rate", "acceleration"}:
        return "term_rate"
    if kinds == {"constant"}:
        return "term_parameter"
    return "term_replaced"
