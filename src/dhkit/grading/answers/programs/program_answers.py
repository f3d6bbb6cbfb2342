"""The answers that a program gives: which of its names are quantities or entries of them, and their texts."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple, Protocol

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.scope import Record, Scope
from dhkit.grading.answers.programs.values import (
    Function,
    Given,
    Matrix,
    Scalar,
    Several,
    Structure,
    Unread,
    UnreadError,
    Value,
)
from dhkit.grading.answers.quantity_names import Target
from dhkit.grading.answers.sheet import source_sheet
from dhkit.grading.answers.sheet_values import AnswerSheet, Entries, EqualFormulas, Refusal

_WRITTEN_BY_DHKIT = {
    "mass_matrix": "M",
    "coriolis_matrix": "C",
    "coriolis_torque": "h",
    "gravity_torque": "g",
    "inverse_dynamics": "tau",
    "kinetic_energy": "K",
    "potential_energy": "V",
}
"""Functions of `dhkit equations --format python`, and the quantities that they return."""
_ENERGIES = ("K", "V", "L")


class ReadProgram(Protocol):
    """A program that was read."""

    record: Record
    main: Scope
    functions: list[Function]

    def arguments_as_given(self, function: Function) -> dict[str, Value]:
        """Return a function's arguments as themselves."""

    def returned_names(self, function: Function) -> list[str]:
        """Return the names in a function's result."""

    def applied(self, function: Function, arguments: dict[str, Value]) -> tuple[Value, Scope]:
        """Return a function's result, and its local names."""

    def assigned_anywhere(self) -> Iterable[tuple[str, str]]:
        """Yield the targets of assignments, with their lines: names, keys, fields, those in unread statements too."""


@dataclass(frozen=True)
class _Candidate:
    """A quantity, or an entry of one, as a program gives it.

    Attributes
    ----------
    target
        The quantity or entry.
    where
        The line in which it is assigned, as messages name it.
    value
        Its formula or matrix.
    name
        Its name in the program.
    key
        What tells its name from those of other scopes.
    is_alias, is_named_entry
        Whether the name is another name of the quantity, such as U for V, or that of an entry, such as M12.
    function
        The function that gives it; empty for the program itself.
    """

    target: Target
    where: str
    value: Scalar | Matrix | Unread
    name: str
    key: str
    is_alias: bool = False
    is_named_entry: bool = False
    function: str = ""


class _Result(NamedTuple):
    """One result of a function."""

    name: str
    """Local name that is returned; empty for a formula."""
    called: str
    """Name that tells the quantity: the local name, or the function's if that is a quantity's."""
    value: Value
    """Its formula or matrix."""


def called_name(function: Function) -> str:
    """Return a function's name; dhkit's own names of functions stand for the quantities."""
    return _WRITTEN_BY_DHKIT.get(function.name, function.name)


def answers_of(program: ReadProgram, file: str) -> AnswerSheet:
    """Return the answers of a program.

    Raises
    ------
    AnswerError
        It gives none, or answers are made of too many names.
    """
    return _ProgramAnswers(program).sheet(file)


