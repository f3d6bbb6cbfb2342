"""The meaning of a program's names: the notation's own, one formula, or none that can be relied on."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from dhkit.description import Description
from dhkit.grading.answers.programs.bindings import (
    Binding,
    DefaultArgument,
    Formula,
    Index,
    LibraryFunction,
    LibraryName,
    Module,
    NotUnderstood,
    OwnFunction,
    Read,
    Scope,
    Structure,
    Symbol,
    Use,
)
from dhkit.grading.answers.quantity_names import QuantityNames
from dhkit.grading.answers.sheet_values import NO_NAMES, Names
from dhkit.grading.answers.tokens import rate_name
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Meaning, plain_name

JOINT_VARIABLE = re.compile(
    r"(?:dd|DD|ddot|dot|d2|d|D)?(?:q|th|theta|Theta|vartheta)(?:dd|d|ddot|dot|pp|p)?\d*\w*", re.ASCII
)
"""Spellings of joint variables that nobody uses for anything else; x2 or t1 may be a student's own name."""

TIME_DERIVATIVE = re.compile(r"(?:diff|Derivative)\((\w+)(?:\(t\))?, t(, [t2])?\)")

NUMBER_TOLERANCE = 1e-12
"""Relative difference up to which two numbers are one: 0.1 + 0.2 and 0.3 differ by 1e-16 as doubles."""


class UnreliableError(Exception):
    """A name, or a formula that reads it, that cannot be relied on; the message says why."""


def is_same_number(value: float | None, number: float | None) -> bool:
    """Whether a number in a program is a parameter's value, up to :data:`NUMBER_TOLERANCE`; None is no number."""
    return value is not None and number is not None and abs(value - number) <= NUMBER_TOLERANCE * abs(value)


@dataclass(frozen=True)
class Resolution:
    """The meaning of a name in its scope.

    Attributes
    ----------
    problem
        Why the name cannot be relied on; empty where it can.
    definition
        The binding that defines it; None where it has its usual meaning, or is assigned entry by entry.
    has_usual_meaning
        Whether it means what the notation says: everywhere, or where it is read before ``definition``.
    library_name
        The function, module or structure that it stands for.
    entries
        Bindings of its entries by index, from 0: the assignment first, then what is added to the entry later.
    has_zeros
        Whether entries that are not bound are zero.
    note
        What a reader should know where the name is used.
    """

    problem: str = ""
    definition: Binding | None = None
    has_usual_meaning: bool = False
    library_name: LibraryName | None = None
    entries: dict[Index, list[Binding]] = field(default_factory=dict)
    has_zeros: bool = False
    note: str = ""


