"""What a name of a program stands for: itself, one formula, or nothing that can be relied on."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from dhkit.description import Description
from dhkit.grading.answers.programs.bindings import (
    STRUCTURE,
    Binding,
    Default,
    Formula,
    FunctionNamed,
    ModuleNamed,
    NotUnderstood,
    Read,
    Scope,
    Symbol,
    Use,
)
from dhkit.grading.answers.quantity_names import QuantityNames
from dhkit.grading.answers.tokens import dotted
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Meaning, plain_name

PROPER = re.compile(r"(?:dd|DD|ddot|dot|d2|d|D)?(?:q|th|theta|Theta|vartheta)(?:dd|d|ddot|dot|pp|p)?\d*\w*", re.ASCII)
"""Spellings of joint variables that nobody uses for anything else; x2 or t1 may be a student's own name."""
TIMED = re.compile(r"(?:diff|Derivative)\((\w+)(?:\(t\))?, t(, [t2])?\)")
TOLERANCE = 1e-12
"""Relative difference of two spellings of one number: 0.1 + 0.2 and 0.3 as doubles differ by 1e-16."""


@dataclass(frozen=True)
class Standing:
    """What a name stands for in its scope.

    Attributes
    ----------
    wrong
        Why it cannot be relied on; empty where it can.
    defined
        The binding that defines it; None where it stands for itself, or is given entry by entry.
    is_itself
        Whether it stands for itself: everywhere, or where it is read before ``defined``.
    library
        Name of the library's function or module that it stands for.
    entries
        Bindings of its entries by index, each with what is added to it later.
    has_zeros
        Whether entries that are not bound are zero.
    note
        What a reader should know where it is used.
    """

    wrong: str = ""
    defined: Binding | None = None
    is_itself: bool = False
    library: FunctionNamed | ModuleNamed | None = None
    entries: dict[tuple[int, ...], list[Binding]] = field(default_factory=dict)
    has_zeros: bool = False
    note: str = ""


