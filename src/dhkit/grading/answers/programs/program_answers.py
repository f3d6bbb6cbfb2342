"""The answers that a program gives: which of its names are quantities or entries of them, and their texts."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    Binding,
    Formula,
    FunctionNamed,
    NotUnderstood,
    Program,
    Scope,
    Symbol,
    Use,
)
from dhkit.grading.answers.programs.definitions import Definitions, Node
from dhkit.grading.answers.programs.standing import NameTable, Standing
from dhkit.grading.answers.quantity_names import QuantityNames, Target
from dhkit.grading.answers.sheet import AnswerSheet, Chain, Entries, Names, Refusal, quantity_names

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
RETURNED = "return"
"""Local name of a formula that a function returns; no program has a variable of this name."""
MAX_LEFT_OUT = 20
CALL = re.compile(r"(\w+)\s*\(([\w\s,.]*)\)", re.ASCII)


@dataclass(frozen=True)
class _Given:
    """A quantity or an entry as a program gives it: a node, or why it cannot be read."""

    target: Target
    line: str
    node: Node | None = None
    reason: str = ""
    is_alias: bool = False
    is_named_entry: bool = False
    name: str = ""
    called: str = ""
    function: str = ""
    """The function that gives it; empty of the program itself."""


def answers_of(program: Program, description: Description, file: str) -> AnswerSheet:
    """Return the answers of a program.

    Raises
    ------
    AnswerError
        It gives none, or answers are made of too many names.
    """
    return _Answers(program, description, file).sheet()


class _Answers:
    def __init__(self, program: Program, description: Description, file: str) -> None:
        self.program = program
        self.names = NameTable(description)
        self.quantities: QuantityNames = self.names.quantities
        self.file = file
        self.definitions = Definitions(self.names)
        self.left_out = list(program.left_out)
        self.notes = list(program.notes)
        self.zeros: set[str] = set()

    def sheet(self) -> AnswerSheet:
        given = self._with_locals([*self._main(), *self._returned()])
        given = self._without_aliases(self._without_rebound(given))
        answers: dict[str, Any] = {}
        for quantity in dict.fromkeys(one.target.quantity for one in given):
            own = [one for one in given if one.target.quantity == quantity]
            answer = self._answer(quantity, own, given)
            if answer is not None:
                answers[quantity] = answer
        if not answers:
            known = ", ".join(quantity_names(self.quantities.n)[:8])
            left = f"; left out: {self.left_out[0]}" if self.left_out else ""
            raise AnswerError(f"{self.file}: assigns no quantity; expected some of {known}, A1, T, J{left}")
        return AnswerSheet(
            names=Names(parameters=self.definitions.parameters, lenient=True),
            answers=answers,
            file=self.file,
            notes=(*self.notes, *self.definitions.notes),
            left_out=tuple(self.left_out[:MAX_LEFT_OUT]),
        )

    # What the program gives

    def _main(self) -> Iterable[_Given]:
        for name in self.program.main.bindings:
            yield from self._of_name(self.program.main, name, name)

    def _returned(self) -> Iterable[_Given]:
        for scope in self.program.functions:
            for returned in scope.returned:
                own = WRITTEN_BY_DHKIT.get(returned.function, returned.function)
                is_named = self.quantities.quantity(own) or self.quantities.entries(own)
                name = own if returned.is_only and is_named else returned.local
                if returned.local in scope.bindings:
                    for one in self._of_name(scope, returned.local, name):
                        yield replace(one, called=name, function=returned.function)

    def _with_locals(self, given: list[_Given]) -> list[_Given]:
        """Add what functions assign and do not return, where nothing else gives the quantity."""
        known = {one.target.quantity for one in given}
        found = []
        for scope in self.program.functions:
            returned = {one.local for one in scope.returned}
            for name in scope.bindings:
                if name in returned or name == RETURNED:
                    continue
                for one in self._of_name(scope, name, name):
                    if one.target.quantity in known:
                        continue
                    function = scope.returned[0].function if scope.returned else ""
                    if not one.reason and self._is_changed_on_return(scope, name, one.target.quantity):
                        reason = f"{function} returns something else that it makes of {name}, which {one.line} assigns"
                        one = replace(one, node=None, reason=reason)
                    found.append(replace(one, called=name, function=f"{function} "))
        told: set[str] = set()
        for one in found:
            if one.target.quantity not in told and not one.reason:
                told.add(one.target.quantity)
                self.notes.append(f"{one.line}: {one.name} is a local name of a function, which does not return it")
        return [*given, *found]

    def _is_changed_on_return(self, scope: Scope, name: str, quantity: str) -> bool:
        """Whether what a function returns is made of a local name and of no other quantity: -G, G*sign."""
        waiting = [x for r in scope.returned for x in (r.names or (r.local,))]
        seen: set[str] = set()
        is_made_of = False
        while waiting:
            used = waiting.pop()
            if used in seen:
                continue
            seen.add(used)
            if used == name:
                is_made_of = True
                continue
            other = self.quantities.quantity(used) or next((t.quantity for t in self.quantities.entries(used)), "")
            is_known = self.names.is_vector(used) or self.names.find(used) is not None
            is_other = (bool(other) and other != quantity) or is_known
            if is_other and not self.quantities.is_parameter(used) and used != "t":
                return False
            for binding in scope.bindings.get(used, ()):
                if isinstance(binding.value, Formula):
                    waiting += re.findall(r"[A-Za-z_]\w*", binding.value.text)
        return is_made_of

    def _without_rebound(self, given: list[_Given]) -> list[_Given]:
        """Refuse what functions give where the program binds the function, or the quantity, to something else."""
        main = self.program.main
        understood = {one.name for one in given if not one.function}
        for one in given:
            if one.called in (one.function, WRITTEN_BY_DHKIT.get(one.function)):
                understood.add(one.function)
        kept = []
        for one in given:
            function = one.function.strip()
            reason = ""
            if one.function and not one.reason:
                standing = self.names.standing(main, function) if function in main.bindings else Standing()
                names = [name for name in main.bindings if self._is_rival(name, one)]
                rival = next((x for x in names if x not in understood and not self._is_plain_call(x, function)), "")
                if standing.wrong:
                    reason = standing.wrong
                elif rival:
                    line = main.bindings[rival][-1].line
                    reason = f"{rival} is bound in {line} to what is not read"
            if one.is_named_entry and not one.function and not one.reason:
                whole = next((x for x in main.bindings if x not in understood and self._is_made_of(x, one)), "")
                if whole:
                    reason = (
                        f"{whole} is made of {one.name} in {main.bindings[whole][-1].line}, in a way that is not read"
                    )
            kept.append(replace(one, node=None, reason=reason) if reason else one)
        return kept

    def _is_rival(self, name: str, one: _Given) -> bool:
        """Whether a name of the program is that of a quantity that a function gives."""
        bindings = self.program.main.bindings[name]
        if all(isinstance(b.value, NotUnderstood) and b.value.only_matrices for b in bindings):
            return False
        quantity = self.quantities.quantity(name)
        is_same = quantity == one.target.quantity and not self.quantities.is_alias(name)
        if name not in (one.called, one.name) and not is_same:
            return False
        if self.quantities.is_parameter(name):
            standing = self.names.standing(self.program.main, name)
            return bool(standing.wrong) or not standing.is_itself
        return True

    def _is_made_of(self, name: str, one: _Given) -> bool:
        """Whether a name of the program is that of a whole quantity that is made of an entry of it: G = -[G1, G2]."""
        if self.quantities.quantity(name) != one.target.quantity or self.quantities.is_parameter(name):
            return False
        texts = [b.value.text for b in self.program.main.bindings[name] if isinstance(b.value, Formula)]
        return any(one.name in re.findall(r"[A-Za-z_]\w*", text) for text in texts)

    def _is_plain_call(self, name: str, function: str) -> bool:
        """Whether a name is bound to a call of the function that gives the quantity, with its own arguments."""
        main = self.program.main
        scope = next((s for s in self.program.functions if any(r.function == function for r in s.returned)), None)
        bindings = _whole_bindings(main, name)
        if scope is None or len(bindings) != 1 or not isinstance(bindings[0].value, Formula):
            return False
        match = CALL.fullmatch(bindings[0].value.text)
        if match is None or match[1] != function:
            return False
        formal = [
            x
            for x, bound in scope.bindings.items()
            if isinstance(bound[0].value, Symbol) and bound[0].value.is_argument
        ]
        actual = [x.strip() for x in match[2].split(",")] if match[2].strip() else []
        if any(b.value != FunctionNamed("") for b in _whole_bindings(main, function)) or len(actual) > len(formal):
            return False
        for argument, own in zip(actual, formal, strict=False):
            is_number = re.fullmatch(r"[\d.]+", argument) is not None
            if is_number and not self.quantities.is_parameter(own):
                continue
            if argument != own:
                return False
            if _whole_bindings(main, argument) and not self._is_state_or_numbers(argument):
                return False
        return True

    def _is_state_or_numbers(self, name: str) -> bool:
        """Whether a name of the program is what the notation says, or numbers for joint variables."""
        standing = self.names.standing(self.program.main, name)
        if standing.is_itself and not standing.wrong and standing.defined is None:
            return True
        values = [b.value for b in _whole_bindings(self.program.main, name)]
        if self.quantities.is_parameter(name) or len(values) != 1 or not isinstance(values[0], Formula):
            return False
        entries = (values[0].entries or {(): values[0]}).values()
        return all(entry.number is not None for entry in entries)

    def _of_name(self, scope: Scope, name: str, called: str) -> Iterable[_Given]:
        """Return what a name gives that is called as a quantity or an entry is."""
        quantity = self.quantities.quantity(called)
        entries = [] if quantity else self.quantities.entries(called)
        if not quantity and not entries:
            return
        bindings = scope.bindings[name]
        formulas = [b for b in bindings if b.index is None and isinstance(b.value, Formula)]
        standing = self.names.standing(scope, name)
        if quantity:
            yield from self._whole_or_parts(scope, name, called, quantity, standing, formulas)
            return
        is_scalar = [b for b in formulas if isinstance(b.value, Formula) and not b.value.is_matrix]
        not_read = [b for b in bindings if isinstance(b.value, NotUnderstood) and not b.value.only_matrices]
        if not is_scalar or any(b.index is not None for b in bindings):
            return
        if len(entries) > 1:
            readings = " or ".join(map(str, entries))
            for target in entries:
                reason = f"{called} in {is_scalar[0].line} may be {readings}; write it with a comma or an underscore"
                yield _Given(Target(target.quantity), is_scalar[0].line, reason=reason, name=name)
            return
        if standing.is_itself and not standing.wrong:
            return
        yield self._node(scope, name, entries[0], standing, is_scalar[0], bool(not_read))

    def _node(
        self, scope: Scope, name: str, target: Target, standing: Standing, binding: Binding, changed: bool
    ) -> _Given:
        reason = standing.wrong
        node = None if reason else self._node_of(scope, name, binding)
        return _Given(target, binding.line, node, reason, is_named_entry=True, name=name)

    def _node_of(self, scope: Scope, name: str, binding: Binding) -> Node:
        assert isinstance(binding.value, Formula)  # noqa: S101
        return Node(name, None, scope, ((binding.value, binding.place),), binding.line)

    def _whole_or_parts(
        self, scope: Scope, name: str, called: str, quantity: str, standing: Standing, formulas: list[Binding]
    ) -> Iterable[_Given]:
        bindings = scope.bindings[name]
        alias = self.quantities.is_alias(called)
        parts = [b for b in bindings if b.index is not None]
        fitting = [b for b in formulas if self._fits(quantity, called, b.value, alias)]
        broken = [b for b in bindings if isinstance(b.value, NotUnderstood) and not b.value.only_matrices]
        if standing.wrong:
            certain = not alias and quantity in ("M", "C", "h", "tau", "K", "V", "L")
            certain = certain and not self.quantities.is_parameter(called)
            if fitting or parts or (broken and certain):
                line = bindings[0].line
                yield _Given(Target(quantity), line, reason=standing.wrong, is_alias=alias, name=name)
            return
        if parts:
            yield from self._parts(scope, name, quantity, standing, alias)
            return
        if fitting and standing.defined is not None:
            binding = self._followed(scope, standing.defined)
            node = self._node_of(scope, name, standing.defined)
            if binding is not None:
                node = self._node_of(*binding)
            if isinstance(standing.defined.value, Formula) and standing.defined.value.is_zeros:
                zeros = Formula(self._zeros(self.quantities.shape(quantity)))
                node = Node(name, None, scope, ((zeros, standing.defined.place),), standing.defined.line)
            yield _Given(Target(quantity), standing.defined.line, node, is_alias=alias, name=name)
        elif standing.defined is not None:
            follow = self._followed(scope, standing.defined)
            if follow is not None and not self.quantities.is_scalar(quantity):
                yield _Given(Target(quantity), standing.defined.line, self._node_of(*follow), is_alias=alias, name=name)
                return
            value = standing.defined.value
            text = value.text if isinstance(value, Formula) else ""
            if isinstance(value, Formula) and (quantity not in ("T", "L") or value.problem):
                why = f" ({value.problem})" if value.problem else ""
                self.left_out.append(f"{standing.defined.line}: {called} = {text[:60]}{why}")

    def _fits(self, quantity: str, called: str, value: object, alias: bool) -> bool:
        """Whether a formula may be a quantity: a matrix or a vector of a matrix, no number of an energy."""
        if not isinstance(value, Formula):
            return False
        if self.quantities.is_scalar(quantity) and not value.is_matrix:
            is_number = value.number is not None
            is_other = is_number and (alias or quantity in ("K", "L"))
            return not self.quantities.is_parameter(called) and not is_other
        if quantity in ("K", "V", "L"):
            return value.entries is not None and len(value.entries) == 1
        return value.is_matrix

    def _zeros(self, shape: tuple[int, ...]) -> str:
        return "[" + ", ".join([self._zeros(shape[1:])] * shape[0]) + "]" if shape else "0"

    def _followed(self, scope: Scope, binding: Binding) -> tuple[Scope, str, Binding] | None:
        """Return the matrix that a name is another name of: M = mass."""
        for _ in range(10):
            value = binding.value
            if not isinstance(value, Formula) or value.is_matrix or len(value.reads) != 1:
                return None
            read = value.reads[0]
            owner = scope.owner(read.name)
            if (read.start, read.end) != (0, len(value.text)) or read.index is not None or read.use is not Use.VALUE:
                return None
            if owner is None or read.member:
                return None
            standing = self.names.standing(owner, read.name)
            if standing.wrong or standing.defined is None or standing.defined.place >= binding.place:
                return None
            if isinstance(standing.defined.value, Formula) and standing.defined.value.entries is not None:
                return owner, read.name, standing.defined
            scope, binding = owner, standing.defined
        return None

    def _parts(self, scope: Scope, name: str, quantity: str, standing: Standing, alias: bool) -> Iterable[_Given]:
        if standing.has_zeros:
            self.zeros.add(quantity)
        for index, bindings in standing.entries.items():
            inside = self.quantities.index_in(quantity, index)
            line = bindings[0].line
            if inside is None:
                if len(standing.entries) > 1 or not alias:
                    shown = ", ".join(str(k + 1) for k in index)
                    reason = f"{name} has no entry ({shown}), which {line} assigns"
                    yield _Given(Target(quantity), line, reason=reason, is_alias=alias, name=name)
                continue
            pieces = tuple((b.value, b.place) for b in bindings if isinstance(b.value, Formula))
            node = Node(name, index, scope, pieces, line)
            target = Target(quantity, inside)
            if not self.quantities.shape(quantity):
                target = Target(quantity)
            yield _Given(target, line, node, is_alias=alias, name=name)

    def _without_aliases(self, given: list[_Given]) -> list[_Given]:
        """Leave aliases out where the quantity goes by its own name too."""
        own = {one.target.quantity for one in given if not one.is_alias and not one.is_named_entry}
        kept = []
        for one in given:
            if one.is_alias and one.target.quantity in own:
                self.left_out.append(
                    f"{one.line}: {one.name} (read as a name, since {one.target.quantity} is given too)"
                )
                continue
            if one.is_alias and f"{one.name}" not in self._noted():
                self.notes.append(f"{one.line}: {one.name} is read as {one.target.quantity}")
            kept.append(one)
        return kept

    def _noted(self) -> set[str]:
        return {note.split(": ")[-1].split(" is read as")[0] for note in self.notes}

    # One quantity

    def _answer(self, quantity: str, own: list[_Given], given: list[_Given]) -> str | Entries | Refusal | None:
        whole = [one for one in own if one.target.index is None]
        entries = [one for one in own if one.target.index is not None]
        if refused := next((one for one in whole if one.reason), None):
            return Refusal(refused.reason)
        if whole:
            return self._whole(quantity, whole, entries)
        entries = [one for one in entries if not self._is_part_of_others(one, given)]
        return self._entries(quantity, entries) if entries else None

    def _whole(self, quantity: str, whole: list[_Given], entries: list[_Given]) -> str | Refusal:
        texts = [self.definitions.text_of(one.node) for one in whole if one.node is not None]
        if any(text != texts[0] for text in texts):
            return Refusal(f"{quantity} is assigned twice, in {whole[0].line} and in {whole[-1].line}")
        node = whole[0].node
        closure = self.definitions.closure(node) if node is not None else frozenset()
        read = {(scope, name) for scope, name, _ in closure}
        for one in entries:
            if one.node is None:
                return Refusal(one.reason)
            _, text_reads = self.definitions.text_of(one.node), self.definitions.closure(one.node)
            is_part = (id(one.node.scope), one.node.name) in read
            comes_from = any(node is not None and key[:2] == (id(node.scope), node.name) for key in text_reads)
            if not is_part and not comes_from:
                return Refusal(f"{quantity} is given in {whole[0].line} and its entry {one.name} apart, in {one.line}")
        return texts[0]

    def _is_part_of_others(self, one: _Given, given: list[_Given]) -> bool:
        """Whether a name is rather a height or a transform that an energy is made of than an entry of h, T, J or A."""
        if not one.is_named_entry or one.target.quantity in ("M", "C", "g", "tau") or one.node is None:
            return False
        key = (id(one.node.scope), one.node.name)
        for other in given:
            if other.target.quantity not in ("K", "V", "L") or other.node is None:
                continue
            if any(used[:2] == key for used in self.definitions.closure(other.node)):
                user = other.target.quantity
                self.notes.append(f"{one.line}: {one.name} is read as the program's own name, which {user} uses")
                return True
        return False

    def _entries(self, quantity: str, entries: list[_Given]) -> Entries | Refusal:
        texts: dict[tuple[int, ...], str | Chain | Refusal] = {}
        lines: dict[tuple[int, ...], str] = {}
        for one in entries:
            index = one.target.index
            assert index is not None  # noqa: S101
            text = self.definitions.text_of(one.node) if one.node is not None else Refusal(one.reason)
            if texts.setdefault(index, text) != text:
                return Refusal(f"{one.target} is assigned twice, in {lines[index]} and in {one.line}")
            lines.setdefault(index, one.line)
        if quantity in self.zeros:
            for index in self._all_places(quantity):
                texts.setdefault(index, "0")
        return Entries(dict(sorted(texts.items())))

    def _all_places(self, quantity: str) -> list[tuple[int, ...]]:
        places: list[tuple[int, ...]] = [()]
        for length in self.quantities.shape(quantity):
            places = [(*place, k) for place in places for k in range(length)]
        return places


def _whole_bindings(scope: Scope, name: str) -> list[Binding]:
    """Return what binds a name, without calls that may change a matrix that it stands for."""
    return [
        b for b in scope.bindings.get(name, ()) if not (isinstance(b.value, NotUnderstood) and b.value.only_matrices)
    ]
