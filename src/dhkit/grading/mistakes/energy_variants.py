"""Mistakes in the energies of a link, one of its bodies, or a rotor, which change all equations of motion."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations

from dhkit.description import Convention, Description, Joint
from dhkit.errors import DhkitError
from dhkit.expressions import ZERO, Expression
from dhkit.grading.judging.truth import Truth
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.variants import Change, Variant, make_lazily
from dhkit.symbolic.mistakes import LINK_MISTAKES, MISTAKES, ROTOR_MISTAKES, MadeAt
from dhkit.symbolic.ring import Element, element_array, translated
from dhkit.symbolic.textbook import BodyMotion, TextbookDerivation, derive

_HALF = Fraction(1, 2)
_MILLIMETRES = 1000
_SHAPES = {
    "disc_for_rod": (6,),
    "rod_about_end": (4,),
    "point_mass_for_rod": (12, 9),
    "sphere_for_rod": (Fraction(24, 5),),
    "inertia_quarter_for_rod": (3,),
    "rod_with_half_length": (Fraction(1, 4),),
}
"""By mistake: factors of a rod's m l^2/12 about its centre, such as 6 for m l^2/2."""
_OF_TURNING = frozenset(("velocity_at_joint", "inertia_about_joint", "inertia_about_com_at_joint")) | frozenset(
    ("velocity_relative_angle", "height_relative_angle")
)
"""Mistakes with the angle of a revolute joint, or with the inertia about its axis."""
_RARER = frozenset(("omega_unturned", "inertia_axes", "com_rotation_transposed", "gravity_axis", "gravity_axis_back"))
"""Mistakes of the textbook that are rarer than others which give the same answers."""
_INERTIA_MISTAKES = ("inertia_forgotten", "inertia_about_joint", "inertia_about_com_at_joint", "inertia_doubled")
"""Mistakes that may be made at some links alone, because the first link only turns about its own axis."""
_EXCHANGED_AXES = ((0, 1), (1, 2), (0, 2))


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
    return [
        _Part(i, motion.body.name if len(link.bodies) > 1 else None, motion)
        for i, link in enumerate(textbook.links, start=1)
        for motion in link.bodies
    ]


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

    for name in names:
        yield Variant(MadeAt(name), make_lazily(_derived, textbook, MadeAt(name)), rarity=rarity(name))
        for i in range(1, n + 1):
            if n == 1 or not _is_possible(textbook, name, i):
                continue
            made = MadeAt(name, i)
            yield Variant(made, make_lazily(_derived, textbook, made), f"link {i}", rarity(name))
    for name in _INERTIA_MISTAKES:
        for links in _subsets([i for i in range(1, n + 1) if _is_possible(textbook, name, i)]):
            make = make_lazily(_derived, textbook, *(MadeAt(name, i) for i in links))
            yield Variant(MadeAt(name), make, _listed(links), 1)
    for name in names:
        for part in several if name in LINK_MISTAKES else ():
            if _is_possible(textbook, name, part.link):
                made = part.mistake(name)
                yield Variant(made, make_lazily(_derived, textbook, made), part.place, 1 + rarity(name))


def _is_possible(textbook: TextbookDerivation, name: str, link: int) -> bool:
    """Whether a mistake can be made at a link, from 1: a sliding joint has no angle and no parallel axis."""
    return name not in _OF_TURNING or textbook.arm.ring.kinds[link - 1] == "R"