class NameTable:
    """Looks names up, with the robot's own names in mind.

    Parameters
    ----------
    description
        The robot.
    """

    def __init__(self, description: Description) -> None:
        self.quantities = QuantityNames(description)
        self.vocabulary = self.quantities.vocabulary
        self.values = description.numbers.values
        self._standings: dict[tuple[int, str], Standing] = {}
        self._asked: set[tuple[int, str]] = set()

    def find(self, name: str) -> Meaning | None:
        """Return what the notation says a name means."""
        return self.vocabulary.find(plain_name(name))

    def is_proper(self, name: str) -> bool:
        """Whether a name belongs to the robot: a parameter, a joint variable in a usual spelling, pi."""
        plain = plain_name(name)
        is_state = self.vocabulary.is_state(plain) and PROPER.fullmatch(plain) is not None
        is_vector = self.vocabulary.is_state(plain + "1") and PROPER.fullmatch(plain) is not None
        return plain == "pi" or self.quantities.is_parameter(name) or is_state or is_vector

    def is_vector(self, name: str) -> bool:
        """Whether the notation takes a name for the joint variables, or their rates, together."""
        return self.vocabulary.is_state(plain_name(name) + "1")

    def standing(self, scope: Scope, name: str) -> Standing:
        """Return what a name that a scope binds stands for there."""
        key = (id(scope), name)
        if key not in self._standings:
            if key in self._asked:
                return Standing(wrong=f"{name} is defined by itself")
            self._asked.add(key)
            self._standings[key] = self._standing(scope, name)
        return self._standings[key]

    def _standing(self, scope: Scope, name: str) -> Standing:
        bindings = scope.bindings[name]
        whole = [b for b in bindings if b.index is None]
        parts = [b for b in bindings if b.index is not None]
        itself: list[Binding] = []
        defined: list[Binding] = []
        library: list[Binding] = []
        note = ""
        for binding in whole:
            match binding.value:
                case NotUnderstood(reason, only_matrices=False):
                    return Standing(wrong=reason)
                case NotUnderstood():
                    pass
                case Default(formula, has_fields):
                    wrong, said = self._default(name, formula, has_fields, binding)
                    if wrong:
                        return Standing(wrong=wrong)
                    note = said or note
                case Symbol(symbol):
                    if self._is_same(name, symbol):
                        itself.append(binding)
                    elif self.find(symbol) is None or self.is_proper(name):
                        return Standing(wrong=f"{name} is the symbol {symbol[:40]!r} in {binding.line}")
                    else:
                        formula = Formula(plain_name(symbol))
                        defined.append(Binding(binding.line, binding.place, formula))
                case FunctionNamed() | ModuleNamed():
                    library.append(binding)
                case Formula() as formula:
                    objection = self._objection(scope, name, formula, binding)
                    if objection is None:
                        itself.append(binding)
                        note = f"{binding.line}: {name} = {formula.text} is the file's own number"
                        note = note if formula.number is not None else ""
                    elif objection:
                        return Standing(wrong=objection)
                    else:
                        defined.append(binding)
        return self._judged(name, whole, parts, itself, defined, library, note)

    def _judged(
        self,
        name: str,
        whole: list[Binding],
        parts: list[Binding],
        itself: list[Binding],
        defined: list[Binding],
        library: list[Binding],
        note: str,
    ) -> Standing:
        declared = defined[0].value if len(defined) > 1 else None
        if isinstance(declared, Formula) and declared.is_zeros and not parts:
            defined = defined[1:]  # zeros that a whole matrix replaces
        first = defined[0] if defined else None
        for binding in whole:
            may_change = parts or (first is not None and isinstance(first.value, Formula) and first.value.is_matrix)
            if isinstance(binding.value, NotUnderstood) and may_change:
                return Standing(wrong=binding.value.reason)
        other = next((b for b in defined[1:] if first and b.value != first.value), None)
        if other is not None:
            return Standing(wrong=f"{name} is assigned twice, in {other.line}")
        if library:
            known = library[0].value
            own = known == FunctionNamed("")  # each function of the file is another one
            others = [*itself, *defined, *parts, *library]
            other = next((b for b in others if b.value != known or (own and b is not library[0])), None)
            if other is not None:
                return Standing(wrong=f"{name} is assigned twice, in {other.line}")
            return Standing(library=known if isinstance(known, FunctionNamed | ModuleNamed) else None)
        if parts:
            return self._by_entries(name, parts, itself, first)
        if first is not None and itself:
            takes_over = isinstance(first.value, Formula) and first.value.is_matrix and self.quantities.quantity(name)
            if not takes_over or any(b.place > first.place for b in itself):
                return Standing(wrong=f"{name} is assigned twice, in {first.line}")
            return Standing(defined=first, is_itself=True, note=note)
        if first is not None:
            is_own = self.quantities.is_parameter(name)
            return Standing(defined=first, is_itself=is_own)
        return Standing(is_itself=bool(itself), note=note)

    def _by_entries(self, name: str, parts: list[Binding], itself: list[Binding], base: Binding | None) -> Standing:
        """Return what a name stands for that is assigned entry by entry."""
        zeros = base is not None and isinstance(base.value, Formula) and base.value.is_zeros
        if base is not None and (not zeros or any(b.place < base.place for b in parts)):
            late = max([base, *parts], key=lambda b: b.place)
            return Standing(wrong=f"{name} is changed after it is assigned, in {late.line}")
        if any(isinstance(b.value, Symbol) and b.value.is_argument for b in itself):
            return Standing(wrong=f"{name} is changed after it is assigned, in {parts[0].line}")
        is_own = self.quantities.is_parameter(name) and bool(self.quantities.quantity(name))
        if self.is_proper(name) and not is_own and not self.is_vector(name):
            return Standing(wrong=f"{name} is changed in {parts[0].line}, and is the robot's own name")
        entries: dict[tuple[int, ...], list[Binding]] = {}
        for part in parts:
            assert part.index is not None  # noqa: S101
            if not isinstance(part.value, Formula):
                return Standing(wrong=f"an entry of {name} is not read, in {part.line}")
            versions = entries.setdefault(part.index, [])
            if part.is_added and not versions and not zeros:
                return Standing(wrong=f"an entry of {name} is changed in {part.line} and assigned nowhere before")
            if versions and not part.is_added:
                if part.value == versions[0].value and len(versions) == 1:
                    continue
                return Standing(wrong=f"an entry of {name} is assigned twice, in {part.line}")
            versions.append(part)
        return Standing(entries=entries, has_zeros=zeros, is_itself=is_own)

    # Names that stand for themselves

    def _default(self, name: str, formula: Formula, has_fields: bool, binding: Binding) -> tuple[str, str]:
        """Return why the default of an argument changes what is computed, and a note where it does not."""
        if formula.text == name and not formula.problem:
            return "", ""
        shown = f"{name} = {formula.text[:40]}"
        if self.quantities.is_parameter(name) and formula.number is not None:
            value = self.values.get(self.quantities.parameters[plain_name(name)])
            if value is not None and abs(value - formula.number) <= TOLERANCE * abs(value):
                return "", f"{binding.line}: {shown} is the file's own number"
            return f"{name} has the default {formula.text[:40]} in {binding.line}; the robot's file has {value}", ""
        if has_fields:
            return "", ""
        return f"an argument has the default {shown} in {binding.line}", ""

    def _is_field(self, scope: Scope, name: str, formula: Formula) -> bool:
        """Whether a formula is the field of this name of a structure: m1 = p.m1."""
        (read, *rest) = formula.reads or (None,)
        if read is None or rest or (read.start, read.end) != (0, len(formula.text)) or not read.member:
            return False
        owner = scope.owner(read.name)
        if owner is None or plain_name(read.member) != plain_name(name) or not self.quantities.is_parameter(name):
            return False
        standing = self.standing(owner, read.name)
        is_argument = any(isinstance(b.value, Symbol) and b.value.is_argument for b in owner.bindings[read.name])
        is_structure = standing.library == ModuleNamed(STRUCTURE) or (standing.library is None and is_argument)
        if standing.wrong or standing.defined is not None or standing.entries or not is_structure:
            return False
        holder = scope.owner(f"{read.name}.{read.member}")
        value = self.values.get(self.quantities.parameters[plain_name(name)])
        fields = holder.bindings[f"{read.name}.{read.member}"] if holder is not None else []
        numbers = [b.value.number if isinstance(b.value, Formula) else None for b in fields]
        return all(
            x is not None and value is not None and abs(value - x) <= TOLERANCE * abs(value) for x in numbers
        ) and (bool(numbers) or is_argument)

    def _is_same(self, name: str, symbol: str) -> bool:
        own, other = plain_name(name), plain_name(symbol)
        meaning = self.find(symbol)
        return own == other or (meaning is not None and self.find(name) == meaning)

    def _objection(self, scope: Scope, name: str, formula: Formula, binding: Binding) -> str | None:
        """Return why a name may not be bound to a formula; nothing where it may; None where it stays what it is."""
        if formula.is_matrix and self.quantities.quantity(name):
            return ""
        if self.quantities.is_parameter(name) and formula.number is not None:
            value = self.values.get(self.quantities.parameters[plain_name(name)])
            if value is not None and abs(value - formula.number) <= TOLERANCE * abs(value):
                return None
            return f"{name} is set to {formula.text[:40]} in {binding.line}; the robot's file has {value}"
        if not self.is_proper(name):
            return ""
        if formula.problem:
            return f"{name} is set in {binding.line} to what is not read"
        if self._is_same_state(scope, name, formula, binding.place) or self._is_field(scope, name, formula):
            return None
        return f"{name} is set to {formula.text[:40]!r} in {binding.line}, and is the robot's own name"

    def _is_same_state(self, scope: Scope, name: str, formula: Formula, place: int) -> bool:
        """Whether a formula is the joint variable, or the vector of them, that the name stands for anyway."""
        if formula.entries is not None:
            entries = list(formula.entries.items())
            numbered = all(max(index) == k and sum(index) == k for k, (index, _) in enumerate(entries))
            return (
                numbered
                and len(entries) == self.quantities.n
                and self.is_vector(name)
                and all(
                    self._is_same_state(scope, f"{plain_name(name)}{k + 1}", entry, place)
                    for k, (_, entry) in enumerate(entries)
                )
            )
        values = [read for read in formula.reads if read.use is Use.VALUE]
        if any(not self.is_itself(scope, read, place) for read in formula.reads) or len(values) > 1:
            return False
        meaning = self._state(formula.text, values[0] if values else None)
        if meaning is None:
            return self.is_vector(name) and plain_name(name) == plain_name(formula.text)
        return meaning == self.find(name) and self.vocabulary.is_state(plain_name(name))

    def _state(self, text: str, read: Read | None) -> Meaning | None:
        if timed := TIMED.fullmatch(text):
            return self.find(dotted(plain_name(timed[1]), "ddot" if timed[2] else "dot"))
        if read is not None and read.index is not None and (read.start, read.end) == (0, len(text)):
            position = self.position(read.index)
            return None if position is None else self.find(f"{plain_name(read.name)}{position + 1}")
        is_name = re.fullmatch(r"\w+(\(t\))?", text) is not None
        return self.find(text.removesuffix("(t)")) if is_name else None

    @staticmethod
    def position(index: tuple[int, ...]) -> int | None:
        """Return which entry of a vector an index means: (k,), (k, 0)."""
        if len(index) == 1:
            return index[0]
        return index[0] if len(index) == 2 and index[1] == 0 else None

    def is_itself(self, scope: Scope, read: Read, place: int) -> bool:
        """Whether a name that is read is what the notation says it is."""
        owner = scope.owner(read.name)
        if owner is None:
            return read.use is not Use.CALL or read.name in FUNCTION_NAMES or read.name in ("diff", "Derivative")
        standing = self.standing(owner, read.name)
        if read.use is Use.CALL:
            return isinstance(standing.library, FunctionNamed)
        if read.use is Use.MODULE:
            return isinstance(standing.library, ModuleNamed)
        before = standing.defined is not None and place <= standing.defined.place
        return not standing.wrong and standing.is_itself and (standing.defined is None or before)