class NameResolver:
    """Finds the meaning of a program's names on a given robot.

    Parameters
    ----------
    description
        The robot.
    names
        The task's names of the joint variables.
    """

    def __init__(self, description: Description, names: Names = NO_NAMES) -> None:
        self.quantities = QuantityNames(description, names)
        self.vocabulary = self.quantities.vocabulary
        self.values = description.numbers.values
        self._resolutions: dict[tuple[int, str], Resolution] = {}
        self._begun: set[tuple[int, str]] = set()

    def find(self, name: str) -> Meaning | None:
        """Return the tokens that a name stands for in the notation."""
        return self.vocabulary.find(plain_name(name))

    def is_reserved(self, name: str) -> bool:
        """Whether a name belongs to the robot: a parameter, a joint variable in a usual spelling, pi."""
        plain = plain_name(name)
        is_joint = JOINT_VARIABLE.fullmatch(plain) is not None or plain in self.vocabulary.own
        is_state = is_joint and (self.vocabulary.is_state(plain) or self.is_vector(plain))
        return plain == "pi" or self.quantities.is_parameter(name) or is_state

    def is_vector(self, name: str) -> bool:
        """Whether the notation takes a name for the vector of the joint variables or of their rates."""
        return self.vocabulary.is_state(plain_name(name) + "1")

    def parameter_value(self, name: str) -> float | None:
        """Return the value that the robot's file gives the parameter of this name."""
        return self.values.get(self.quantities.parameters[plain_name(name)])

    def resolve(self, scope: Scope, name: str) -> Resolution:
        """Return the meaning of a name in the scope that binds it."""
        key = (id(scope), name)
        if key not in self._resolutions:
            if key in self._begun:
                return Resolution(problem=f"{name} is defined by itself")
            self._begun.add(key)
            try:
                self._resolutions[key] = self._resolve(scope, name)
            except UnreliableError as error:
                self._resolutions[key] = Resolution(problem=str(error))
        return self._resolutions[key]

    def _resolve(self, scope: Scope, name: str) -> Resolution:
        bindings = scope.bindings[name]
        whole = [b for b in bindings if b.index is None]
        parts = [b for b in bindings if b.index is not None]
        usual: list[Binding] = []  # bindings that leave the name its usual meaning
        defining: list[Binding] = []  # bindings to a formula
        library: list[Binding] = []
        note = ""
        for binding in whole:
            match binding.value:
                case NotUnderstood(reason, only_matrices=False):
                    raise UnreliableError(reason)
                case DefaultArgument(formula, has_fields):
                    note = self._default_note(name, formula, has_fields, binding) or note
                case Symbol(symbol) if self._is_same(name, symbol):
                    usual.append(binding)
                case Symbol(symbol):
                    if self.find(symbol) is None or self.is_reserved(name):
                        raise UnreliableError(f"{name} is the symbol {symbol[:40]!r} in {binding.line}")
                    defining.append(Binding(binding.line, binding.order, Formula(plain_name(symbol))))
                case LibraryFunction() | OwnFunction() | Module() | Structure():
                    library.append(binding)
                case Formula() as formula if self._keeps_usual_meaning(scope, name, formula, binding):
                    usual.append(binding)
                    note = f"{binding.line}: {name} = {formula.text} is the file's own number"
                    note = note if formula.number is not None else ""
                case Formula():
                    defining.append(binding)
        declared = defining[0].formula if len(defining) > 1 else None
        if declared is not None and declared.is_zeros and not parts:
            defining = defining[1:]  # zeros that a whole matrix replaces
        first = defining[0] if defining else None
        is_matrix = first is not None and first.formula is not None and first.formula.is_matrix
        for binding in whole:
            if isinstance(binding.value, NotUnderstood) and (parts or is_matrix):
                raise UnreliableError(binding.value.reason)
        self._refuse_another(name, [b for b in defining[1:] if first and b.value != first.value])
        if library:
            kind = library[0].value
            is_own = isinstance(kind, OwnFunction)  # each function of the file is another one
            others = [*usual, *defining, *parts, *library]
            self._refuse_another(name, [b for b in others if b.value != kind or (is_own and b is not library[0])])
            assert isinstance(kind, LibraryFunction | OwnFunction | Module | Structure)  # noqa: S101
            return Resolution(library_name=kind)
        if parts:
            return self._resolve_entries(name, parts, usual, first)
        if first is not None and usual:
            if not (is_matrix and self.quantities.quantity(name)) or any(b.order > first.order for b in usual):
                self._refuse_another(name, [first])
            return Resolution(definition=first, has_usual_meaning=True, note=note)
        if first is not None:
            return Resolution(definition=first, has_usual_meaning=self.quantities.is_parameter(name))
        return Resolution(has_usual_meaning=bool(usual), note=note)

    @staticmethod
    def _refuse_another(name: str, others: list[Binding]) -> None:
        if others:
            raise UnreliableError(f"{name} is assigned twice, in {others[0].line}")

    def _resolve_entries(
        self, name: str, parts: list[Binding], usual: list[Binding], base: Binding | None
    ) -> Resolution:
        """Return the meaning of a name that is assigned entry by entry, ``base`` being the zeros before them."""
        has_zeros = base is not None and base.formula is not None and base.formula.is_zeros
        if base is not None and (not has_zeros or any(b.order < base.order for b in parts)):
            late = max([base, *parts], key=lambda b: b.order)
            raise UnreliableError(f"{name} is changed after it is assigned, in {late.line}")
        if any(b.is_argument for b in usual):
            raise UnreliableError(f"{name} is changed after it is assigned, in {parts[0].line}")
        is_own = self.quantities.is_parameter(name) and bool(self.quantities.quantity(name))
        if self.is_reserved(name) and not is_own and not self.is_vector(name):
            raise UnreliableError(f"{name} is changed in {parts[0].line}, and is the robot's own name")
        entries: dict[Index, list[Binding]] = {}
        for part in parts:
            assert part.index is not None  # noqa: S101
            if part.formula is None:
                raise UnreliableError(f"an entry of {name} is not read, in {part.line}")
            versions = entries.setdefault(part.index, [])
            if part.is_added and not versions and not has_zeros:
                raise UnreliableError(f"an entry of {name} is changed in {part.line} and assigned nowhere before")
            if versions and not part.is_added:
                if part.value == versions[0].value and len(versions) == 1:
                    continue
                raise UnreliableError(f"an entry of {name} is assigned twice, in {part.line}")
            versions.append(part)
        return Resolution(entries=entries, has_zeros=has_zeros, has_usual_meaning=is_own)

    # Names with their usual meaning

    def _default_note(self, name: str, formula: Formula, has_fields: bool, binding: Binding) -> str:
        """Return a note on the default of an argument.

        Raises
        ------
        UnreliableError
            The default changes what is computed.
        """
        if formula.text == name and not formula.problem:
            return ""
        assignment = f"{name} = {formula.text[:40]}"
        if self.quantities.is_parameter(name) and formula.number is not None:
            self._refuse_another_number(name, "has the default", formula, binding)
            return f"{binding.line}: {assignment} is the file's own number"
        if has_fields:
            return ""
        raise UnreliableError(f"an argument has the default {assignment} in {binding.line}")

    def _refuse_another_number(self, name: str, verb: str, formula: Formula, binding: Binding) -> None:
        """Refuse a number for a parameter that is not the one in the robot's file."""
        value = self.parameter_value(name)
        if not is_same_number(value, formula.number):
            text = f"{verb} {formula.text[:40]} in {binding.line}"
            raise UnreliableError(f"{name} {text}; the robot's file has {value}")

    def _is_field(self, scope: Scope, name: str, formula: Formula) -> bool:
        """Whether a formula is the field of this name of a structure: m1 = p.m1."""
        (read, *rest) = formula.reads or (None,)
        if read is None or rest or (read.start, read.end) != (0, len(formula.text)) or not read.member:
            return False
        owner = scope.owner(read.name)
        if owner is None or plain_name(read.member) != plain_name(name) or not self.quantities.is_parameter(name):
            return False
        resolution = self.resolve(owner, read.name)
        is_argument = any(b.is_argument for b in owner.bindings[read.name])
        is_structure = resolution.library_name == Structure() or (resolution.library_name is None and is_argument)
        if resolution.problem or resolution.definition is not None or resolution.entries or not is_structure:
            return False
        holder = scope.owner(f"{read.name}.{read.member}")
        fields = holder.bindings[f"{read.name}.{read.member}"] if holder is not None else []
        value = self.parameter_value(name)
        numbers = [b.formula.number if b.formula is not None else None for b in fields]
        return all(is_same_number(value, number) for number in numbers) and (bool(numbers) or is_argument)

    def _is_same(self, name: str, symbol: str) -> bool:
        meaning = self.find(symbol)
        return plain_name(name) == plain_name(symbol) or (meaning is not None and self.find(name) == meaning)

    def _keeps_usual_meaning(self, scope: Scope, name: str, formula: Formula, binding: Binding) -> bool:
        """Whether a name keeps its usual meaning where it is bound to a formula; otherwise the formula defines it.

        Raises
        ------
        UnreliableError
            The name is the robot's own, and the formula is something else.
        """
        if formula.is_matrix and self.quantities.quantity(name):
            return False
        if self.quantities.is_parameter(name) and formula.number is not None:
            self._refuse_another_number(name, "is set to", formula, binding)
            return True
        if not self.is_reserved(name):
            return False
        if formula.problem:
            raise UnreliableError(f"{name} is set in {binding.line} to what is not read")
        if self._is_same_state(scope, name, formula, binding.order) or self._is_field(scope, name, formula):
            return True
        raise UnreliableError(f"{name} is set to {formula.text[:40]!r} in {binding.line}, and is the robot's own name")

    def _is_same_state(self, scope: Scope, name: str, formula: Formula, order: int) -> bool:
        """Whether a formula is the joint variable, or the vector of them, that the name stands for anyway."""
        if formula.entries is not None:
            is_vector = all(max(index) == k and sum(index) == k for k, index in enumerate(formula.entries))
            return (
                is_vector
                and len(formula.entries) == self.quantities.n
                and self.is_vector(name)
                and all(
                    self._is_same_state(scope, f"{plain_name(name)}{k}", entry, order)
                    for k, entry in enumerate(formula.entries.values(), start=1)
                )
            )
        values = [read for read in formula.reads if read.use is Use.VALUE]
        if any(not self.has_usual_meaning(scope, read, order) for read in formula.reads) or len(values) > 1:
            return False
        meaning = self._state(formula.text, values[0] if values else None)
        if meaning is None:
            return self.is_vector(name) and plain_name(name) == plain_name(formula.text)
        return meaning == self.find(name) and self.vocabulary.is_state(plain_name(name))

    def _state(self, text: str, read: Read | None) -> Meaning | None:
        if derivative := TIME_DERIVATIVE.fullmatch(text):
            return self.find(rate_name(plain_name(derivative[1]), "ddot" if derivative[2] else "dot"))
        if read is not None and read.index is not None and (read.start, read.end) == (0, len(text)):
            place = vector_place(read.index)
            return None if place is None else self.find(f"{plain_name(read.name)}{place + 1}")
        return self.find(text.removesuffix("(t)")) if re.fullmatch(r"\w+(\(t\))?", text) else None

    def has_usual_meaning(self, scope: Scope, read: Read, order: int) -> bool:
        """Whether a name that a formula of this order reads means what the notation says."""
        owner = scope.owner(read.name)
        if owner is None:
            return read.use is not Use.CALL or read.name in FUNCTION_NAMES or read.name in ("diff", "Derivative")
        resolution = self.resolve(owner, read.name)
        if read.use is Use.CALL:
            return isinstance(resolution.library_name, LibraryFunction | OwnFunction)
        if read.use is Use.MODULE:
            return isinstance(resolution.library_name, Module)
        is_before = resolution.definition is None or order <= resolution.definition.order
        return not resolution.problem and resolution.has_usual_meaning and is_before


def vector_place(index: Index) -> int | None:
    """Return the place in a vector that an index means, from 0: k for (k,) and (k, 0)."""
    if len(index) == 1:
        return index[0]
    return index[0] if len(index) == 2 and index[1] == 0 else None