def _subsets(links: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield the subsets of at least two links, without all of them; none of more than four links."""
    if len(links) <= BOUNDS.subset_links:
        for count in range(2, len(links)):
            yield from combinations(links, count)


def _listed(links: Sequence[int]) -> str:
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
        yield Variant(part.mistake("payload_not_moved"), Change(-part.motion.K, ring.zero).of, part.place, 1)
        make = make_lazily(_of_description, textbook, _with_com_of_first(arm.description, part))
        yield Variant(part.mistake("payload_at_com"), make, part.place)


def _with_com_of_first(description: Description, part: _Part) -> Description:
    """Return an arm with a body moved to the centre of mass of its link's first body."""
    joints = list(description.joints)
    own = joints[part.link - 1]
    bodies = (replace(body, com=own.bodies[0].com) if body.name == part.name else body for body in own.bodies)
    joints[part.link - 1] = replace(own, bodies=tuple(bodies))
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
            make = make_lazily(_exchanged_moments, textbook, part, a, b)
            yield Variant(part.mistake("inertia_moments_exchanged"), make, place, 1)


def _scaled_inertia(
    textbook: TextbookDerivation, identity: str, factor: Fraction, parts: Sequence[_Part]
) -> Iterator[Variant]:
    if len(parts) > 1:
        yield Variant(MadeAt(identity), make_lazily(_more_inertia, textbook, parts, factor - 1), rarity=1)
    by_link = {part.link: part for part in parts}
    for links in _subsets([*by_link]) if len(by_link) == len(parts) else ():
        make = make_lazily(_more_inertia, textbook, [by_link[i] for i in links], factor - 1)
        yield Variant(MadeAt(identity), make, _listed(links), 1)
    for part in parts:
        place = part.place if textbook.arm.n > 1 or part.name is not None else ""
        yield Variant(part.mistake(identity), make_lazily(_more_inertia, textbook, [part], factor - 1), place, 1)


def _is_rod(part: _Part) -> bool:
    """Whether an inertia is a rod's m l^2/12, with the centre of mass at half its length from the link's frame."""
    body = part.motion.body
    square = body.com @ body.com
    moment = body.mass * square * 4
    return bool(square) and any((body.inertia[k, k] * 12 - moment).is_zero for k in range(3))


def _more_inertia(textbook: TextbookDerivation, parts: Iterable[_Part], share: Fraction) -> Change:
    ring = textbook.arm.ring
    motions = [part.motion for part in parts]
    energies = [motion.omega @ motion.body.inertia @ motion.omega * _HALF * share for motion in motions]
    return Change(ring.sum(energies), ring.zero)


def _exchanged_moments(textbook: TextbookDerivation, part: _Part, a: int, b: int) -> Change:
    tensor = part.motion.body.inertia
    omega = part.motion.omega
    order = list(range(3))
    order[a], order[b] = b, a
    moments = tensor.diagonal()
    difference = moments[order] - moments
    ring = textbook.arm.ring
    return Change(ring.sum(omega[k] * omega[k] * difference[k] * _HALF for k in range(3)), ring.zero)


# Drives


def _drives(textbook: TextbookDerivation) -> Iterator[Variant]:
    arm = textbook.arm
    for i, j in combinations(range(arm.n), 2):
        if arm.rotor[i] or arm.rotor[j]:
            place = f"joints {i + 1} and {j + 1}"
            yield Variant(MadeAt("drives_exchanged"), make_lazily(_exchanged_drives, textbook, i, j), place, 1)
    driven = [i for i in range(arm.n) if arm.rotor[i] and _inverse(arm.gear[i]) is not None]
    if driven:
        yield Variant(MadeAt("gear_inverted"), make_lazily(_inverted_gears, textbook, driven), rarity=1)
    for i in driven if arm.n > 1 else ():
        made = MadeAt("gear_inverted", i + 1)
        yield Variant(made, make_lazily(_inverted_gears, textbook, [i]), f"joint {i + 1}", 1)


def _exchanged_drives(textbook: TextbookDerivation, i: int, j: int) -> Change:
    arm = textbook.arm
    difference = arm.armature[j] - arm.armature[i]
    squares = [arm.ring.rate(k) * arm.ring.rate(k) for k in (i, j)]
    return Change(difference * (squares[0] - squares[1]) * _HALF, arm.ring.zero)


def _inverted_gears(textbook: TextbookDerivation, joints: Iterable[int]) -> Change:
    arm = textbook.arm
    energies = []
    for i in joints:
        inverse = _inverse(arm.gear[i])
        if inverse is not None:
            rate = arm.ring.rate(i)
            energies.append(arm.rotor[i] * (inverse * inverse - arm.gear[i] * arm.gear[i]) * rate * rate * _HALF)
    return Change(arm.ring.sum(energies), arm.ring.zero)


def _inverse(gear: Element) -> Element | None:
    """Return the reciprocal of a gear ratio; None if the ratio is not a number."""
    terms = gear.terms
    if len(terms) != 1 or any(any(monomial) for monomial in terms):
        return None
    return gear.ring.number(1 / next(iter(terms.values())))


# Positions


def _slides(textbook: TextbookDerivation) -> Iterator[Variant]:
    """Yield mistakes in positions of links: the variable of one sliding joint is missing."""
    ring = textbook.arm.ring
    for k in range(ring.n):
        if ring.kinds[k] == "R":
            continue
        for i in range(k, ring.n):
            place = f"link {i + 1}, q{k + 1}" if ring.n > 1 else ""
            make = make_lazily(_without_slide, textbook, textbook.links[i].bodies, k)
            yield Variant(MadeAt("slide_forgotten", i + 1), make, place, 1)
        for part in _parts(textbook):
            if part.name is not None and part.link > k:
                make = make_lazily(_without_slide, textbook, [part.motion], k)
                yield Variant(part.mistake("slide_forgotten"), make, f"{part.place}, q{k + 1}", 2)


def _without_slide(textbook: TextbookDerivation, motions: Iterable[BodyMotion], k: int) -> Change:
    """Return the change if a sliding joint is fixed at zero in the positions of bodies, not in their orientations."""
    arm = textbook.arm
    ring = textbook.arm.ring
    K, V = ring.zero, ring.zero
    for motion in motions:
        place = element_array([translated(x, ring, {ring.place("position", k): ring.zero}) for x in motion.com])
        velocity = element_array([x.by_time() for x in place])
        mass = motion.body.mass
        K = K + mass * (velocity @ velocity - motion.velocity @ motion.velocity) * _HALF
        V = V - mass * (arm.gravity @ (place - motion.com))
    return Change(K, V)


# The table behind the dynamics


def table_variants(truth: Truth) -> Iterator[Variant]:
    """Yield mistakes in the table that the equations come from."""
    textbook = derive(truth.description)
    description = textbook.arm.description
    standard = description.convention is Convention.STANDARD
    other = replace(description, convention=Convention.MODIFIED if standard else Convention.STANDARD)
    yield Variant(MadeAt("convention_in_dynamics"), make_lazily(_of_description, textbook, other), rarity=1)
    turned = [i for i, joint in enumerate(description.joints) if not (joint.alpha - -joint.alpha).is_zero]
    for links in ([turned] if len(turned) > 1 else []) + [[i] for i in turned]:
        made = MadeAt("twist_sign_in_dynamics", links[0] + 1 if len(links) == 1 else None)
        place = f"row {links[0] + 1}" if len(links) == 1 else ""
        wrong = _with_twists_turned(description, links)
        yield Variant(made, make_lazily(_of_description, textbook, wrong), place, 1)

    if any(not x.symbols and not x.is_zero for joint in description.joints for x in _lengths(joint)):
        wrong = replace(description, joints=tuple(map(_in_millimetres, description.joints)))
        made = MadeAt("millimetres_for_metres")
        yield Variant(made, make_lazily(_of_description, textbook, wrong), rarity=1)
    for i, joint in enumerate(description.joints):
        offset = "theta" if description.kinds[i] == "R" else "d"
        if not getattr(joint, offset).is_zero:
            without = replace(joint, theta=ZERO) if offset == "theta" else replace(joint, d=ZERO)
            joints = (*description.joints[:i], without, *description.joints[i + 1 :])
            make = make_lazily(_of_description, textbook, replace(description, joints=joints))
            yield Variant(MadeAt("offset_in_dynamics", i + 1), make, f"q{i + 1}", 1)


def _lengths(joint: Joint) -> list[Expression]:
    """Return the lengths of a row and of its bodies' centres of mass, m."""
    return [joint.a, joint.d, *(x for body in joint.bodies for x in body.com)]


def _in_millimetres(joint: Joint) -> Joint:
    """Return a row whose lengths are multiplied by a thousand; inertias stay."""
    bodies = tuple(
        replace(body, com=(x * _MILLIMETRES, y * _MILLIMETRES, z * _MILLIMETRES))
        for body in joint.bodies
        for x, y, z in [body.com]
    )
    return replace(joint, a=joint.a * _MILLIMETRES, d=joint.d * _MILLIMETRES, bodies=bodies)


def _with_twists_turned(description: Description, links: Collection[int]) -> Description:
    joints = tuple(
        replace(joint, alpha=-joint.alpha) if i in links else joint for i, joint in enumerate(description.joints)
    )
    return replace(description, joints=joints)


def _of_description(textbook: TextbookDerivation, description: Description) -> Change:
    """Return the change of the energies to another description's; zero if its ring has other constants."""
    ring = textbook.arm.ring
    try:
        wrong = derive(description, symbols=textbook.arm.symbols)
        K = translated(wrong.K, ring, {})
        V = translated(wrong.V, ring, {})
    except (KeyError, DhkitError):
        return Change(ring.zero, ring.zero)
    return Change(K - textbook.K, V - textbook.V)