class _ProgramAnswers:
    def __init__(self, program: ReadProgram) -> None:
        self.program = program
        self.record = program.record
        self.quantities = program.record.robot.quantities
        self.parameters: dict[str, str | Refusal] = {}
        self._function_scopes: list[Scope] = []

    def sheet(self, file: str) -> AnswerSheet:
        main = self.program.main
        candidates: list[_Candidate] = []
        for name in list(main.names):
            candidates += self._given_by(main, name, name)
        candidates += self._given_by_functions({one.target.quantity for one in candidates})
        candidates = self._without_aliases(self._without_calls(candidates))
        answers: dict[str, str | Entries | Refusal] = {}
        for quantity in dict.fromkeys(one.target.quantity for one in candidates):
            own = [one for one in candidates if one.target.quantity == quantity]
            answer = self._answer(own, candidates)
            if answer is not None:
                answers[quantity] = answer
        record = self.record
        self._note_unjudged(answers)
        return source_sheet(
            file, self.quantities.n, answers, self.parameters, record.notes, record.left_out
        )

    def _note_unjudged(self, answers: Iterable[str]) -> None:
        """Name the quantities that the program assigns where nothing is read, such as a branch or a class."""
        noted = set(answers)
        for name, where in self.program.assigned_anywhere():
            quantity = self.quantities.quantity(name)
            if not quantity or quantity in noted or self.quantities.is_alias(name):
                continue
            if self.record.robot.is_reserved(name) or name in self.program.main.names:
                continue
            noted.add(quantity)
            if not any(re.search(rf"\b{re.escape(name)}\b", text) for text in self.record.left_out):
                self.record.left_out.append(
                    f"{where}: {name} (assigned where the program is not read)"
                )

    # The program's answers

    def _given_by(
        self, scope: Scope, name: str, called: str, function: str = ""
    ) -> Iterator[_Candidate]:
        """Yield the quantity, or the entries, that a name gives that is called so."""
        binding = scope.names[name]
        value: Value = binding.value
        if scope.key(name) in self.record.broken:
            value = Unread(self.record.broken[scope.key(name)])
        if isinstance(value, Given):
            value = self._of_given(scope, value, binding.where)
        if isinstance(value, Matrix) and not value.entries:
            value = Unread(
                f"{name} is made of the states' shape and never filled, in {binding.where}"
            )
        one = _Candidate(
            Target("M"), binding.where, Unread(""), name, scope.key(name), function=function
        )
        quantity = self.quantities.quantity(called)
        if quantity:
            yield from self._given_whole(
                replace(one, is_alias=self.quantities.is_alias(called)), quantity, called, value
            )
        elif isinstance(value, Scalar | Unread):
            yield from self._given_entry(one, called, value)

    @staticmethod
    def _of_given(scope: Scope, value: Given, where: str) -> Value:
        """Return the robot's name that a name stands for; an argument of a function as it is."""
        if value.is_argument:
            return value
        try:
            return scope.scalar(value)
        except UnreadError as error:
            return Unread(f"{where}: {error}", frozenset((value.name,)))

    def _given_entry(
        self, one: _Candidate, called: str, value: Scalar | Unread
    ) -> Iterator[_Candidate]:
        entries = self.quantities.entries(called)
        is_own_name = self.record.robot.is_reserved(called)
        if not entries or is_own_name:
            return
        if (
            isinstance(value, Scalar)
            and value.is_name
            and self.record.robot.is_same(called, value.text)
        ):
            return  # c12 = c12, and a symbol of the name of an entry
        if len(entries) > 1:
            readings = " or ".join(map(str, entries))
            value = Unread(
                f"{called} in {one.where} may be {readings}; write it with a comma or an underscore"
            )
            entries = [Target(entry.quantity) for entry in entries]
        for entry in entries:
            yield replace(one, target=entry, value=value, is_named_entry=entry.index is not None)

    def _given_whole(
        self, one: _Candidate, quantity: str, called: str, value: Value
    ) -> Iterator[_Candidate]:
        one = replace(one, target=Target(quantity))
        match value:
            case Unread():
                if self._is_certain(quantity, called, value):
                    yield replace(one, value=value)
                elif not self.record.robot.is_reserved(called):
                    self.record.left_out.append(f"{one.where}: {called} ({value.reason})")
            case Matrix() | Scalar():
                if not self._fits(quantity, called, value, one.is_alias):
                    if not self.record.robot.is_reserved(called) and not self._is_minor(
                        quantity, value
                    ):
                        self.record.left_out.append(f"{one.where}: {called} = {value.text[:60]}")
                elif quantity == "tau" and self._is_input(value):
                    self.record.left_out.append(
                        f"{one.where}: {called} = {value.text[:60]} (an input, not an answer)"
                    )
                else:
                    yield from self._with_entries(one, quantity, value)
            case Several() | Structure():
                self.record.left_out.append(f"{one.where}: {called}, which is several values")

    def _is_certain(self, quantity: str, called: str, value: Unread) -> bool:
        """Whether a name that is not read would be this quantity, and nothing else.

        A matrix in brackets is; a calculation, such as tau = M*ddq + C*dq, is one of the program's own steps.
        """
        if value.is_written_out or not value.names:
            return not (self.quantities.is_alias(called) and not value.is_written_out)
        return self.quantities.is_scalar(quantity) and not self.quantities.is_alias(called)

    @staticmethod
    def _is_minor(quantity: str, value: Scalar | Matrix) -> bool:
        """Whether a number of the name of a quantity is plainly something else: T = 10, a time."""
        return isinstance(value, Scalar) and value.number is not None and quantity in ("T", "L")

    def _is_input(self, value: Scalar | Matrix) -> bool:
        """Whether a torque is given to the program: by numbers, or by names of its own."""
        entries = value.entries.values() if isinstance(value, Matrix) else [value]
        return all(entry.number is not None for entry in entries)

    def _fits(self, quantity: str, called: str, value: Scalar | Matrix, is_alias: bool) -> bool:
        """Whether a value may be a quantity: a matrix or a vector of a matrix, not a number of an energy."""
        if isinstance(value, Scalar):
            if not self.quantities.is_scalar(quantity):
                return False
            is_other_number = value.number is not None and (is_alias or quantity in ("K", "L"))
            return not self.record.robot.is_reserved(called) and not is_other_number
        if quantity in _ENERGIES:
            return len(value.entries) == 1
        return True

    def _with_entries(
        self, one: _Candidate, quantity: str, value: Scalar | Matrix
    ) -> Iterator[_Candidate]:
        """Yield a matrix whole, or the entries of one that was assigned entry by entry."""
        if isinstance(value, Scalar) or not self._is_by_entries(one, value):
            yield replace(one, value=value)
            return
        for index, entry in value.entries.items():
            inside = self.quantities.index_in(quantity, index)
            if inside is not None:
                target = (
                    Target(quantity, inside)
                    if self.quantities.shape(quantity)
                    else Target(quantity)
                )
                yield replace(one, target=target, value=entry)
            elif len(value.entries) > 1 or not one.is_alias:
                place = ", ".join(str(k + 1) for k in index)
                yield replace(
                    one,
                    value=Unread(f"{one.name} has no entry ({place}), which {one.where} assigns"),
                )

    def _is_by_entries(self, one: _Candidate, value: Matrix) -> bool:
        """Whether a matrix was assigned entry by entry, and may lack some."""
        number, name = one.key.split(":", 1)
        scopes = [self.program.main, *self._function_scopes]
        scope = next((x for x in scopes if str(x.number) == number), None)
        return scope is not None and bool(scope.assigned_entries.get(name))

    # Functions

    def _given_by_functions(self, known: set[str]) -> list[_Candidate]:
        """Return the functions' answers: their results, and local names for the quantities that no result gives."""
        self._function_scopes = []
        returned: list[_Candidate] = []
        local: list[_Candidate] = []
        for function in self.program.functions:
            count = len(self.record.left_out)
            quantity = self.quantities.quantity(function.name)
            if quantity and self.quantities.is_parameter(function.name):
                reason = f"{function.name} is the robot's parameter; name the function {function.name.upper()}"
                returned.append(self._unread(function, quantity, reason))
                continue
            try:
                value, scope = self.program.applied(
                    function, self.program.arguments_as_given(function)
                )
            except UnreadError as error:
                quantity = self.quantities.quantity(called_name(function))
                if quantity and not self.quantities.is_parameter(called_name(function)):
                    returned.append(self._unread(function, quantity, f"{function.where}: {error}"))
                continue
            self._function_scopes.append(scope)
            results = self._results(function, value)
            for result in results:
                returned += self._returned_value(function, scope, result)
            given = {result.name for result in results}
            local += self._local_to(function, scope, value, given)
            del self.record.left_out[count:]
        returned = [self._against_main(one) for one in returned]
        known = known | {one.target.quantity for one in returned}
        return [*returned, *self._noted([one for one in local if one.target.quantity not in known])]

    def _unread(self, function: Function, quantity: str, reason: str) -> _Candidate:
        key = self.program.main.key(function.name)
        return _Candidate(Target(quantity), function.where, Unread(reason), function.name, key)

    def _local_to(
        self, function: Function, scope: Scope, value: Value, given: set[str]
    ) -> Iterator[_Candidate]:
        """Yield the quantities that a function assigns and does not return."""
        quantity = self.quantities.quantity(called_name(function))
        for name in list(scope.names):
            if name in given or name in function.parameters:
                continue
            for one in self._given_by(scope, name, name, function.name):
                if quantity == one.target.quantity and not self._all_scalars(value):
                    reason = f"{function.name}, in {function.where}, returns nothing that is read"
                    yield replace(one, value=Unread(reason))
                elif self._is_changed_on_return(function, scope, value, one):
                    reason = f"{function.name} returns something else that it makes of {name}"
                    yield replace(one, value=Unread(f"{reason}, which {one.where} assigns"))
                else:
                    yield one

    def _noted(self, local: Sequence[_Candidate]) -> Sequence[_Candidate]:
        """Note the first local name of each quantity."""
        noted: set[str] = set()
        for one in local:
            if not isinstance(one.value, Unread) and one.target.quantity not in noted:
                noted.add(one.target.quantity)
                self.record.note(
                    f"{one.where}: {one.name} is a local name of a function, which does not return it"
                )
        return local

    def _against_main(self, one: _Candidate) -> _Candidate:
        """Refuse a function's answer where the program binds the same name to something that is not read."""
        main = self.program.main
        for name in (
            one.name,
            *(
                other
                for other in main.names
                if self.quantities.quantity(other) == one.target.quantity
            ),
        ):
            binding = main.names.get(name)
            if (
                binding is None
                or isinstance(binding.value, Function)
                or self.record.robot.is_reserved(name)
            ):
                continue
            if isinstance(binding.value, Matrix | Structure) or (
                name != one.name and isinstance(binding.value, Given)
            ):
                continue
            if isinstance(binding.value, Scalar) and self.quantities.is_scalar(one.target.quantity):
                continue
            if isinstance(binding.value, Unread) and self._is_call_at_numbers(
                binding.value, one.function
            ):
                continue
            return replace(
                one, value=Unread(f"{name} is bound in {binding.where} to what is not read")
            )
        return one

    def _is_call_at_numbers(self, value: Unread, function: str) -> bool:
        """Whether an unread statement calls a function at names that stand for numbers."""
        main = self.program.main
        others = value.names - {function}
        if function not in value.names or not others <= main.names.keys():
            return False
        return bool(others) and all(_is_of_numbers(main.names[name].value) for name in others)

    def _is_changed_on_return(
        self, function: Function, scope: Scope, value: Value, one: _Candidate
    ) -> bool:
        """Whether a function's result contains a local name and no other quantity: -G, G*sign."""
        names = set(self.program.returned_names(function))
        uses = frozenset[str]().union(*(x.uses for x in self._all_scalars(value)))
        keys = {key.partition("[")[0] for key in self._all_uses(uses)}
        names |= {name for name in scope.names if scope.key(name) in keys}
        waiting = list(names)
        while waiting:  # what is not read is made of the names in it
            binding = scope.names.get(waiting.pop())
            if binding is not None and isinstance(binding.value, Unread):
                new_names = binding.value.names - names
                names |= new_names
                waiting += new_names
        if one.name not in names:
            return False
        robot = self.record.robot
        others = [
            name
            for name in names - {one.name}
            if name not in function.parameters or robot.is_vector(name)
        ]
        for name in others:
            quantity = self.quantities.quantity(name) or next(
                (t.quantity for t in self.quantities.entries(name)), ""
            )
            if (quantity and quantity != one.target.quantity) or (
                robot.is_vector(name) and not quantity
            ):
                return False
        return True

    @staticmethod
    def _all_scalars(value: Value) -> list[Scalar]:
        """Return the scalars of a function's result."""
        values = value.values if isinstance(value, Several) else (value,)
        return list(chain.from_iterable(map(_scalars, values)))

    def _all_uses(self, uses: frozenset[str]) -> set[str]:
        """Return the keys that formulas are made of, those not to be relied on included."""
        found = set(uses)
        waiting = list(uses)
        while waiting:
            definition = self.record.definitions.get(waiting.pop())
            if definition is not None:
                new_keys = definition.formula.uses - found
                found |= new_keys
                waiting += new_keys
        return found

    def _results(self, function: Function, value: Value) -> list[_Result]:
        """Return the results of a function; the fields of a structure are results of their own."""
        own = called_name(function)
        match value:
            case Several(values, names):
                results: list[_Result] = []
                for name, one in zip(names or ("",) * len(values), values, strict=True):
                    fields = one.fields if isinstance(one, Structure) else {name: one}
                    results += [_Result(field, field, inner) for field, inner in fields.items()]
                return results
            case Structure(fields):
                return [_Result(name, name, one) for name, one in fields.items()]
        local = self._local_name(function)
        is_named = self.quantities.quantity(own) or self.quantities.entries(own)
        return [_Result(local, own if is_named else local, value)]

    def _local_name(self, function: Function) -> str:
        """Return the local name that a function returns alone; empty where it returns a formula."""
        find: Callable[[Function], str] | None = getattr(self.program, "returned_name", None)
        return find(function) if find is not None else ""

    def _returned_value(
        self, function: Function, scope: Scope, result: _Result
    ) -> Iterable[_Candidate]:
        name, called, value = result
        is_local = name in scope.names and name not in function.parameters
        if is_local and scope.stands_for(name, value):
            return [*self._given_by(scope, name, called, function.name)]
        quantity = self.quantities.quantity(called) if called else ""
        one = _Candidate(
            Target(quantity or "M"),
            function.where,
            Unread(""),
            called,
            f"{scope.number}:",
            function=function.name,
        )
        if isinstance(value, Given):
            return []
        if quantity and isinstance(value, Unread):
            return [replace(one, value=value)]
        if quantity:
            return [
                *self._given_whole(
                    replace(one, is_alias=self.quantities.is_alias(called)), quantity, called, value
                )
            ]
        if called and isinstance(value, Scalar | Unread):
            return [*self._given_entry(one, called, value)]
        return []

    # Names that stand for one thing

    def _without_calls(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Leave out the answers made by calling a function of the program that gives the same quantity."""
        by_functions = {one.target.quantity: one.function for one in candidates if one.function}
        kept = []
        for one in candidates:
            maker = by_functions.get(one.target.quantity, "")
            if not one.function and maker and self._is_call_of(one, maker):
                continue
            kept.append(one)
        return kept

    def _is_call_of(self, one: _Candidate, function: str) -> bool:
        """Whether a value is a function's at numbers for the joint variables, as a test of it."""
        scalars = _scalars(one.value)
        key = self.program.main.key(function)
        if not scalars or not all(key in scalar.uses for scalar in scalars):
            return False
        definitions = self.record.definitions
        texts = [scalar.text for scalar in scalars]
        uses = frozenset[str]().union(*(scalar.uses for scalar in scalars))
        used_definitions = self._all_uses(uses) & definitions.keys()
        texts += [definitions[key].formula.text for key in used_definitions]
        words = re.findall(r"[A-Za-z]\w*", "\n".join(texts), re.ASCII)
        return not any(self.record.robot.vocabulary.is_state(word) for word in words)

    def _without_aliases(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Leave aliases out where the quantity goes by its own name too."""
        own = {
            one.target.quantity for one in candidates if not one.is_alias and not one.is_named_entry
        }
        kept = []
        for one in candidates:
            quantity = one.target.quantity
            if one.is_alias and quantity in own:
                self.record.left_out.append(
                    f"{one.where}: {one.name} (read as a name, since {quantity} is given too)"
                )
                continue
            if one.is_alias and not isinstance(one.value, Unread):
                self.record.note(f"{one.where}: {one.name} is read as {quantity}")
            kept.append(one)
        return kept

    # One quantity

    def _answer(
        self, own: Sequence[_Candidate], candidates: Sequence[_Candidate]
    ) -> str | Entries | Refusal | None:
        whole = [one for one in own if one.target.index is None]
        entries = [one for one in own if one.target.index is not None]
        for one in whole:
            if isinstance(one.value, Unread):
                return Refusal(one.value.reason)
        if whole:
            return self._whole_answer(whole, entries)
        entries = [one for one in entries if not self._is_part_of_energy(one, candidates)]
        return self._entries_answer(entries) if entries else None

    def _text_of(self, one: _Candidate) -> str | Refusal:
        """Return the text of an answer; the names in it are defined beside the answers."""
        value = one.value
        if isinstance(value, Unread):
            return Refusal(value.reason)
        keys = [one.key, *([self.program.main.key(one.function)] if one.function else [])]
        scalars = value.entries.values() if isinstance(value, Matrix) else [value]
        uses = frozenset[str]().union(*(scalar.uses for scalar in scalars))
        try:
            needed = self.record.closure([*uses, *keys])
        except UnreadError as error:
            return Refusal(str(error))
        for used in needed:
            if used in self.record.definitions and used not in keys:
                definition = self.record.definitions[used]
                self.parameters[definition.name] = definition.formula.text
        if len(self.parameters) > BOUNDS.definitions:
            raise AnswerError(f"answers are made of more than {BOUNDS.definitions} names")
        return value.text

    def _whole_answer(
        self, whole: Sequence[_Candidate], entries: Sequence[_Candidate]
    ) -> str | Refusal:
        quantity = whole[0].target.quantity
        texts = [self._text_of(one) for one in whole]
        if refused := next((text for text in texts if isinstance(text, Refusal)), None):
            return refused
        whole_texts = [self._spelt_out(one) for one in whole]
        if any(text != whole_texts[0] for text in whole_texts):
            return Refusal(
                f"{quantity} is assigned twice, in {whole[0].where} and in {whole[-1].where}"
            )
        for one in entries:
            text = self._text_of(one)
            if isinstance(text, Refusal):
                return text
            if not (self._is_made_with(whole[0], one) or self._is_made_with(one, whole[0])):
                return Refusal(
                    f"{quantity} is given in {whole[0].where} and its entry {one.name} apart, in {one.where}"
                )
        return texts[0]

    def _spelt_out(self, one: _Candidate) -> list[str]:
        """Return the texts of an answer's entries, each with its definition if it is a single name."""
        formulas = {
            definition.name: definition.formula for definition in self.record.definitions.values()
        }
        texts = []
        for scalar in _scalars(one.value):
            text = scalar.text
            while text in formulas:
                text = formulas[text].text
            texts.append(text)
        return texts

    def _is_made_with(self, one: _Candidate, part: _Candidate) -> bool:
        """Whether a formula is made with the name of another."""
        if isinstance(one.value, Unread):
            return False
        scalars = one.value.entries.values() if isinstance(one.value, Matrix) else [one.value]
        uses = frozenset[str]().union(*(scalar.uses for scalar in scalars))
        try:
            return part.key in self.record.closure(uses)
        except UnreadError:
            return False

    def _is_part_of_energy(self, one: _Candidate, candidates: Sequence[_Candidate]) -> bool:
        """Whether a name is rather a height or a transform that an energy is made of than an entry of h, T, J or A."""
        if not one.is_named_entry or one.target.quantity in ("M", "C", "g", "tau"):
            return False
        energies = (other for other in candidates if other.target.quantity in _ENERGIES)
        user = next(
            (other.target.quantity for other in energies if self._is_made_with(other, one)), ""
        )
        if user:
            self.record.note(
                f"{one.where}: {one.name} is read as the program's own name, which {user} uses"
            )
        return bool(user)

    def _entries_answer(self, entries: Sequence[_Candidate]) -> Entries | Refusal:
        texts: dict[tuple[int, ...], str | EqualFormulas | Refusal] = {}
        lines: dict[tuple[int, ...], str] = {}
        for one in entries:
            index = one.target.index or ()
            text = self._text_of(one)
            if texts.setdefault(index, text) != text:
                return Refusal(
                    f"{one.target} is assigned twice, in {lines[index]} and in {one.where}"
                )
            lines.setdefault(index, one.where)
        return Entries(dict(sorted(texts.items())))


def _is_of_numbers(value: Value) -> bool:
    """Whether a value is a number, or a matrix of numbers."""
    scalars = _scalars(value)
    return bool(scalars) and all(scalar.number is not None for scalar in scalars)


def _scalars(value: Value) -> list[Scalar]:
    """Return the scalars of a value."""
    if isinstance(value, Matrix):
        return list(value.entries.values())
    return [value] if isinstance(value, Scalar) else []
