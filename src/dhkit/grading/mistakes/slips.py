"""Slips in a term of an entry: a missing term, or another sign, factor, exponent, index or function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from dhkit.expressions import ZERO
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.exact.compact import shortened_alike
from dhkit.symbolic.ring import Element, Generator
from dhkit.symbolic.ring.elements import PolynomialRing

_Terms = Mapping[tuple[int, ...], Fraction]
_UNITS = frozenset((Fraction(1000), Fraction(1000) ** 2, Fraction(1, 1000), Fraction(1, 1000) ** 2))
"""Factors of terms with lengths in mm instead of m, or the reverse."""


@dataclass(frozen=True)
class Slip:
    """A slip in one entry.

    Attributes
    ----------
    identity
        Identity of the mistake.
    detail
        The term: as it was handed in, or, if it is missing, as it should be.
    kind
        Of missing terms, of what kind they are and of which links, in words; empty for others.
    right
        The right term where another one was handed in; empty for others.
    """

    identity: str
    detail: str
    kind: str = ""
    right: str = ""


def slip_in(arm: ExactArm, answer: Element, truth: Element) -> Slip | None:
    """Return the slip in a term that turns the truth into an answer; None if there is none, or more than one.

    Parameters
    ----------
    arm
        Arm to whose ring the elements belong.
    answer, truth
        Different elements of the ring.
    """
    short_truth, short_answer, _ = shortened_alike(arm, [truth, answer, answer - truth])
    slip = _slip(short_answer, short_truth) or _slip(answer, truth)
    if slip is None or slip.identity != "term_missing":
        return slip
    return replace(slip, kind=kind_of_terms(arm, truth - answer))


def kind_of_terms(arm: ExactArm, terms: Element) -> str:
    """Return in words of what kind terms are, and of which links: gravity, rates and accelerations, by parameters."""
    description = arm.description
    gravity = {name for component in description.gravity for name in component.symbols}
    bodies = [(i, body) for i, joint in enumerate(description.joints, start=1) for body in joint.bodies]
    used = [g for k, g in enumerate(terms.ring.generators) if any(monomial[k] for monomial in terms.terms)]
    constants = {name for g in used if g.kind == "constant" for name in {g.text, *(g.meaning or ZERO).symbols}}
    words = ["gravity"] if constants & gravity else []
    for kind, called in (("acceleration", "acceleration"), ("rate", "rate")):
        joints = sorted(g.joint + 1 for g in used if g.kind == kind)
        words += [f"the {_listed(called, joints)}"] if joints else []
    by_mass = {i for i, body in bodies if constants & set(body.mass.symbols)}
    # Inertias may be written with lengths, which other links have too.
    by_inertia = {i for i, body in bodies if any(constants & set(x.symbols) for x in vars(body.inertia).values())}
    concerned = sorted(by_mass or by_inertia)
    words += [_listed("link", concerned)] if concerned else []
    return ", ".join(words)


def _listed(called: str, numbers: Sequence[int]) -> str:
    """Return link 2, links 1 and 3, rate of joint 1, rates of joints 1 and 2."""
    plural = "s" * (len(numbers) > 1)
    named = (
        " and ".join(map(str, numbers))
        if len(numbers) < 3
        else f"{', '.join(map(str, numbers[:-1]))} and {numbers[-1]}"
    )
    return f"{called}{plural} {named}" if called == "link" else f"{called}{plural} of joint{plural} {named}"


def _slip(answer: Element, truth: Element) -> Slip | None:
    ring = truth.ring
    right = truth.terms
    wrong = answer.terms
    changed = {m: wrong.get(m, Fraction(0)) - right.get(m, Fraction(0)) for m in {*right, *wrong}}
    changed = {m: c for m, c in changed.items() if c}
    if not changed or len(changed) > BOUNDS.changed_terms:
        return None
    missing = {m: right[m] for m, c in changed.items() if m not in wrong}
    new = {m: c for m, c in changed.items() if m not in missing}
    if missing and len(missing) == len(new) and (slip := _replaced(ring, missing, new)):
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


def _rescaled(ring: PolynomialRing, shared: _Terms, right: _Terms) -> Slip | None:
    """Return the slip if terms have another factor, the same for all of them."""
    factors = {(right[m] + c) / right[m] for m, c in shared.items()}
    # Terms with the same sines, cosines and rates are one term for a person, however many parameters multiply it.
    is_one = len(shared) <= BOUNDS.slip_terms or len({_state_part(ring, m) for m in shared}) == 1
    if len(factors) != 1 or not is_one or (len(shared) > 1 and len(shared) == len(right)):
        return None
    (factor,) = factors
    terms = plain_text(ring.from_terms({m: right[m] for m in shared}))
    if factor == 0:
        mixed = all(_is_mixed_term(m, right) for m in shared)
        return Slip("square_of_sum" if mixed else "term_missing", terms)
    if factor == -1:
        return Slip("term_sign", terms)
    if factor in _UNITS:
        return Slip("millimetres_for_metres", terms)
    wrong = plain_text(ring.from_terms({m: right[m] * factor for m in shared}))
    return Slip("term_factor", wrong, right=terms)


def _state_part(ring: PolynomialRing, term: tuple[int, ...]) -> tuple[int, ...]:
    """Return a term without its parameters."""
    return tuple(0 if g.kind == "constant" else e for g, e in zip(ring.generators, term, strict=True))


def _is_mixed_term(term: tuple[int, ...], right: _Terms) -> bool:
    """Whether a term is the 2ab of a square whose a^2 and b^2 occur."""
    for a in right:
        if a == term or right[a] <= 0:
            continue
        b = tuple(2 * t - x for t, x in zip(term, a, strict=True))
        if b in right and b != a and min(b) >= 0 and right[term] ** 2 == 4 * right[a] * right[b]:
            return True
    return False


def _replaced(ring: PolynomialRing, missing: _Terms, new: _Terms) -> Slip | None:
    """Return the slip if terms replace others, all of them by the same exchange of generators."""
    pairs = _paired(missing, new)
    if pairs is None:
        turned = _paired(missing, {m: -c for m, c in new.items()})
        slip = _of_pairs(ring, turned, missing, new) if turned else None
        # Of two changes at once, one of them a sign, squares of rates are certain enough to be named.
        return slip if slip is not None and slip.identity == "centrifugal_index" else None
    return _of_pairs(ring, pairs, missing, new)


def _of_pairs(
    ring: PolynomialRing, pairs: Mapping[tuple[int, ...], tuple[int, ...]], missing: _Terms, new: _Terms
) -> Slip | None:
    """Return the slip if new terms stand instead of missing ones by the same exchange of generators."""
    exchanges = {tuple(b - a for a, b in zip(old, new, strict=True)) for old, new in pairs.items()}
    if len(exchanges) != 1:
        return None
    (exchange,) = exchanges
    removed = [(ring.generators[k], -e) for k, e in enumerate(exchange) if e < 0]
    added = [(ring.generators[k], e) for k, e in enumerate(exchange) if e > 0]
    wrong, right = (plain_text(ring.from_terms(dict(terms))) for terms in (new, missing))
    return Slip(_identity(ring, removed, added, next(iter(pairs))), wrong, right=right)


def _paired(old: _Terms, new: _Terms) -> dict[tuple[int, ...], tuple[int, ...]] | None:
    """Return the new term for each old one, matched by coefficients and common factors; None without a match."""
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


def _identity(
    ring: PolynomialRing, removed: list[tuple[Generator, int]], added: list[tuple[Generator, int]], old: tuple[int, ...]
) -> str:
    """Return the identity of an exchange of generators in a term."""
    if not added:
        left = [old[ring.generators.index(generator)] - exponent for generator, exponent in removed]
        return "exponent_dropped" if all(left) else "factor_missing"
    if not removed:
        return "factor_extra"
    kinds = {generator.kind for generator, _ in (*removed, *added)}
    if kinds == {"sine", "cosine"} and len(removed) == len(added) == 1 and removed[0][0].joints == added[0][0].joints:
        return "term_function"
    if kinds <= {"sine", "cosine"}:
        return "term_angle"
    if kinds <= {"rate", "acceleration"}:
        of_squares = [(generator.kind, exponent) for generator, exponent in (*removed, *added)]
        return "centrifugal_index" if of_squares == [("rate", 2)] * 2 else "term_rate"
    if kinds == {"constant"}:
        return "term_parameter"
    return "term_replaced"
