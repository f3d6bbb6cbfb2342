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
"""Coefficients of an element by monomials, the exponents of the ring's generators."""
_UNITS = frozenset((Fraction(1000), Fraction(1000) ** 2, Fraction(1, 1000), Fraction(1, 1000) ** 2))
"""Factors of terms with lengths in mm instead of m, or the reverse."""


@dataclass(frozen=True)
class Slip:
    """A slip in one entry.

    Attributes
    ----------
    identity
        Identifier of the mistake in the catalogue.
    detail
        The term: as it was handed in, or, if it is missing, as it should be.
    kind
        Kind and links of missing terms, in words; empty for other slips.
    right
        The right term where another one was handed in; empty for other slips.
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
    """Return the kind of terms and their links in words: gravity, rates and accelerations, as parameters show them."""
    description = arm.description
    gravity: set[str] = set()
    for component in description.gravity:
        gravity |= component.symbols

    # Names in the terms, also those of which a constant of the ring is made.
    used = [terms.ring.generators[k] for k in sorted(terms.used_generators)]
    constants: set[str] = set()
    for generator in used:
        if generator.kind == "constant":
            constants |= {generator.text, *(generator.meaning or ZERO).symbols}

    words = []
    if constants & gravity:
        words.append("gravity")
    for kind in ("acceleration", "rate"):
        joints = sorted(generator.joint + 1 for generator in used if generator.kind == kind)
        if joints:
            words.append(f"the {_listed(kind, joints)}")

    # Inertias may be written with lengths, which other links have too: masses are the better sign of a link.
    by_mass: set[int] = set()
    by_inertia: set[int] = set()
    for i, joint in enumerate(description.joints, start=1):
        for body in joint.bodies:
            if constants & body.mass.symbols:
                by_mass.add(i)
            if any(constants & moment.symbols for moment in vars(body.inertia).values()):
                by_inertia.add(i)
    links = sorted(by_mass or by_inertia)
    if links:
        words.append(_listed("link", links))
    return ", ".join(words)


def _listed(noun: str, numbers: Sequence[int]) -> str:
    """Return a noun with numbers: link 2, links 1 and 3, rate of joint 1, rates of joints 1 and 2."""
    plural = "s" * (len(numbers) > 1)
    texts = [str(number) for number in numbers]
    listed = " and ".join(texts) if len(texts) < 3 else f"{', '.join(texts[:-1])} and {texts[-1]}"
    return (
        f"{noun}{plural} {listed}"
        if noun == "link"
        else f"{noun}{plural} of joint{plural} {listed}"
    )


def _slip(answer: Element, truth: Element) -> Slip | None:
    """Return the slip by which two elements differ as they are written; None if it is not one slip."""
    ring = truth.ring
    right = truth.terms
    wrong = answer.terms
    changed: dict[tuple[int, ...], Fraction] = {}
    for m in {*right, *wrong}:
        change = wrong.get(m, Fraction(0)) - right.get(m, Fraction(0))
        if change:
            changed[m] = change
    if not changed or len(changed) > BOUNDS.changed_terms:
        return None

    # Terms that stand instead of others.
    missing = {m: right[m] for m in changed if m not in wrong}
    new = {m: c for m, c in changed.items() if m not in missing}
    if missing and len(missing) == len(new):
        slip = _replaced(ring, missing, new)
        if slip:
            return slip

    # Terms with another coefficient, zero for missing ones; or a further term.
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
    """Return the slip if terms have another factor, the same for all of them.

    Parameters
    ----------
    ring
        Ring of the terms.
    shared
        Changes of the coefficients of these terms.
    right
        All right terms.
    """
    factors = {(right[m] + c) / right[m] for m, c in shared.items()}
    if len(factors) != 1:
        return None

    # Terms with the same sines, cosines and rates are one term for a person, however many parameters multiply it.
    are_one_term = (
        len(shared) <= BOUNDS.slip_terms or len({_state_part(ring, m) for m in shared}) == 1
    )
    are_whole_entry = len(shared) > 1 and len(shared) == len(right)
    if not are_one_term or are_whole_entry:
        return None

    (factor,) = factors
    terms = plain_text(ring.from_terms({m: right[m] for m in shared}))
    if factor == 0:
        are_mixed = all(_is_mixed_term(m, right) for m in shared)
        return Slip("square_of_sum" if are_mixed else "term_missing", terms)
    if factor == -1:
        return Slip("term_sign", terms)
    if factor in _UNITS:
        return Slip("millimetres_for_metres", terms)
    wrong = plain_text(ring.from_terms({m: right[m] * factor for m in shared}))
    return Slip("term_factor", wrong, right=terms)


def _state_part(ring: PolynomialRing, term: tuple[int, ...]) -> tuple[int, ...]:
    """Return a term without its parameters."""
    return tuple(
        0 if g.kind == "constant" else e for g, e in zip(ring.generators, term, strict=True)
    )


def _is_mixed_term(term: tuple[int, ...], right: _Terms) -> bool:
    """Whether a term is the mixed term of a square whose other terms occur: 2 a b of a^2 + 2 a b + b^2.

    With the terms A = a^2 and B = b^2 the term T = 2 a b has T^2 = 4 A B.
    """
    for first in right:
        if first == term or right[first] <= 0:
            continue
        # The exponents of B = T^2 / A.
        second = tuple(2 * t - a for t, a in zip(term, first, strict=True))
        is_term = second in right and second != first and min(second) >= 0
        if is_term and right[term] ** 2 == 4 * right[first] * right[second]:
            return True
    return False


def _replaced(ring: PolynomialRing, missing: _Terms, new: _Terms) -> Slip | None:
    """Return the slip if terms replace others, all of them by the same exchange of generators."""
    pairs = _paired(missing, new)
    if pairs is not None:
        return _slip_of_pairs(ring, pairs, missing, new)

    # With another sign besides: of two changes at once, only squares of rates are certain enough to be named.
    pairs = _paired(missing, {m: -c for m, c in new.items()})
    slip = _slip_of_pairs(ring, pairs, missing, new) if pairs else None
    return slip if slip is not None and slip.identity == "centrifugal_index" else None


def _slip_of_pairs(
    ring: PolynomialRing,
    pairs: Mapping[tuple[int, ...], tuple[int, ...]],
    missing: _Terms,
    new: _Terms,
) -> Slip | None:
    """Return the slip if new terms stand instead of missing ones by the same exchange of generators."""
    exchanges = {_exponents_less(new_term, old_term) for old_term, new_term in pairs.items()}
    if len(exchanges) != 1:
        return None
    (exchange,) = exchanges
    removed = [(ring.generators[k], -e) for k, e in enumerate(exchange) if e < 0]
    added = [(ring.generators[k], e) for k, e in enumerate(exchange) if e > 0]
    wrong = plain_text(ring.from_terms(dict(new)))
    right = plain_text(ring.from_terms(dict(missing)))
    return Slip(_identity(ring, removed, added, next(iter(pairs))), wrong, right=right)


def _paired(old: _Terms, new: _Terms) -> dict[tuple[int, ...], tuple[int, ...]] | None:
    """Return the new term for each old one, matched by coefficients and common factors; None without a match."""
    pairs: dict[tuple[int, ...], tuple[int, ...]] = {}
    left = dict(new)
    for m, c in old.items():
        alike = [other for other in left if left[other] == c]
        if not alike:
            return None
        # The nearest in exponents; of several the first in the order of their exponents.
        distances = [sum(map(abs, _exponents_less(other, m))) for other in alike]
        _, nearest = min(zip(distances, alike, strict=True))
        pairs[m] = nearest
        del left[nearest]
    return pairs


def _exponents_less(term: tuple[int, ...], other: tuple[int, ...]) -> tuple[int, ...]:
    """Return the exponents of a term less those of another."""
    return tuple(a - b for a, b in zip(term, other, strict=True))


def _identity(
    ring: PolynomialRing,
    removed: list[tuple[Generator, int]],
    added: list[tuple[Generator, int]],
    old: tuple[int, ...],
) -> str:
    """Return the mistake that an exchange of generators in a term is.

    Parameters
    ----------
    ring
        Ring of the term.
    removed, added
        Generators that the exchange removes and adds, with exponents.
    old
        The term before the exchange.
    """
    if not added:
        remaining = [
            old[ring.generators.index(generator)] - exponent for generator, exponent in removed
        ]
        return "exponent_dropped" if all(remaining) else "factor_missing"
    if not removed:
        return "factor_extra"
    kinds = {generator.kind for generator, _ in (*removed, *added)}
    if (
        kinds == {"sine", "cosine"}
        and len(removed) == len(added) == 1
        and removed[0][0].joints == added[0][0].joints
    ):
        return "term_function"
    if kinds <= {"sine", "cosine"}:
        return "term_angle"
    if kinds <= {"rate", "acceleration"}:
        of_squares = [(generator.kind, exponent) for generator, exponent in (*removed, *added)]
        return "centrifugal_index" if of_squares == [("rate", 2)] * 2 else "term_rate"
    if kinds == {"constant"}:
        return "term_parameter"
    return "term_replaced"
