"""Single local changes of a formula of inverse kinematics, each with the mistake that it corrects.

A change concerns one literal, one function, one order of arguments, one exponent, one name or one sign. Changes are
tried in the order of :data:`ORDER`: if two give the same values, the more frequent mistake is named.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import chain, combinations, islice, permutations

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, operands, parts_of, with_operands
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.judging import changed_formulas as formulas
from dhkit.grading.judging.bounds import BOUNDS
from dhkit.grading.judging.changed_formulas import applied, leaf_text, minus, square_of, times

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
"""Functions that give one of two signs."""
_SAME_LENGTH = 1e-9
"""Share of a length by which it differs from itself by rounding."""
_MIN_MEASURE = 10
"""Smallest number that is taken for degrees or millimetres; smaller ones are factors and exponents."""
_MAX_ROUNDED = 0.01
"""Largest share by which a number differs from a length that it is a rounded value of."""


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
        Absolute lengths behind the last joint, of its row and of the tool, m.
    """

    parameters: tuple[str, ...]
    trees: tuple[Name | Number, ...]
    values: tuple[float, ...] = ()
    of_tool: tuple[float, ...] = ()

    def is_of_tool(self, k: int) -> bool:
        """Whether the length of ``trees[k]`` is one behind the last joint."""
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
        Variables of joints of the same kind, turning or sliding, that the formula may use.
    offsets
        Possible constant errors, rad or m.
    lengths
        Lengths of the robot.
    mistakes
        Mistakes that are corrected; all by default.
    """
    whole = chain(_of_the_whole(tree, is_revolute, others, offsets), _with_triangle(tree, is_revolute, others, lengths))
    changes = [Edit(mistake, new, tree, new) for mistake, new in whole if mistake in mistakes]
    changes += edits_of_parts(tree, lengths, mistakes)
    return sorted(changes, key=lambda edit: ORDER.index(edit.mistake))[: BOUNDS.edits]


def edits_of_parts(tree: Tree, lengths: Lengths, mistakes: Collection[str] = ORDER) -> list[Edit]:
    """Return the changes of parts of a formula, and of names throughout, in the order in which they are tried."""
    changes = []
    for angle in _angles(tree) if "term_function" in mistakes else ():
        exchanged = formulas.with_calls_changed(tree, ("sin", "cos"), partial(_exchanged, angle))
        changes.append(Edit("term_function", exchanged, tree, exchanged))
    of_parts = _of_parts(tree, lengths, mistakes, lambda part: part, formulas.is_law(tree))
    changes += islice(of_parts, 2 * BOUNDS.edits)
    for mistake, change in renamings([tree], lengths):
        new = formulas.renamed(tree, change) if mistake in mistakes else tree
        if new is not tree:
            changes.append(Edit(mistake, new, tree, new))
    return sorted(changes, key=lambda edit: ORDER.index(edit.mistake))[: BOUNDS.edits]


def _angles(tree: Tree) -> list[frozenset[str]]:
    """Return the variables of the angles of which a formula contains the sine or the cosine, each once."""
    calls = [part for part in parts_of(tree) if isinstance(part, Call) and part.function in ("sin", "cos")]
    return list(dict.fromkeys(frozenset(names_of(call)) for call in calls))


def _exchanged(angle: frozenset[str], call: Call) -> Tree:
    """Return the cosine for the sine of an angle of these variables, and the sine for its cosine."""
    if names_of(call) != angle:
        return call
    return replace(call, function="cos" if call.function == "sin" else "sin")


def renamings(trees: Sequence[Tree], lengths: Lengths) -> Iterator[tuple[str, dict[str, Tree]]]:
    """Yield replacements of names in formulas: another component, another length, a component less an offset."""
    names = set().union(*map(names_of, trees))
    if any(f"r{i}{j}" in names for i in "123" for j in "123" if i != j):
        yield "rotation_matrix_transposed", {f"r{i}{j}": Name(f"r{j}{i}", 0) for i in "123" for j in "123"}
    for a, b in combinations(_POSITIONS, 2):
        if names & {a, b}:
            yield "axis_exchanged", {a: Name(b, 0), b: Name(a, 0)}
    parts = [part for tree in trees for part in parts_of(tree) if isinstance(part, Number)]
    numbers = {leaf_text(number) for number in parts if number.value.denominator != 1}  # integers are exponents
    yield from _other_angles(names)
    known = [length for length in lengths.trees if leaf_text(length) in names | numbers]
    for first, second in combinations(known[: BOUNDS.offset_lengths], 2):
        yield "lengths_exchanged", {leaf_text(first): second, leaf_text(second): first}
    for place, length in enumerate(lengths.trees[: BOUNDS.offset_lengths]):
        forgotten = "tool_length_forgotten" if lengths.is_of_tool(place) else "length_forgotten"
        for subtracted in (True, False):
            for p in _POSITIONS:
                if p in names:
                    yield "offset_forgotten", {p: Sum(((True, Name(p, 0)), (not subtracted, length)))}
            for column in "123":
                tool: dict[str, Tree] = {
                    p: Sum(((True, Name(p, 0)), (not subtracted, times(length, Name(f"r{i}{column}", 0)))))
                    for i, p in enumerate(_POSITIONS, start=1)
                }
                if names & {*_POSITIONS}:
                    yield forgotten, tool
                if names & {*_POSITIONS} and lengths.is_of_tool(place) and leaf_text(length) in names | numbers:
                    twice = {p: times(Number(Fraction(2), "2", 0), length) for p in _POSITIONS}
                    yield (
                        "tool_length_added",
                        {
                            p: Sum(((True, Name(p, 0)), (not subtracted, times(twice[p], Name(f"r{i}{column}", 0)))))
                            for i, p in enumerate(_POSITIONS, start=1)
                        },
                    )
    for j, k in combinations("123", 2):
        columns: dict[str, Tree] = {f"r{i}{j}": Name(f"r{i}{k}", 0) for i in "123"}
        columns |= {f"r{i}{k}": Name(f"r{i}{j}", 0) for i in "123"}
        if names & {*columns}:
            yield "tool_axis_exchanged", columns
    for first, second in permutations(known[: BOUNDS.offset_lengths], 2):
        for added in (True, False):
            yield "length_forgotten", {leaf_text(first): Sum(((True, first), (added, second)))}


def _other_angles(names: set[str]) -> Iterator[tuple[str, dict[str, Tree]]]:
    """Yield replacements of joint angles: sums of neighbours for one of them, and angles from another zero."""
    joints = sorted((name for name in names if formulas.is_joint(name)), key=lambda name: int(name[1:]))
    for name in joints:
        last = int(name[1:])
        sums = [*((first, last) for first in range(1, last)), (last, last + 1), (last, last + 2)]
        for first, end in sums:
            angles: list[tuple[bool, Tree]] = [(True, Name(f"q{i}", 0)) for i in range(first, end + 1)]
            yield "sum_of_angles_forgotten", {name: Sum(tuple(angles))}
        for other in joints:
            if other != name:
                difference = Sum(((True, Name(name, 0)), (False, Name(other, 0))))
                yield "sum_of_angles_too_much", {name: difference}
        for quarters in (1, -1, 2):
            turn = times(Name("pi", 0), Number(Fraction(quarters, 2), str(Fraction(quarters, 2)), 0))
            yield "angle_zero", {name: Sum(((True, Name(name, 0)), (True, turn)))}


def with_signs_changed(tree: Tree) -> Iterator[Tree]:
    """Yield a formula with the sign of one root or arc cosine changed, one after the other; then of all of them."""
    alone = Lengths((), ())
    for edit in _of_parts(tree, alone, ("elbow_sign",), lambda part: part, in_law=False):
        yield edit.tree
    if formulas.has_call(tree, _ROOTS):
        yield formulas.with_calls_changed(
            tree, _ROOTS, lambda call: call if formulas.is_constant(call) else minus(call)
        )


# Changes of a whole formula


def _of_the_whole(
    tree: Tree, is_revolute: bool, others: Sequence[str], offsets: Sequence[float]
) -> Iterator[tuple[str, Tree]]:
    if is_revolute:
        yield "degrees_for_radians", times(tree, Name("deg", 0))
        if any(map(formulas.is_law, parts_of(tree))):
            yield "supplement", Sum(((True, Name("pi", 0)), (False, tree)))
    else:
        yield "millimetres_for_metres", times(tree, Name("mm", 0))
    yield "joint_sign", minus(tree)
    for offset in offsets:
        yield "missing_offset", Sum(((True, tree), (True, Number(Fraction(offset), str(offset), 0))))
    for count in range(1, len(others) + 1):
        for chosen in combinations(others, count):
            for added in (False, True):
                yield "earlier_joints_forgotten", Sum(((True, tree), *((added, Name(name, 0)) for name in chosen)))
    for arc in _ARCS:
        yield "arc_function_forgotten", applied(arc, tree)
        yield "arc_function_forgotten", minus(applied(arc, tree))
    yield "root_forgotten", applied("sqrt", tree)
    for mistake, functions, change in (
        ("elbow_sign", _ROOTS, lambda call: call if formulas.is_constant(call) else minus(call)),
        ("atan2_arguments", ("atan2",), formulas.exchange_arguments),
    ):
        new = formulas.with_calls_changed(tree, functions, change)
        if new is not tree:
            yield mistake, new


def _with_triangle(
    tree: Tree, is_revolute: bool, others: Sequence[str], lengths: Lengths
) -> Iterator[tuple[str, Tree]]:
    """Yield a formula less the angle between a link and the line to the end of the next: beta of two links a and b.

    beta = atan2(b sin q, a + b cos q) where q is the joint between them.
    """
    arcs = sum(isinstance(part, Call) and part.function in ("atan2", *_ARCS) for part in parts_of(tree))
    if not is_revolute or arcs != 1:
        return
    for name in others:
        c = applied("cos", Name(name, 0))
        s = applied("sin", Name(name, 0))
        for a, b in permutations(lengths.trees[: BOUNDS.offset_lengths], 2):
            beta = Call("atan2", (times(b, s), Sum(((True, a), (True, times(b, c))))), 0)
            for added in (False, True):
                yield "triangle_angle_forgotten", Sum(((True, tree), (added, beta)))


# Changes of one part

_Rebuild = Callable[[Tree], Tree]


def _of_parts(
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
    children = operands(tree)
    for k, child in enumerate(children):

        def around(part: Tree, k: int = k) -> Tree:
            return rebuild(with_operands(tree, [*children[:k], part, *children[k + 1 :]]))

        # A sum that is squared is a component of the point, no law of cosines of its own.
        is_inside = in_law and not (isinstance(tree, Power) and isinstance(child, Sum))
        yield from _of_parts(child, lengths, mistakes, around, is_inside or formulas.is_law(child))


def _changes(tree: Tree, lengths: Lengths, in_law: bool) -> Iterator[tuple[str, Tree]]:
    """Yield mistakes in a part, each with the part corrected."""
    if isinstance(tree, Sum | Call):
        used = [length for length in lengths.trees[: BOUNDS.offset_lengths] if leaf_text(length) in names_of(tree)]
        for one, two in combinations(used, 2):
            change: dict[str, Tree] = {leaf_text(one): two, leaf_text(two): one}
            yield "lengths_exchanged", formulas.renamed(tree, change)
    match tree:
        case Number():
            yield from _of_number(tree, lengths, in_law)
        case Name(text):
            yield from _of_name(text, lengths)
            yield "cosine_law_squares" if in_law else "square_forgotten", square_of(tree)
        case Call():
            yield from _of_call(tree, in_law)
        case Power(base, exponent) if isinstance(exponent, Number) and exponent.value == 2:
            yield "square_too_much", base
        case Product(factors):
            yield from _scaled(tree, in_law)
            for k in range(len(factors)):
                yield "term_factor", formulas.product_of([*factors[:k], *factors[k + 1 :]])
            if not all(is_factor for is_factor, _ in factors):
                yield "cosine_law_squares" if in_law else "square_forgotten", square_of(tree)
                for length in lengths.trees[: BOUNDS.offset_lengths]:
                    for is_factor in (False, True):
                        yield "length_forgotten", Product((*factors, (is_factor, length)))
        case Sum(terms):
            yield from _of_sum(terms, lengths, in_law)


def _of_number(number: Number, lengths: Lengths, in_law: bool) -> Iterator[tuple[str, Tree]]:
    if abs(number.value) == 1:
        return
    for length, value in zip(lengths.trees[: BOUNDS.offset_lengths], lengths.values, strict=False):
        if 0 < abs(float(number.value) - value) < _MAX_ROUNDED * value:
            yield "rounded_length", length
    if number.value >= _MIN_MEASURE:
        yield "degrees_for_radians", times(number, Name("deg", 0))
        yield "millimetres_for_metres", times(number, Name("mm", 0))
    yield "cosine_law_squares" if in_law else "square_forgotten", square_of(number)


def _of_name(text: str, lengths: Lengths) -> Iterator[tuple[str, Tree]]:
    if text in _ROTATIONS:
        yield "rotation_matrix_transposed", Name(f"r{text[2]}{text[1]}", 0)
    family = next((family for family in (_POSITIONS, _ROTATIONS, lengths.parameters) if text in family), ())
    for other in family:
        if other != text:
            yield "term_parameter" if text in lengths.parameters else "axis_exchanged", Name(other, 0)
    if text in _POSITIONS:
        for length in lengths.trees[: BOUNDS.offset_lengths]:
            for added in (False, True):
                yield "offset_forgotten", Sum(((True, Name(text, 0)), (added, length)))


def _of_call(call: Call, in_law: bool) -> Iterator[tuple[str, Tree]]:
    first = call.arguments[0]
    yield from _scaled(call, in_law)
    match call.function:
        case "atan2":
            second = call.arguments[-1]
            yield "atan2_arguments", formulas.exchange_arguments(call)
            for signs in ((False, True), (True, False)):
                signed = tuple(x if sign else minus(x) for sign, x in zip(signs, (first, second), strict=True))
                yield "term_sign", replace(call, arguments=signed)
        case "sin" | "cos":
            other = replace(call, function="cos" if call.function == "sin" else "sin")
            yield "term_function", other
            yield "angle_zero", minus(other)
        case "atan":
            if (with_quadrant := formulas.with_quadrant(call)) is not call:
                yield "quadrant", with_quadrant
        case "acos" | "asin":
            yield "elbow_sign", minus(call)
            is_law = any(map(formulas.is_law, parts_of(first)))
            yield "supplement" if is_law else "term_sign", replace(call, arguments=(minus(first), *call.arguments[1:]))
            yield "term_function", replace(call, function="asin" if call.function == "acos" else "acos")
        case "sqrt":
            if not formulas.is_constant(call):
                yield "elbow_sign", minus(call)
            yield "root_too_much", first
    yield "cosine_law_squares" if in_law else "square_forgotten", square_of(call)


def _of_sum(terms: tuple[tuple[bool, Tree], ...], lengths: Lengths, in_law: bool) -> Iterator[tuple[str, Tree]]:
    yield "root_forgotten", applied("sqrt", Sum(terms))
    for length in lengths.trees[: BOUNDS.offset_lengths]:
        for term in (length, square_of(length)):
            for added in (False, True):
                yield "length_forgotten", Sum((*terms, (added, term)))
    for count in (1, 2) if in_law and len(terms) <= BOUNDS.law_terms else (1,):
        for chosen in combinations(range(len(terms)), count):
            changed = tuple((added ^ (k in chosen), term) for k, (added, term) in enumerate(terms))
            yield "cosine_law_sign" if in_law else "term_sign", Sum(changed)
    for k in range(len(terms)) if len(terms) > 1 else ():
        yield "term_extra", Sum((*terms[:k], *terms[k + 1 :]))
    bare = [k for k, (_, term) in enumerate(terms) if isinstance(term, Name | Number | Sum)]
    for squares in (*([k] for k in bare), bare):
        squared = tuple((added, square_of(term) if k in squares else term) for k, (added, term) in enumerate(terms))
        yield "cosine_law_squares" if in_law else "square_forgotten", Sum(squared)


def _scaled(tree: Tree, in_law: bool) -> Iterator[tuple[str, Tree]]:
    for factor in (Fraction(2), Fraction(1, 2)):
        yield "cosine_law_factor" if in_law else "term_factor", times(tree, Number(factor, str(factor), 0))
