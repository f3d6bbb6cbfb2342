"""The answers that a program gives: which of its names are quantities or entries of them, and their texts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

from dhkit.description import Description
from dhkit.grading.answers.programs.bindings import (
    RETURNED_FORMULA,
    Binding,
    Formula,
    NotUnderstood,
    OwnFunction,
    Program,
    Scope,
    Use,
)
from dhkit.grading.answers.programs.definitions import Definition, Definitions, definition_of
from dhkit.grading.answers.programs.name_resolution import NameResolver, Resolution
from dhkit.grading.answers.quantity_names import Target
from dhkit.grading.answers.sheet import source_sheet
from dhkit.grading.answers.sheet_values import NO_NAMES, AnswerSheet, Chain, Entries, Names, Refusal

WRITTEN_BY_DHKIT = {
    "mass_matrix": "M",
    "coriolis_matrix": "C",
    "coriolis_torque": "h",
    "gravity_torque": "g",
    "inverse_dynamics": "tau",
    "kinetic_energy": "K",
    "potential_energy": "V",
}
"""Functions of `dhkit equations --format python`, and what they return."""

MAX_RENAMINGS = 10
"""Largest number of names that are followed from one to the next: M = mass."""

PLAIN_CALL = re.compile(r"(\w+)\s*\(([\w\s,.]*)\)", re.ASCII)
NAME = re.compile(r"[A-Za-z_]\w*")


@dataclass(frozen=True)
class _Candidate:
    """A quantity, or an entry of one, as a program gives it.

    Attributes
    ----------
    target
        The quantity or entry.
    line
        Line of the assignment.
    definition
        Its formula; None where it cannot be read.
    problem
        Why it cannot be read; empty where it can.
    name, called
        Name in the program, and the name that says what it is: a function's for what the function returns.
    is_alias, is_named_entry
        Whether the name is another name of the quantity, such as U for V, or that of an entry, such as M12.
    function, is_local
        The function that assigns it, empty for the program itself, and whether that function does not return it.
    """

    target: Target
    line: str
    definition: Definition | None = None
    problem: str = ""
    name: str = ""
    called: str = ""
    is_alias: bool = False
    is_named_entry: bool = False
    function: str = ""
    is_local: bool = False

    @property
    def is_in_function(self) -> bool:
        return bool(self.function) or self.is_local

    def refuse(self, problem: str) -> _Candidate:
        return replace(self, definition=None, problem=problem)


def answers_of(program: Program, description: Description, file: str, names: Names = NO_NAMES) -> AnswerSheet:
    """Return the answers of a program; ``names`` are the task's names of the joint variables.

    Raises
    ------
    AnswerError
        It gives none, or answers are made of too many names.
    """
    return _ProgramAnswers(program, description, names).sheet(file)


class _ProgramAnswers:
    def __init__(self, program: Program, description: Description, names: Names) -> None:
        self.program = program
        self.names = NameResolver(description, names)
        self.quantities = self.names.quantities
        self.definitions = Definitions(self.names)
        self.left_out = list(program.left_out)
        self.notes: list[str] = []
        self.zero_quantities: set[str] = set()
        """Quantities of which entries that are not assigned are zero."""

    def sheet(self, file: str) -> AnswerSheet:
        main = self.program.main
        candidates = [one for name in main.bindings for one in self._given_by_name(main, name, name)]
        candidates += self._returned_by_functions()
        candidates = self._refuse_rebound([*candidates, *self._local_to_functions(candidates)])
        candidates = self._without_aliases(candidates)
        answers: dict[str, str | Entries | Refusal] = {}
        for quantity in dict.fromkeys(one.target.quantity for one in candidates):
            answer = self._answer(quantity, candidates)
            if answer is not None:
                answers[quantity] = answer
        notes = (*self.notes, *self.definitions.notes)
        return source_sheet(file, self.quantities.n, answers, self.definitions.parameters, notes, self.left_out)

    # What the program gives

    def _returned_by_functions(self) -> Iterator[_Candidate]:
        for scope in self.program.functions:
            for returned in scope.return_values:
                own = WRITTEN_BY_DHKIT.get(returned.function, returned.function)
                is_named = self.quantities.quantity(own) or self.quantities.entries(own)
                called = own if returned.is_only and is_named else returned.local
                if returned.local in scope.bindings:
                    for one in self._given_by_name(scope, returned.local, called):
                        yield replace(one, called=called, function=returned.function)

    def _local_to_functions(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Return what functions assign and do not return, of quantities that nothing else gives."""
        known = {one.target.quantity for one in candidates}
        local: list[_Candidate] = []
        for scope in self.program.functions:
            returned = {value.local for value in scope.return_values}
            function = scope.return_values[0].function if scope.return_values else ""
            for name in scope.bindings:
                if name in returned or name == RETURNED_FORMULA:
                    continue
                for one in self._given_by_name(scope, name, name):
                    if one.target.quantity in known:
                        continue
                    if not one.problem and self._is_changed_on_return(scope, name, one.target.quantity):
                        one = one.refuse(
                            f"{function} returns something else that it makes of {name}, which {one.line} assigns"
                        )
                    local.append(replace(one, called=name, function=function, is_local=True))
        first = {one.target.quantity: one for one in reversed(local) if not one.problem}
        for one in local:
            if first.get(one.target.quantity) is one:
                self.notes.append(f"{one.line}: {one.name} is a local name of a function, which does not return it")
        return local

    def _is_changed_on_return(self, scope: Scope, name: str, quantity: str) -> bool:
        """Whether what a function returns is made of a local name and of no other quantity: -G, G*sign."""
        waiting = [used for value in scope.return_values for used in (value.names or (value.local,))]
        seen: set[str] = set()
        while waiting:
            used = waiting.pop()
            if used in seen:
                continue
            seen.add(used)
            if used == name:
                continue
            other = self.quantities.quantity(used) or next((t.quantity for t in self.quantities.entries(used)), "")
            is_known = self.names.is_vector(used) or self.names.find(used) is not None
            if ((other and other != quantity) or is_known) and not self.quantities.is_parameter(used) and used != "t":
                return False
            formulas = [binding.formula for binding in scope.bindings.get(used, ())]
            waiting += [word for formula in formulas if formula is not None for word in NAME.findall(formula.text)]
        return name in seen

    def _given_by_name(self, scope: Scope, name: str, called: str) -> Iterable[_Candidate]:
        """Yield what a name gives that is called as a quantity or an entry is."""
        quantity = self.quantities.quantity(called)
        entries = [] if quantity else self.quantities.entries(called)
        bindings = scope.bindings[name]
        resolution = self.names.resolve(scope, name) if quantity or entries else Resolution()
        if quantity:
            yield from self._given_whole(scope, name, called, quantity, resolution)
        scalars = [b for b in bindings if b.index is None and b.formula is not None and not b.formula.is_matrix]
        if not entries or not scalars or any(b.index is not None for b in bindings):
            return
        line = scalars[0].line
        if len(entries) > 1:
            readings = " or ".join(map(str, entries))
            problem = f"{called} in {line} may be {readings}; write it with a comma or an underscore"
            for target in entries:
                yield _Candidate(Target(target.quantity), line, problem=problem, name=name)
        elif resolution.problem:
            yield _Candidate(entries[0], line, problem=resolution.problem, name=name, is_named_entry=True)
        elif not resolution.has_usual_meaning:
            yield _Candidate(entries[0], line, definition_of(scope, name, scalars[:1]), name=name, is_named_entry=True)

    def _given_whole(
        self, scope: Scope, name: str, called: str, quantity: str, resolution: Resolution
    ) -> Iterable[_Candidate]:
        """Yield what a name gives that is called as a quantity: all of it, or its entries."""
        bindings = scope.bindings[name]
        is_alias = self.quantities.is_alias(called)
        has_parts = any(b.index is not None for b in bindings)
        is_fitting = any(b.index is None and self._fits(quantity, called, b.formula, is_alias) for b in bindings)
        whole = _Candidate(Target(quantity), bindings[0].line, name=name, is_alias=is_alias)
        if resolution.problem:
            is_certain = not is_alias and quantity in ("M", "C", "h", "tau", "K", "V", "L")
            is_certain = is_certain and not self.quantities.is_parameter(called)
            if is_fitting or has_parts or (is_certain and any(b.is_not_understood for b in bindings)):
                yield whole.refuse(resolution.problem)
            return
        if has_parts:
            yield from self._given_by_parts(scope, quantity, resolution, whole)
            return
        binding = resolution.definition
        formula = binding.formula if binding is not None else None
        if binding is None or formula is None:
            return
        whole = replace(whole, line=binding.line)
        followed = self._follow_renaming(scope, binding)
        if is_fitting:
            if formula.is_zeros:
                zeros = Formula(_zeros(self.quantities.shape(quantity)))
                yield replace(whole, definition=definition_of(scope, name, [replace(binding, value=zeros)]))
            else:
                yield replace(whole, definition=followed or definition_of(scope, name, [binding]))
        elif followed is not None and not self.quantities.is_scalar(quantity):
            yield replace(whole, definition=followed)
        elif quantity not in ("T", "L") or formula.problem:
            problem = f" ({formula.problem})" if formula.problem else ""
            self.left_out.append(f"{binding.line}: {called} = {formula.text[:60]}{problem}")

    def _given_by_parts(
        self, scope: Scope, quantity: str, resolution: Resolution, whole: _Candidate
    ) -> Iterable[_Candidate]:
        if resolution.has_zeros:
            self.zero_quantities.add(quantity)
        for index, bindings in resolution.entries.items():
            one = replace(whole, line=bindings[0].line)
            inside = self.quantities.index_in(quantity, index)
            if inside is not None:
                target = Target(quantity, inside) if self.quantities.shape(quantity) else Target(quantity)
                yield replace(one, target=target, definition=definition_of(scope, whole.name, bindings))
            elif len(resolution.entries) > 1 or not whole.is_alias:
                place = ", ".join(str(k + 1) for k in index)
                yield one.refuse(f"{whole.name} has no entry ({place}), which {one.line} assigns")

    def _fits(self, quantity: str, called: str, formula: Formula | None, is_alias: bool) -> bool:
        """Whether a formula may be a quantity: a matrix or a vector of a matrix, no number of an energy."""
        if formula is None:
            return False
        if self.quantities.is_scalar(quantity) and not formula.is_matrix:
            is_other_number = formula.number is not None and (is_alias or quantity in ("K", "L"))
            return not self.quantities.is_parameter(called) and not is_other_number
        if quantity in ("K", "V", "L"):
            return formula.entries is not None and len(formula.entries) == 1
        return formula.is_matrix

    def _follow_renaming(self, scope: Scope, binding: Binding) -> Definition | None:
        """Return the matrix that a name is another name of: M = mass."""
        for _ in range(MAX_RENAMINGS):
            formula = binding.formula
            if formula is None or formula.is_matrix or len(formula.reads) != 1:
                return None
            (read,) = formula.reads
            owner = scope.owner(read.name)
            is_whole = (read.start, read.end) == (0, len(formula.text)) and read.index is None and not read.member
            if owner is None or not is_whole or read.use is not Use.VALUE:
                return None
            resolution = self.names.resolve(owner, read.name)
            definition = resolution.definition
            if resolution.problem or definition is None or definition.order >= binding.order:
                return None
            if definition.formula is not None and definition.formula.entries is not None:
                return definition_of(owner, read.name, [definition])
            scope, binding = owner, definition
        return None

    # Names that stand for something else

    def _refuse_rebound(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Refuse what functions give where the program binds the function, or the quantity, to something else."""
        main = self.program.main
        understood = {one.name for one in candidates if not one.is_in_function}
        for one in candidates:
            if not one.is_local and one.called in (one.function, WRITTEN_BY_DHKIT.get(one.function)):
                understood.add(one.function)
        others = [name for name in main.bindings if name not in understood]
        kept = []
        for one in candidates:
            problem = ""
            if one.is_in_function and not one.problem:
                rival = next(
                    (x for x in others if self._is_rival(x, one) and not self._is_plain_call(x, one.function)), ""
                )
                if one.function in main.bindings:
                    problem = self.names.resolve(main, one.function).problem
                if rival and not problem:
                    problem = f"{rival} is bound in {main.bindings[rival][-1].line} to what is not read"
            elif one.is_named_entry and not one.problem:
                whole = next((x for x in others if self._is_made_of(x, one)), "")
                line = main.bindings[whole][-1].line if whole else ""
                problem = f"{whole} is made of {one.name} in {line}, in a way that is not read" if whole else ""
            kept.append(one.refuse(problem) if problem else one)
        return kept

    def _is_rival(self, name: str, one: _Candidate) -> bool:
        """Whether a name of the program is that of a quantity that a function gives."""
        if not _whole_bindings(self.program.main, name):
            return False
        is_same = self.quantities.quantity(name) == one.target.quantity and not self.quantities.is_alias(name)
        if name not in (one.called, one.name) and not is_same:
            return False
        if self.quantities.is_parameter(name):
            resolution = self.names.resolve(self.program.main, name)
            return bool(resolution.problem) or not resolution.has_usual_meaning
        return True

    def _is_made_of(self, name: str, one: _Candidate) -> bool:
        """Whether a name of the program is that of a whole quantity that is made of an entry of it: G = -[G1, G2]."""
        if self.quantities.quantity(name) != one.target.quantity or self.quantities.is_parameter(name):
            return False
        formulas = [binding.formula for binding in self.program.main.bindings[name]]
        return any(one.name in NAME.findall(formula.text) for formula in formulas if formula is not None)

    def _is_plain_call(self, name: str, function: str) -> bool:
        """Whether a name is bound to a call of the function that gives the quantity, with its own arguments."""
        main = self.program.main
        scopes = (s for s in self.program.functions if any(value.function == function for value in s.return_values))
        scope = next(scopes, None)
        bindings = _whole_bindings(main, name)
        formula = bindings[0].formula if len(bindings) == 1 else None
        match = PLAIN_CALL.fullmatch(formula.text) if formula is not None else None
        if scope is None or match is None or match[1] != function:
            return False
        formal = [argument for argument, bound in scope.bindings.items() if bound[0].is_argument]
        actual = [argument.strip() for argument in match[2].split(",")] if match[2].strip() else []
        is_own = all(isinstance(b.value, OwnFunction) for b in _whole_bindings(main, function))
        return is_own and len(actual) <= len(formal) and all(map(self._is_own_argument, actual, formal))

    def _is_own_argument(self, actual: str, formal: str) -> bool:
        """Whether a call gives an argument by its own name, unchanged by the program, or as a number."""
        if re.fullmatch(r"[\d.]+", actual) and not self.quantities.is_parameter(formal):
            return True
        is_bound = bool(_whole_bindings(self.program.main, actual))
        return actual == formal and (not is_bound or self._is_state_or_numbers(actual))

    def _is_state_or_numbers(self, name: str) -> bool:
        """Whether a name of the program is what the notation says, or numbers for joint variables."""
        resolution = self.names.resolve(self.program.main, name)
        if resolution.has_usual_meaning and not resolution.problem and resolution.definition is None:
            return True
        bindings = _whole_bindings(self.program.main, name)
        formula = bindings[0].formula if len(bindings) == 1 else None
        if self.quantities.is_parameter(name) or formula is None:
            return False
        return all(entry.number is not None for entry in (formula.entries or {(): formula}).values())

    def _without_aliases(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Leave aliases out where the quantity goes by its own name too."""
        own = {one.target.quantity for one in candidates if not one.is_alias and not one.is_named_entry}
        kept, noted = [], set()
        for one in candidates:
            quantity = one.target.quantity
            if one.is_alias and quantity in own:
                self.left_out.append(f"{one.line}: {one.name} (read as a name, since {quantity} is given too)")
                continue
            if one.is_alias and one.name not in noted:
                self.notes.append(f"{one.line}: {one.name} is read as {quantity}")
                noted.add(one.name)
            kept.append(one)
        return kept

    # One quantity

    def _answer(self, quantity: str, candidates: Sequence[_Candidate]) -> str | Entries | Refusal | None:
        own = [one for one in candidates if one.target.quantity == quantity]
        whole = [one for one in own if one.target.index is None]
        entries = [one for one in own if one.target.index is not None]
        if refused := next((one for one in whole if one.problem), None):
            return Refusal(refused.problem)
        if whole:
            return self._whole_answer(quantity, whole, entries)
        entries = [one for one in entries if not self._is_part_of_energy(one, candidates)]
        return self._entries_answer(quantity, entries) if entries else None

    def _text_of(self, one: _Candidate) -> str | Refusal:
        return self.definitions.text_of(one.definition) if one.definition is not None else Refusal(one.problem)

    def _whole_answer(self, quantity: str, whole: Sequence[_Candidate], entries: Sequence[_Candidate]) -> str | Refusal:
        texts = [self._text_of(one) for one in whole]
        if any(text != texts[0] for text in texts):
            return Refusal(f"{quantity} is assigned twice, in {whole[0].line} and in {whole[-1].line}")
        for one in entries:
            if one.definition is None:
                return Refusal(one.problem)
            self._text_of(one)
            if not (self._is_made_with(whole[0], one) or self._is_made_with(one, whole[0])):
                return Refusal(f"{quantity} is given in {whole[0].line} and its entry {one.name} apart, in {one.line}")
        return texts[0]

    def _is_made_with(self, one: _Candidate, part: _Candidate) -> bool:
        """Whether a formula reads the name of another, or is it."""
        if one.definition is None or part.definition is None:
            return False
        key = (id(part.definition.scope), part.definition.name)
        return any(used[:2] == key for used in self.definitions.closure(one.definition))

    def _is_part_of_energy(self, one: _Candidate, candidates: Sequence[_Candidate]) -> bool:
        """Whether a name is rather a height or a transform that an energy is made of than an entry of h, T, J or A."""
        if not one.is_named_entry or one.target.quantity in ("M", "C", "g", "tau"):
            return False
        energies = (other for other in candidates if other.target.quantity in ("K", "V", "L"))
        user = next((other.target.quantity for other in energies if self._is_made_with(other, one)), "")
        if user:
            self.notes.append(f"{one.line}: {one.name} is read as the program's own name, which {user} uses")
        return bool(user)

    def _entries_answer(self, quantity: str, entries: Sequence[_Candidate]) -> Entries | Refusal:
        texts: dict[tuple[int, ...], str | Chain | Refusal] = {}
        lines: dict[tuple[int, ...], str] = {}
        for one in entries:
            index = one.target.index or ()
            text = self._text_of(one)
            if texts.setdefault(index, text) != text:
                return Refusal(f"{one.target} is assigned twice, in {lines[index]} and in {one.line}")
            lines.setdefault(index, one.line)
        if quantity in self.zero_quantities:
            texts = dict.fromkeys(product(*map(range, self.quantities.shape(quantity))), "0") | texts
        return Entries(dict(sorted(texts.items())))


def _whole_bindings(scope: Scope, name: str) -> list[Binding]:
    """Return what binds a name, without calls that may change a matrix that it stands for."""
    bindings = scope.bindings.get(name, ())
    return [b for b in bindings if not (isinstance(b.value, NotUnderstood) and b.value.only_matrices)]


def _zeros(shape: tuple[int, ...]) -> str:
    return "[" + ", ".join([_zeros(shape[1:])] * shape[0]) + "]" if shape else "0"
