"""Mistakes in the energies of a link, one of its bodies, or a rotor, which change all equations of motion."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations

from dhkit.description import Convention, Description, Joint
from dhkit.errors import DhkitError
from dhkit.expressions import ZERO
from dhkit.grading.judging.truth import Truth
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.variants import Change, Variant, added_lazily
from dhkit.symbolic.mistakes import LINK_MISTAKES, MISTAKES, ROTOR_MISTAKES, MadeAt
from dhkit.symbolic.ring import Element, element_array, translated
from dhkit.symbolic.textbook import BodyMotion, TextbookDerivation, derive

_HALF = Fraction(1, 2)
_MILLIMETRES = 1000
"""Number of millimetres in a metre."""
_SHAPES = {
    "disc_for_rod": (6,),
    "rod_about_end": (4,),
    "point_mass_for_rod": (12, 9),
    "sphere_for_rod": (Fraction(24, 5),),
    "inertia_quarter_for_rod": (3,),
    "rod_with_half_length": (Fraction(1, 4),),
}
"""Factors of a rod's m l^2/12 about its centre, such as 6 for m l^2/2, by the mistakes that make them."""
_OF_REVOLUTE_JOINTS = frozenset(
    (
        "velocity_at_joint",
        "inertia_about_joint",
        "inertia_about_com_at_joint",
        "velocity_relative_angle",
        "height_relative_angle",
    )
)
"""Mistakes with the angle of a revolute joint, or with the inertia about its axis."""
_RARER = frozenset(
    (
        "omega_unturned",
        "inertia_axes",
        "com_rotation_transposed",
        "gravity_axis",
        "gravity_axis_back",
    )
)
"""Mistakes of the textbook that are rarer than others which give the same answers."""
_INERTIA_MISTAKES = (
    "inertia_forgotten",
    "inertia_about_joint",
    "inertia_about_com_at_joint",
    "inertia_doubled",
)
"""Mistakes that may be made at some links alone, because the first link only turns about its own axis."""
_EXCHANGED_AXES = ((0, 1), (1, 2), (0, 2))
"""Pairs of axes, from 0, whose principal moments of inertia may be exchanged."""


@dataclass(frozen=True, eq=False)
class _Part:
    """Body of a link, with its name in the places of mistakes.

    Attributes
    ----------
    link
        Number of the link, from 1.
    name
        Name of the body; None if its link has no other body.
    motion
        The body's motion and energies by the derivation.
    """

    link: int
    name: str | None
    motion: BodyMotion

    @property
    def place(self) -> str:
        """Link and body in words."""
        return f"link {self.link}" if self.name is None else f"link {self.link}, {self.name}"

    def mistake(self, identity: str) -> MadeAt:
        """Return a mistake at this body alone."""
        return MadeAt(identity, self.link, self.name)


def _parts(textbook: TextbookDerivation) -> list[_Part]:
    """Return the bodies of all links."""
    parts: list[_Part] = []
    for i, link in enumerate(textbook.links, start=1):
        has_several = len(link.bodies) > 1
        for motion in link.bodies:
            name = motion.body.name if has_several else None
            parts.append(_Part(i, name, motion))
    return parts


def energy_variants(truth: Truth) -> Iterator[Variant]:
    """Yield the mistakes that change energies."""
    textbook = derive(truth.description)
    yield from _textbook(textbook)
    yield from _payloads(textbook)
    yield from _shapes(textbook)
    yield from _drives(textbook)
    yield from _slides(textbook)


def _textbook(textbook: TextbookDerivation) -> Iterator[Variant]:
    """Yield the mistakes of the textbook's derivation, the more frequent first."""
    n = textbook.arm.n
    names = [name for name in MISTAKES if name in LINK_MISTAKES | ROTOR_MISTAKES]
    several = [part for part in _parts(textbook) if part.name is not None]

    def rarity(name: str) -> int:
        return int(name in _RARER)

    # At all links, or at one.
    for name in names:
        yield Variant(
            MadeAt(name), added_lazily(_derived, textbook, MadeAt(name)), rarity=rarity(name)
        )
        for i in range(1, n + 1):
            if n == 1 or not _is_possible(textbook, name, i):
                continue
            made = MadeAt(name, i)
            yield Variant(made, added_lazily(_derived, textbook, made), f"link {i}", rarity(name))

    # At some links.
    for name in _INERTIA_MISTAKES:
        possible = [i for i in range(1, n + 1) if _is_possible(textbook, name, i)]
        for links in _subsets(possible):
            adds = added_lazily(_derived, textbook, *(MadeAt(name, i) for i in links))
            yield Variant(MadeAt(name), adds, _listed(links), 1)

    # At one of several bodies of a link.
    for name in names:
        if name not in LINK_MISTAKES:
            continue
        for part in several:
            if _is_possible(textbook, name, part.link):
                made = part.mistake(name)
                yield Variant(
                    made, added_lazily(_derived, textbook, made), part.place, 1 + rarity(name)
                )


