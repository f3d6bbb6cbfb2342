"""Single local changes of a formula of inverse kinematics, each with the mistake that it corrects.

A change concerns one literal, one function, one order of arguments, one exponent, one name or one sign. Changes are
tried in the order of :data:`ORDER`: if two give the same values, the more frequent mistake is named.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import chain, combinations, islice, permutations, product

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, operands, parts_of, with_operands
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.judging import changed_formulas as formulas
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.changed_formulas import (
    applied,
    leaf_text,
    minus,
    square_of,
    times,
    with_term,
)

ORDER = (
    "atan2_arguments",
    "quadrant",
    "elbow_sign",
    "degrees_for_radians",
    "millimetres_for_metres",
    "joint_sign",
    "supplement",
    "cosine_law_factor",
    "rotation_matrix_transposed",
    "cosine_law_sign",
    "cosine_law_squares",
    "earlier_joints_forgotten",
    "root_too_much",
    "root_forgotten",
    "square_forgotten",
    "square_too_much",
    "arc_function_forgotten",
    "triangle_angle_forgotten",
    "axis_exchanged",
    "lengths_exchanged",
    "rounded_length",
    "offset_forgotten",
    "tool_length_forgotten",
    "tool_length_added",
    "tool_axis_exchanged",
    "shoulder_offset_forgotten",
    "term_function",
    "sum_of_angles_forgotten",
    "sum_of_angles_too_much",
    "term_parameter",
    "term_sign",
    "missing_offset",
    "angle_zero",
    "length_forgotten",
    "term_factor",
    "term_extra",
)
"""Mistakes in the order in which they are tried."""
_POSITIONS = POSE_NAMES[:3]
_ROTATIONS = POSE_NAMES[3:]
_ARCS = ("acos", "asin", "atan")
_ROOTS = ("sqrt", "acos", "asin")
"""Functions whose value is one of two solutions, which differ in sign."""
_SAME_LENGTH = 1e-9
"""Largest difference of two equal lengths from rounding, relative to the length."""
_MIN_MEASURE = 10
"""Smallest number that may be an angle in degrees or a length in millimetres; others are factors and exponents."""
_MAX_ROUNDED = 0.01
"""Largest difference of a rounded length from the length, relative to the length."""


@dataclass(frozen=True)
class Edit:
    """A formula with one change.

    Attributes
    ----------
    mistake
        Identity of the mistake that the change corrects.
    tree
        The changed formula.
    old, new
        The changed part before and after the change; the same part may occur in other formulas.
    """

    mistake: str
    tree: Tree
    old: Tree
    new: Tree


@dataclass(frozen=True)
class Lengths:
    """Names and numbers of a robot that formulas may contain.

    Attributes
    ----------
    parameters
        Names of the robot's parameters.
    trees
        Possible missing offsets: parameters, and those lengths of table, base and tool that are not parameters; m.
    values
        Their absolute values, m; may be empty.
    of_tool
        Absolute lengths beyond the last joint axis, of the table's last row and of the tool, m.
    """

    parameters: tuple[str, ...]
    trees: tuple[Name | Number, ...]
    values: tuple[float, ...] = ()
    of_tool: tuple[float, ...] = ()

    def is_of_tool(self, k: int) -> bool:
        """Whether the length of ``trees[k]`` is one beyond the last joint axis."""
        return any(abs(self.values[k] - size) <= _SAME_LENGTH * size for size in self.of_tool)


def edits(
    tree: Tree,
    is_revolute: bool,
    others: Sequence[str],
    offsets: Sequence[float],
    lengths: Lengths,
    mistakes: Collection[str] = ORDER,
) -> list[Edit]:
    """Return the changes of a formula in the order in which they are tried, ``BOUNDS.edits`` at most.

    Parameters
    ----------
    tree
        The formula.
    is_revolute
        Whether the formula gives an angle.
    others
        Variables of the joints of the same kind, revolute or prismatic, that the formula may use.
    offsets
        Possible constant errors, rad or m.
    lengths
        Lengths of the robot.
    mistakes
        Mistakes that are corrected; all by default.
    """
    whole = chain(
        _whole_changes(tree, is_revolute, others, offsets),
        _triangle_changes(tree, is_revolute, others, lengths),
    )
    changes = [Edit(mistake, new, tree, new) for mistake, new in whole if mistake in mistakes]
    changes += edits_of_parts(tree, lengths, mistakes)
    return sorted(changes, key=lambda edit: ORDER.index(edit.mistake))[: BOUNDS.edits]


def edits_of_parts(tree: Tree, lengths: Lengths, mistakes: Collection[str] = ORDER) -> list[Edit]:
    """Return the changes of parts of a formula, and of names throughout, in the order in which they are tried."""
    changes = []
    if "term_function" in mistakes:
        for angle in _angles(tree):
            new = formulas.with_calls_changed(tree, ("sin", "cos"), partial(_exchanged, angle))
            changes.append(Edit("term_function", new, tree, new))

    of_parts = _part_edits(tree, lengths, mistakes, lambda part: part, formulas.is_law(tree))
    changes += islice(of_parts, 2 * BOUNDS.edits)

    for mistake, change in renamings([tree], lengths):
        if mistake not in mistakes:
            continue
        new = formulas.renamed(tree, change)
        if new is not tree:
            changes.append(Edit(mistake, new, tree, new))

    return sorted(changes, key=lambda edit: ORDER.index(edit.mistake))[: BOUNDS.edits]


def _angles(tree: Tree) -> list[frozenset[str]]:
    """Return the variables of each angle whose sine or cosine a formula contains, without repetition."""
    calls = [
        part
        for part in parts_of(tree)
        if isinstance(part, Call) and part.function in ("sin", "cos")
    ]
    return list(dict.fromkeys(frozenset(names_of(call)) for call in calls))


def _exchanged(angle: frozenset[str], call: Call) -> Tree:
    """Return the cosine for the sine of an angle of these variables, and the sine for its cosine."""
    if names_of(call) != angle:
        return call
    return replace(call, function="cos" if call.function == "sin" else "sin")


# Changes of names throughout formulas


def renamings(trees: Sequence[Tree], lengths: Lengths) -> Iterator[tuple[str, dict[str, Tree]]]:
    """Yield replacements of names in formulas: another component, another length, a component less an offset."""
    names = set().union(*map(names_of, trees))
    if names & {"r12", "r13", "r21", "r23", "r31", "r32"}:
        yield (
            "rotation_matrix_transposed",
            {f"r{i}{j}": Name(f"r{j}{i}", 0) for i, j in product("123", repeat=2)},
        )
    for a, b in combinations(_POSITIONS, 2):
        if names & {a, b}:
            yield "axis_exchanged", {a: Name(b, 0), b: Name(a, 0)}
    yield from _other_angles(names)

    # Lengths that the formulas contain, by name or as numbers.
    contained = names | _decimals(trees)
    known = [length for length in lengths.trees if leaf_text(length) in contained]
    for first, second in combinations(known[: BOUNDS.offset_lengths], 2):
        yield "lengths_exchanged", {leaf_text(first): second, leaf_text(second): first}

    for place, length in enumerate(lengths.trees[: BOUNDS.offset_lengths]):
        of_tool = lengths.is_of_tool(place)
        for added in (False, True):
            yield from _other_points(
                names, length, added, of_tool, of_tool and leaf_text(length) in contained
            )

    # Another column of the rotation: the tool's z axis for its x axis.
    for j, k in combinations("123", 2):
        columns: dict[str, Tree] = {f"r{i}{j}": Name(f"r{i}{k}", 0) for i in "123"}
        columns |= {f"r{i}{k}": Name(f"r{i}{j}", 0) for i in "123"}
        if names & {*columns}:
            yield "tool_axis_exchanged", columns

    for first, second in permutations(known[: BOUNDS.offset_lengths], 2):
        for added in (True, False):
            yield "length_forgotten", {leaf_text(first): with_term(first, added, second)}


def _decimals(trees: Sequence[Tree]) -> set[str]:
    """Return the keys of the numbers in formulas that may be lengths: integers are exponents and factors."""
    keys = set()
    for tree in trees:
        for part in parts_of(tree):
            if isinstance(part, Number) and part.value.denominator != 1:
                keys.add(leaf_text(part))
    return keys


def _other_points(
    names: set[str], length: Tree, added: bool, of_tool: bool, is_counted: bool
) -> Iterator[tuple[str, dict[str, Tree]]]:
    """Yield replacements of the tool's origin p by points at a distance from it.

    Parameters
    ----------
    names
        Names in the formulas.
    length
        The distance, m.
    added
        Whether it is added, or subtracted.
    of_tool
        Whether it is a length of the tool or of the last link.
    is_counted
        Whether it is one that the formulas contain, so that they may already count it, in the opposite sense.
    """
    for p in _POSITIONS:
        if p in names:
            yield "offset_forgotten", {p: with_term(Name(p, 0), added, length)}
    if not names & {*_POSITIONS}:
        return
    for column in "123":
        yield (
            "tool_length_forgotten" if of_tool else "length_forgotten",
            _along_axis(column, added, length),
        )
        if is_counted:
            twice = times(Number(Fraction(2), "2", 0), length)
            yield "tool_length_added", _along_axis(column, added, twice)


def _along_axis(column: str, added: bool, length: Tree) -> dict[str, Tree]:
    """Return replacements of the tool's origin p by p + l R e or p - l R e: a distance l along the tool's axis e."""
    moved: dict[str, Tree] = {}
    for i, p in enumerate(_POSITIONS, start=1):
        component = times(length, Name(f"r{i}{column}", 0))
        moved[p] = with_term(Name(p, 0), added, component)
    return moved


def _other_angles(names: set[str]) -> Iterator[tuple[str, dict[str, Tree]]]:
    """Yield replacements of joint angles: sums of neighbours for one of them, and angles from another zero."""
    joints = sorted(
        (name for name in names if formulas.is_joint(name)), key=lambda name: int(name[1:])
    )
    for name in joints:
        own = Name(name, 0)
        last = int(name[1:])

        # q_first + ... + q_end for q_last
        ranges = [(first, last) for first in range(1, last)]
        ranges += [(last, last + 1), (last, last + 2)]
        for first, end in ranges:
            angles: list[tuple[bool, Tree]] = [
                (True, Name(f"q{i}", 0)) for i in range(first, end + 1)
            ]
            yield "sum_of_angles_forgotten", {name: Sum(tuple(angles))}

        for other in joints:
            if other != name:
                yield "sum_of_angles_too_much", {name: with_term(own, False, Name(other, 0))}

        for quarters in (1, -1, 2):
            half_turns = Fraction(quarters, 2)
            turn = times(Name("pi", 0), Number(half_turns, str(half_turns), 0))
            yield "angle_zero", {name: with_term(own, True, turn)}


def with_signs_changed(tree: Tree) -> Iterator[Tree]:
    """Yield a formula with the sign of one root or arc cosine changed, one after the other; then of all of them."""
    alone = Lengths((), ())
    for edit in _part_edits(tree, alone, ("elbow_sign",), lambda part: part, in_law=False):
        yield edit.tree
    if formulas.has_call(tree, _ROOTS):
        yield formulas.with_calls_changed(tree, _ROOTS, _minus_unless_constant)


def _minus_unless_constant(call: Call) -> Tree:
    """Return a call with a minus in front; a constant as it is."""
    return call if formulas.is_constant(call) else minus(call)


# Changes of a whole formula


def _whole_changes(
    tree: Tree, is_revolute: bool, others: Sequence[str], offsets: Sequence[float]
) -> Iterator[tuple[str, Tree]]:
    """Yield mistakes in a whole formula, each with the formula corrected."""
    if is_revolute:
        yield "degrees_for_radians", times(tree, Name("deg", 0))
        if any(map(formulas.is_law, parts_of(tree))):
            yield "supplement", with_term(Name("pi", 0), False, tree)
    else:
        yield "millimetres_for_metres", times(tree, Name("mm", 0))

    yield "joint_sign", minus(tree)

    for offset in offsets:
        yield "missing_offset", with_term(tree, True, Number(Fraction(offset), str(offset), 0))

    for count in range(1, len(others) + 1):
        for chosen in combinations(others, count):
            for added in (False, True):
                terms = [(added, Name(name, 0)) for name in chosen]
                yield "earlier_joints_forgotten", Sum(((True, tree), *terms))

    for arc in _ARCS:
        yield "arc_function_forgotten", applied(arc, tree)
        yield "arc_function_forgotten", minus(applied(arc, tree))

    yield "root_forgotten", applied("sqrt", tree)

    other_signs = formulas.with_calls_changed(tree, _ROOTS, _minus_unless_constant)
    if other_signs is not tree:
        yield "elbow_sign", other_signs
    exchanged = formulas.with_calls_changed(tree, ("atan2",), formulas.exchange_arguments)
    if exchanged is not tree:
        yield "atan2_arguments", exchanged


def _triangle_changes(
    tree: Tree, is_revolute: bool, others: Sequence[str], lengths: Lengths
) -> Iterator[tuple[str, Tree]]:
    """Yield a formula plus or minus the angle beta between a link and the line to the end of the next link."""
    arcs = sum(
        isinstance(part, Call) and part.function in ("atan2", *_ARCS) for part in parts_of(tree)
    )
    if not is_revolute or arcs != 1:
        return
    for name in others:
        cos_q = applied("cos", Name(name, 0))
        sin_q = applied("sin", Name(name, 0))
        for a, b in permutations(lengths.trees[: BOUNDS.offset_lengths], 2):
            # Links of lengths a and b, and the joint q between them:
            #   beta = atan2(b sin q, a + b cos q)
            beta = Call("atan2", (times(b, sin_q), with_term(a, True, times(b, cos_q))), 0)
            for added in (False, True):
                yield "triangle_angle_forgotten", with_term(tree, added, beta)


# Changes of one part

_Rebuild = Callable[[Tree], Tree]
"""Returns the whole formula for a changed part."""


def _part_edits(
    tree: Tree, lengths: Lengths, mistakes: Collection[str], rebuild: _Rebuild, in_law: bool
) -> Iterator[Edit]:
    """Yield changes of a part and of the parts in it.

    Parameters
    ----------
    tree
        The part.
    lengths
        Lengths of the robot.
    mistakes
        Mistakes that are corrected.
    rebuild
        Returns the whole formula for a changed part.
    in_law
        Whether the part belongs to a law of cosines.
    """
    for mistake, new in _changes(tree, lengths, in_law):
        if mistake in mistakes:
            yield Edit(mistake, rebuild(new), tree, new)

    for k, child in enumerate(operands(tree)):
        # A squared sum is a component of the point, and not a law of cosines of its own.
        is_component = isinstance(tree, Power) and isinstance(child, Sum)
        child_in_law = (in_law and not is_component) or formulas.is_law(child)
        yield from _part_edits(
            child, lengths, mistakes, partial(_rebuild_around, rebuild, tree, k), child_in_law
        )


def _rebuild_around(rebuild: _Rebuild, tree: Tree, k: int, part: Tree) -> Tree:
    """Return the whole formula in which ``part`` is operand k of ``tree``."""
    children = operands(tree)
    return rebuild(with_operands(tree, [*children[:k], part, *children[k + 1 :]]))


def _square_mistake(in_law: bool) -> str:
    """Return the mistake that a further square corrects."""
    return "cosine_law_squares" if in_law else "square_forgotten"


def _changes(tree: Tree, lengths: Lengths, in_law: bool) -> Iterator[tuple[str, Tree]]:
    """Yield mistakes in a part, each with the part corrected."""
    if isinstance(tree, Sum | Call):
        used = [
            length
            for length in lengths.trees[: BOUNDS.offset_lengths]
            if leaf_text(length) in names_of(tree)
        ]
        for one, two in combinations(used, 2):
            change: dict[str, Tree] = {leaf_text(one): two, leaf_text(two): one}
            yield "lengths_exchanged", formulas.renamed(tree, change)
    match tree:
        case Number():
            yield from _number_changes(tree, lengths, in_law)
        case Name(text):
            yield from _name_changes(text, lengths)
            yield _square_mistake(in_law), square_of(tree)
        case Call():
            yield from _call_changes(tree, in_law)
        case Power(base, exponent) if isinstance(exponent, Number) and exponent.value == 2:
            yield "square_too_much", base
        case Product(factors):
            yield from _factor_changes(tree, in_law)
            for k in range(len(factors)):
                yield "term_factor", formulas.product_of([*factors[:k], *factors[k + 1 :]])
            if not all(is_factor for is_factor, _ in factors):
                yield _square_mistake(in_law), square_of(tree)
                for length in lengths.trees[: BOUNDS.offset_lengths]:
                    for is_factor in (False, True):
                        yield "length_forgotten", Product((*factors, (is_factor, length)))
        case Sum(terms):
            yield from _sum_changes(terms, lengths, in_law)


def _number_changes(number: Number, lengths: Lengths, in_law: bool) -> Iterator[tuple[str, Tree]]:
    if abs(number.value) == 1:
        return
    for length, value in zip(lengths.trees[: BOUNDS.offset_lengths], lengths.values, strict=False):
        if 0 < abs(float(number.value) - value) < _MAX_ROUNDED * value:
            yield "rounded_length", length
    if number.value >= _MIN_MEASURE:
        yield "degrees_for_radians", times(number, Name("deg", 0))
        yield "millimetres_for_metres", times(number, Name("mm", 0))
    yield _square_mistake(in_law), square_of(number)


def _name_changes(text: str, lengths: Lengths) -> Iterator[tuple[str, Tree]]:
    if text in _ROTATIONS:
        row = text[1]
        column = text[2]
        yield "rotation_matrix_transposed", Name(f"r{column}{row}", 0)

    # Another name of the same kind.
    mistake = "term_parameter" if text in lengths.parameters else "axis_exchanged"
    for family in (_POSITIONS, _ROTATIONS, lengths.parameters):
        if text in family:
            for other in family:
                if other != text:
                    yield mistake, Name(other, 0)
            break

    if text in _POSITIONS:
        for length in lengths.trees[: BOUNDS.offset_lengths]:
            for added in (False, True):
                yield "offset_forgotten", with_term(Name(text, 0), added, length)


def _call_changes(call: Call, in_law: bool) -> Iterator[tuple[str, Tree]]:
    first = call.arguments[0]
    rest = call.arguments[1:]
    yield from _factor_changes(call, in_law)
    match call.function:
        case "atan2":
            second = call.arguments[-1]
            yield "atan2_arguments", formulas.exchange_arguments(call)
            yield "term_sign", replace(call, arguments=(minus(first), second))
            yield "term_sign", replace(call, arguments=(first, minus(second)))
        case "sin" | "cos":
            other = replace(call, function="cos" if call.function == "sin" else "sin")
            yield "term_function", other
            yield "angle_zero", minus(other)
        case "atan":
            with_quadrant = formulas.with_quadrant(call)
            if with_quadrant is not call:
                yield "quadrant", with_quadrant
        case "acos" | "asin":
            yield "elbow_sign", minus(call)
            # acos(-x) = pi - acos(x): the angle inside the triangle instead of the joint's.
            has_law = any(map(formulas.is_law, parts_of(first)))
            yield (
                "supplement" if has_law else "term_sign",
                replace(call, arguments=(minus(first), *rest)),
            )
            yield (
                "term_function",
                replace(call, function="asin" if call.function == "acos" else "acos"),
            )
        case "sqrt":
            if not formulas.is_constant(call):
                yield "elbow_sign", minus(call)
            yield "root_too_much", first
    yield _square_mistake(in_law), square_of(call)


def _sum_changes(
    terms: tuple[tuple[bool, Tree], ...], lengths: Lengths, in_law: bool
) -> Iterator[tuple[str, Tree]]:
    yield "root_forgotten", applied("sqrt", Sum(terms))

    # One more term.
    for length in lengths.trees[: BOUNDS.offset_lengths]:
        for term in (length, square_of(length)):
            for added in (False, True):
                yield "length_forgotten", Sum((*terms, (added, term)))

    # The signs of one term or, in a law of cosines, of two.
    most = 2 if in_law and len(terms) <= BOUNDS.law_terms else 1
    for count in range(1, most + 1):
        for chosen in combinations(range(len(terms)), count):
            changed = tuple((added ^ (k in chosen), term) for k, (added, term) in enumerate(terms))
            yield "cosine_law_sign" if in_law else "term_sign", Sum(changed)

    # One term less.
    if len(terms) > 1:
        for k in range(len(terms)):
            yield "term_extra", Sum((*terms[:k], *terms[k + 1 :]))

    # The square of one term without a power or product, then of all of them.
    bare = [k for k, (_, term) in enumerate(terms) if isinstance(term, Name | Number | Sum)]
    for squares in (*([k] for k in bare), bare):
        squared = tuple(
            (added, square_of(term) if k in squares else term)
            for k, (added, term) in enumerate(terms)
        )
        yield _square_mistake(in_law), Sum(squared)


def _factor_changes(tree: Tree, in_law: bool) -> Iterator[tuple[str, Tree]]:
    mistake = "cosine_law_factor" if in_law else "term_factor"
    for factor in (Fraction(2), Fraction(1, 2)):
        yield mistake, times(tree, Number(factor, str(factor), 0))