def _is_possible(textbook: TextbookDerivation, name: str, link: int) -> bool:
    """Whether a mistake can be made at a link, from 1: a prismatic joint has no angle and no parallel axis."""
    return name not in _OF_REVOLUTE_JOINTS or textbook.arm.ring.kinds[link - 1] == "R"


def _subsets(links: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield the subsets of two links or more, except the whole set; none if there are many links."""
    if len(links) <= BOUNDS.subset_links:
        for count in range(2, len(links)):
            yield from combinations(links, count)


def _listed(links: Sequence[int]) -> str:
    """Return links in words: links 1, 2 and 4."""
    return f"links {', '.join(map(str, links[:-1]))} and {links[-1]}"


def _derived(textbook: TextbookDerivation, *made: MadeAt) -> Change:
    """Return the change of the energies if a derivation makes some mistakes."""
    wrong = derive(textbook.arm.description, made, textbook.arm.symbols)
    return Change(wrong.K - textbook.K, wrong.V - textbook.V)


# Several bodies on a link


def _payloads(textbook: TextbookDerivation) -> Iterator[Variant]:
    """Yield mistakes with a link's further bodies: left out, or placed at the first body."""
    arm = textbook.arm
    ring = textbook.arm.ring
    for part in _parts(textbook):
        if part.name is None or part.motion.body is arm.bodies[part.link - 1][0]:
            continue
        left_out = Change(-part.motion.K, -part.motion.V)
        yield Variant(part.mistake("payload_forgotten"), left_out.of, part.place)
        yield Variant(
            part.mistake("payload_not_moved"), Change(-part.motion.K, ring.zero).of, part.place, 1
        )
        adds = added_lazily(_of_description, textbook, _with_com_of_first(arm.description, part))
        yield Variant(part.mistake("payload_at_com"), adds, part.place)


def _with_com_of_first(description: Description, part: _Part) -> Description:
    """Return an arm with a body moved to the centre of mass of its link's first body."""
    joints = list(description.joints)
    own = joints[part.link - 1]
    com = own.bodies[0].com
    bodies = tuple(
        replace(body, com=com) if body.name == part.name else body for body in own.bodies
    )
    joints[part.link - 1] = replace(own, bodies=bodies)
    return replace(description, joints=tuple(joints))


# Shapes of bodies


def _shapes(textbook: TextbookDerivation) -> Iterator[Variant]:
    """Yield mistakes with the inertia: of another body, or about another point; at all bodies or at one."""
    parts = _parts(textbook)
    rods = [part for part in parts if _is_rod(part)]
    for identity, factors in _SHAPES.items():
        for factor in factors:
            yield from _scaled_inertia(textbook, identity, Fraction(factor), rods)
    yield from _scaled_inertia(textbook, "inertia_halved", _HALF, parts)
    for part in parts:
        for a, b in _EXCHANGED_AXES:
            place = f"{part.place}, I{'xyz'[a] * 2} and I{'xyz'[b] * 2}"
            adds = added_lazily(_exchanged_moments, textbook, part, a, b)
            yield Variant(part.mistake("inertia_moments_exchanged"), adds, place, 1)


def _scaled_inertia(
    textbook: TextbookDerivation, identity: str, factor: Fraction, parts: Sequence[_Part]
) -> Iterator[Variant]:
    """Yield inertias of bodies about their centres of mass times a factor: of all bodies, of some, or of one."""
    if len(parts) > 1:
        yield Variant(
            MadeAt(identity), added_lazily(_more_inertia, textbook, parts, factor - 1), rarity=1
        )
    by_link = {part.link: part for part in parts}
    has_one_each = len(by_link) == len(parts)
    if has_one_each:
        for links in _subsets(list(by_link)):
            adds = added_lazily(_more_inertia, textbook, [by_link[i] for i in links], factor - 1)
            yield Variant(MadeAt(identity), adds, _listed(links), 1)
    for part in parts:
        place = part.place if textbook.arm.n > 1 or part.name is not None else ""
        yield Variant(
            part.mistake(identity),
            added_lazily(_more_inertia, textbook, [part], factor - 1),
            place,
            1,
        )


def _is_rod(part: _Part) -> bool:
    """Whether an inertia is a rod's m l^2/12, with the centre of mass at half its length from the link's frame.

    With the centre at c = l/2 it is I = m (2 |c|)^2 / 12, so that 12 I = 4 m c . c.
    """
    body = part.motion.body
    square = body.com @ body.com
    if not square:
        return False
    twelvefold = body.mass * square * 4
    return any((body.inertia[k, k] * 12 - twelvefold).is_zero for k in range(3))


def _more_inertia(textbook: TextbookDerivation, parts: Iterable[_Part], share: Fraction) -> Change:
    """Return the change of the energies by a share of bodies' inertias: K += share * sum of w . I w / 2."""
    energies = []
    for part in parts:
        omega = part.motion.omega
        inertia = part.motion.body.inertia
        energies.append(omega @ inertia @ omega * _HALF * share)
    ring = textbook.arm.ring
    return Change(ring.sum(energies), ring.zero)


def _exchanged_moments(textbook: TextbookDerivation, part: _Part, a: int, b: int) -> Change:
    """Return the change of the energies if a body's principal moments about axes a and b are exchanged."""
    moments = part.motion.body.inertia.diagonal()
    order = list(range(3))
    order[a] = b
    order[b] = a
    difference = moments[order] - moments

    # K += sum over k of w_k^2 (I'_kk - I_kk) / 2
    omega = part.motion.omega
    ring = textbook.arm.ring
    return Change(
        ring.sum(omega[k] * omega[k] * difference[k] * _HALF for k in range(3)), ring.zero
    )


# Drives


def _drives(textbook: TextbookDerivation) -> Iterator[Variant]:
    """Yield mistakes with drives: exchanged with another joint's, or with an inverted gear ratio."""
    arm = textbook.arm
    for i, j in combinations(range(arm.n), 2):
        if arm.rotor[i] or arm.rotor[j]:
            place = f"joints {i + 1} and {j + 1}"
            yield Variant(
                MadeAt("drives_exchanged"),
                added_lazily(_exchanged_drives, textbook, i, j),
                place,
                1,
            )
    driven = [i for i in range(arm.n) if arm.rotor[i] and _inverse(arm.gear[i]) is not None]
    if driven:
        yield Variant(
            MadeAt("gear_inverted"), added_lazily(_inverted_gears, textbook, driven), rarity=1
        )
    if arm.n > 1:
        for i in driven:
            made = MadeAt("gear_inverted", i + 1)
            yield Variant(made, added_lazily(_inverted_gears, textbook, [i]), f"joint {i + 1}", 1)


def _exchanged_drives(textbook: TextbookDerivation, i: int, j: int) -> Change:
    """Return the change of the energies if the drives of joints i and j are exchanged.

    With the armatures J (rotor inertias on the joints' side), K += (J_j - J_i) (qd_i^2 - qd_j^2) / 2.
    """
    arm = textbook.arm
    difference = arm.armature[j] - arm.armature[i]
    square_i = arm.ring.rate(i) * arm.ring.rate(i)
    square_j = arm.ring.rate(j) * arm.ring.rate(j)
    return Change(difference * (square_i - square_j) * _HALF, arm.ring.zero)


def _inverted_gears(textbook: TextbookDerivation, joints: Iterable[int]) -> Change:
    """Return the change of the energies if gear ratios r of joints are inverted: K += I (1/r^2 - r^2) qd^2 / 2."""
    arm = textbook.arm
    energies = []
    for i in joints:
        ratio = arm.gear[i]
        inverse = _inverse(ratio)
        if inverse is not None:
            rate = arm.ring.rate(i)
            energies.append(
                arm.rotor[i] * (inverse * inverse - ratio * ratio) * rate * rate * _HALF
            )
    return Change(arm.ring.sum(energies), arm.ring.zero)


def _inverse(gear: Element) -> Element | None:
    """Return the reciprocal of a gear ratio; None if the ratio is not a number."""
    terms = gear.terms
    if len(terms) != 1 or any(any(monomial) for monomial in terms):
        return None
    return gear.ring.number(1 / next(iter(terms.values())))


# Positions


def _slides(textbook: TextbookDerivation) -> Iterator[Variant]:
    """Yield mistakes in positions of links: the variable of one prismatic joint is missing."""
    ring = textbook.arm.ring
    for k in range(ring.n):
        if ring.kinds[k] == "R":
            continue
        for i in range(k, ring.n):
            place = f"link {i + 1}, q{k + 1}" if ring.n > 1 else ""
            adds = added_lazily(_without_slide, textbook, textbook.links[i].bodies, k)
            yield Variant(MadeAt("slide_forgotten", i + 1), adds, place, 1)
        for part in _parts(textbook):
            if part.name is not None and part.link > k:
                adds = added_lazily(_without_slide, textbook, [part.motion], k)
                yield Variant(part.mistake("slide_forgotten"), adds, f"{part.place}, q{k + 1}", 2)


def _without_slide(textbook: TextbookDerivation, motions: Iterable[BodyMotion], k: int) -> Change:
    """Return the change if a prismatic joint k, from 0, is fixed at zero in the positions of bodies.

    With the wrong position p' and velocity v' of a centre of mass, K += m (v' . v' - v . v) / 2, V -= m g . (p' - p).
    """
    arm = textbook.arm
    ring = textbook.arm.ring
    fixed = {ring.place("position", k): ring.zero}
    K = ring.zero
    V = ring.zero
    for motion in motions:
        position = element_array([translated(x, ring, fixed) for x in motion.com])
        velocity = element_array([x.by_time() for x in position])
        mass = motion.body.mass
        K = K + mass * (velocity @ velocity - motion.velocity @ motion.velocity) * _HALF
        V = V - mass * (arm.gravity @ (position - motion.com))
    return Change(K, V)


# The table from which the dynamics are derived


def table_variants(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes in the table that the equations come from."""
    textbook = derive(truth.description)
    description = textbook.arm.description

    # The other convention.
    is_standard = description.convention is Convention.STANDARD
    other = replace(
        description, convention=Convention.MODIFIED if is_standard else Convention.STANDARD
    )
    yield Variant(
        MadeAt("convention_in_dynamics"), added_lazily(_of_description, textbook, other), rarity=1
    )

    # Twists with the opposite sign: all of them, or one.
    twisted = [
        i for i, joint in enumerate(description.joints) if not (joint.alpha - -joint.alpha).is_zero
    ]
    if len(twisted) > 1:
        wrong = _with_twists_reversed(description, twisted)
        yield Variant(
            MadeAt("twist_sign_in_dynamics"), added_lazily(_of_description, textbook, wrong), "", 1
        )
    for i in twisted:
        wrong = _with_twists_reversed(description, [i])
        made = MadeAt("twist_sign_in_dynamics", i + 1)
        yield Variant(made, added_lazily(_of_description, textbook, wrong), f"row {i + 1}", 1)

    # Lengths in millimetres, if some are numbers.
    if any(map(_has_length_in_numbers, description.joints)):
        wrong = replace(description, joints=tuple(map(_in_millimetres, description.joints)))
        made = MadeAt("millimetres_for_metres")
        yield Variant(made, added_lazily(_of_description, textbook, wrong), rarity=1)

    # The offset of a joint variable forgotten.
    for i, joint in enumerate(description.joints):
        is_revolute = description.kinds[i] == "R"
        offset = joint.theta if is_revolute else joint.d
        if offset.is_zero:
            continue
        without = replace(joint, theta=ZERO) if is_revolute else replace(joint, d=ZERO)
        joints = (*description.joints[:i], without, *description.joints[i + 1 :])
        adds = added_lazily(_of_description, textbook, replace(description, joints=joints))
        yield Variant(MadeAt("offset_in_dynamics", i + 1), adds, f"q{i + 1}", 1)


def _has_length_in_numbers(joint: Joint) -> bool:
    """Whether a length of a row, or of its bodies' centres of mass, is a number other than 0."""
    lengths = [joint.a, joint.d]
    for body in joint.bodies:
        lengths += body.com
    return any(not length.symbols and not length.is_zero for length in lengths)


def _in_millimetres(joint: Joint) -> Joint:
    """Return a row whose lengths are multiplied by a thousand; inertias stay."""
    bodies = []
    for body in joint.bodies:
        x, y, z = body.com
        bodies.append(replace(body, com=(x * _MILLIMETRES, y * _MILLIMETRES, z * _MILLIMETRES)))
    return replace(joint, a=joint.a * _MILLIMETRES, d=joint.d * _MILLIMETRES, bodies=tuple(bodies))


def _with_twists_reversed(description: Description, links: Collection[int]) -> Description:
    """Return an arm with -alpha instead of alpha in some rows, from 0."""
    joints = list(description.joints)
    for i in links:
        joints[i] = replace(joints[i], alpha=-joints[i].alpha)
    return replace(description, joints=tuple(joints))


def _of_description(textbook: TextbookDerivation, description: Description) -> Change:
    """Return the change of the energies to those of another description; zero if its ring has other constants."""
    ring = textbook.arm.ring
    try:
        wrong = derive(description, symbols=textbook.arm.symbols)
        K = translated(wrong.K, ring, {})
        V = translated(wrong.V, ring, {})
    except (KeyError, DhkitError):
        return Change(ring.zero, ring.zero)
    return Change(K - textbook.K, V - textbook.V)
