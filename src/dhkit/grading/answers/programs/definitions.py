"""From the formulas of a program to texts: every name in them known, or one of the definitions that go with them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    STRUCTURE,
    Binding,
    Formula,
    FunctionNamed,
    ModuleNamed,
    Read,
    Scope,
    Symbol,
    Use,
)
from dhkit.grading.answers.programs.standing import TOLERANCE, NameTable, Standing
from dhkit.grading.answers.rewriting import DERIVATIVES, MODULES
from dhkit.grading.answers.sheet import Refusal
from dhkit.grading.answers.tokens import MAX_LENGTH
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

MAX_DEFINITIONS = 2_000
"""Names that answers of one file may be made of; reading each takes about a millisecond."""
WORDS = frozenset(("t", "T", "top", "pi", "e", "Matrix", "array", "matrix", "sym", "simplify", "transpose", "DM", "SX"))
"""What the reader of formulas takes for something else than a name."""


@dataclass(frozen=True)
class Node:
    """A formula at its place, with what is added to it later.

    Attributes
    ----------
    name, index
        What it defines.
    scope
        Where its names are looked up.
    pieces
        Formulas whose sum it is, each with its place.
    line
        Of the first piece.
    """

    name: str
    index: tuple[int, ...] | None
    scope: Scope
    pieces: tuple[tuple[Formula, int], ...]
    line: str

    @property
    def key(self) -> tuple[int, str, tuple[int, ...] | None, int]:
        """What tells it from other nodes."""
        return id(self.scope), self.name, self.index, self.pieces[0][1]


@dataclass
class _Written:
    """A node's text, or why it has none."""

    text: str = ""
    reason: str = ""


class _NotReadError(Exception):
    """A name in a formula cannot be relied on."""


@dataclass
class Definitions:
    """The texts of one program's formulas.

    Attributes
    ----------
    names
        What names stand for.
    parameters
        Texts of definitions by the names that they go by, each after those that it needs.
    notes
        What a reader should know.
    """

    names: NameTable
    parameters: dict[str, str | Refusal] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _written: dict[tuple[int, str, tuple[int, ...] | None, int], _Written] = field(default_factory=dict)
    _called: dict[tuple[int, str, tuple[int, ...] | None, int], str] = field(default_factory=dict)
    _taken: dict[str, str] = field(default_factory=dict)
    _symbols: dict[tuple[str, ...], tuple[str, str]] = field(default_factory=dict)

    def text_of(self, node: Node) -> str | Refusal:
        """Return an answer's text; what it is made of goes to ``parameters``."""
        self._write(self._closure(node))
        written = self._written[node.key]
        return Refusal(written.reason) if written.reason else written.text

    def closure(self, node: Node) -> frozenset[tuple[int, str, tuple[int, ...] | None]]:
        """Return the names that a node's formula is made of, each with its scope and index."""
        return frozenset(other.key[:3] for other in self._closure(node))

    # Which formulas are needed

    def _closure(self, node: Node) -> list[Node]:
        """Return a node and what it needs, each after those that it needs: what is read was bound before."""
        found, waiting = {node.key: node}, [node]
        while waiting:
            for child in self._children(waiting.pop()):
                if child.key not in found:
                    found[child.key] = child
                    waiting.append(child)
            if len(found) > MAX_DEFINITIONS:
                raise AnswerError(f"an answer is made of more than {MAX_DEFINITIONS} names")
        return sorted(found.values(), key=lambda n: (n.scope.outer is not None, max(place for _, place in n.pieces)))

    def _children(self, node: Node) -> Iterable[Node]:
        for formula, place in node.pieces:
            for read in formula.reads:
                try:
                    child = self._meaning(node.scope, read, place)
                except _NotReadError:
                    continue
                if isinstance(child, Node):
                    yield child

    # Texts

    def _write(self, nodes: Sequence[Node]) -> None:
        for node in nodes:
            if node.key in self._written:
                continue
            try:
                written = self._text(node)
            except _NotReadError as error:
                written = _Written(reason=str(error))
            self._written[node.key] = written

    def _text(self, node: Node) -> _Written:
        texts = [self._piece(node, formula, place) for formula, place in node.pieces]
        text = texts[0] + "".join(f" + ({added})" for added in texts[1:])
        if len(text) > MAX_LENGTH:
            raise _NotReadError(f"{node.name} has {len(text)} characters in {node.line}; expected at most {MAX_LENGTH}")
        return _Written(text)

    def _piece(self, node: Node, formula: Formula, place: int) -> str:
        if formula.problem:
            raise _NotReadError(f"{node.line}: {formula.problem}")
        pieces: list[str] = []
        at = 0
        for read in sorted(formula.reads, key=lambda read: (read.start, read.end)):
            meaning = self._meaning(node.scope, read, place)
            if isinstance(meaning, Node):
                meaning = self._name_of(meaning)
            if meaning is not None and read.end == read.start and read.use is Use.VALUE:
                raise _NotReadError(f"{node.line}: {read.name} is the program's own name, of which no rate is read")
            if meaning is not None and read.end > read.start:
                pieces += [formula.text[at : read.start], meaning]
                at = read.end
        return "".join([*pieces, formula.text[at:]])

    def _name_of(self, node: Node) -> str:
        """Return the name that a definition goes by: its own where that is free."""
        if node.key in self._called:
            return self._called[node.key]
        written = self._written[node.key]
        if written.reason:
            raise _NotReadError(written.reason)
        if re.fullmatch(r"[\d.]+", written.text):
            name = written.text  # a number stays a number: q(k) with k = 1 is no product
        else:
            name = self._free_name(node, written.text)
            if plain_name(name) not in self._taken:
                self._taken[plain_name(name)] = written.text
                self.parameters[name] = written.text
            if len(self.parameters) > MAX_DEFINITIONS:
                raise AnswerError(f"answers are made of more than {MAX_DEFINITIONS} names")
        self._called[node.key] = name
        return name

    def _free_name(self, node: Node, text: str) -> str:
        base = node.name + "".join(f"_{k + 1}" for k in node.index or ())
        if self._is_free(base, text) and (node.index is None or not self.names.vocabulary.knows(base)):
            return base
        letters = re.sub(r"[\W_]", "", base, flags=re.ASCII) or "x"
        line = re.sub(r"\W", "", node.line, flags=re.ASCII)
        name = f"x{letters}" if not letters[0].isalpha() else letters
        name = f"{name}_{line}"
        while not self._is_free(name, text):
            name += "x"
        return name

    def _is_free(self, name: str, text: str) -> bool:
        plain, vocabulary = plain_name(name), self.names.vocabulary
        special = name in FUNCTION_NAMES or name in WORDS or name in MODULES or name in DERIVATIVES
        proper = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) is not None
        known = vocabulary.is_state(plain) or self.names.quantities.is_parameter(name)
        return proper and not special and not known and self._taken.get(plain, text) == text

    # Names

    def _meaning(self, scope: Scope, read: Read, place: int) -> Node | str | None:
        """Return what stands for a name that is read: a definition, another text, or nothing else than was typed.

        Raises
        ------
        _NotReadError
            The name cannot be relied on.
        """
        owner = scope.owner(read.name)
        standing = self.names.standing(owner, read.name) if owner is not None else Standing(is_itself=True)
        if standing.wrong:
            raise _NotReadError(standing.wrong)
        if read.use in (Use.CALL, Use.MODULE):
            return self._called_name(read, standing, bound=owner is not None)
        if standing.library is not None and not (read.member and standing.library == ModuleNamed(STRUCTURE)):
            raise _NotReadError(self._is_function(read.name))
        if read.use is Use.TIME:
            if standing.defined is not None or standing.entries:
                raise _NotReadError(f"{read.name} is not the time")
            return None
        if read.member:
            return self._member(scope, owner, read, standing)
        if standing.note and standing.note not in self.notes:
            self.notes.append(standing.note)
        if standing.defined is not None and not (standing.is_itself and place <= standing.defined.place):
            assert owner is not None  # noqa: S101
            return self._definition(owner, scope, read, place, standing.defined)
        entries = [binding.place for bindings in standing.entries.values() for binding in bindings]
        if entries and standing.is_itself and read.index is None and owner is scope and place > min(entries):
            raise _NotReadError(
                f"{read.name} is used behind {next(iter(standing.entries.values()))[0].line}, as a vector"
            )
        if standing.entries and (read.index is not None or not standing.is_itself):
            assert owner is not None  # noqa: S101
            return self._entry(owner, scope, read, place, standing)
        return self._itself(scope, owner, read)

    def _is_function(self, name: str) -> str:
        if not self.names.quantities.is_parameter(name):
            return f"{name} is a function or a module"
        quantity = self.names.quantities.quantity(name)
        return f"{name} is the robot's parameter; name the function {name.upper() if quantity else 'otherwise'}"

    def _called_name(self, read: Read, standing: Standing, bound: bool) -> str | None:
        if read.use is Use.MODULE:
            if not isinstance(standing.library, ModuleNamed) and (bound or read.name not in MODULES):
                raise _NotReadError(f"{read.name} is no module that is imported")
            return None
        if not bound:
            if read.name in FUNCTION_NAMES or read.start == read.end or read.name in DERIVATIVES:
                return None
            raise _NotReadError(f"{read.name}(...) is not read")
        if not isinstance(standing.library, FunctionNamed):
            raise _NotReadError(f"{read.name}(...) is called, and {read.name} is no function of a library")
        function = standing.library.name
        if not function:
            raise _NotReadError(f"{read.name}(...) is a function of this file, which is not read where it is called")
        if read.start == read.end:
            if function != read.name:
                raise _NotReadError(f"{read.name} is {function}")
            return None
        if FUNCTION_NAMES.get(function) is None:
            raise _NotReadError(f"{function or read.name}(...) is not read")
        return None if FUNCTION_NAMES.get(read.name) == FUNCTION_NAMES[function] else function

    def _member(self, scope: Scope, owner: Scope | None, read: Read, standing: Standing) -> str:
        if owner is None or standing.defined is not None or standing.entries:
            raise _NotReadError(f"{read.name}.{read.member} is not read")
        parameters = self.names.quantities.parameters
        meant = parameters.get(plain_name(read.member), "")
        if not meant:
            cleaned = {re.sub(r"\W", "_", name, flags=re.ASCII): name for name in parameters.values()}
            meant = cleaned.get(read.member, "")
        if not meant:
            raise _NotReadError(f"{read.name}.{read.member[:40]} is no parameter of the robot")
        field_name = f"{read.name}.{read.member}"
        holder = scope.owner(field_name)
        for binding in holder.bindings[field_name] if holder is not None else ():
            number = binding.value.number if isinstance(binding.value, Formula) else None
            value = self.names.values.get(meant)
            if number is None or value is None or abs(value - number) > TOLERANCE * abs(value):
                raise _NotReadError(f"{field_name} is set in {binding.line} to another value than {value}")
        return plain_name(meant)

    def _definition(self, owner: Scope, scope: Scope, read: Read, place: int, binding: Binding) -> Node | str:
        if owner is scope and place <= binding.place:
            raise _NotReadError(f"{read.name} is used before it is assigned, in {binding.line}")
        formula = binding.value
        if not isinstance(formula, Formula):
            raise _NotReadError(f"{read.name} is not read, in {binding.line}")
        if read.index is None:
            if formula.is_matrix:
                raise _NotReadError(f"{read.name} is the matrix of {binding.line}; write out its entries")
            return Node(read.name, None, owner, ((formula, binding.place),), binding.line)
        entries = formula.entries or {}
        index = read.index
        choices = [index] if len(index) > 1 else [index, (*index, 0), (0, *index)]
        entry = next((entries[choice] for choice in choices if choice in entries), None)
        if entry is None or (len(index) == 1 and len({i for i, *_ in entries}) > 1 and (0, 1) in entries):
            raise _NotReadError(f"an entry of {read.name} is read that {binding.line} does not assign")
        if not entry.reads and re.fullmatch(r"[A-Za-z]\w*|[\d.]+", entry.text):
            return entry.text
        return Node(read.name, index, owner, ((entry, binding.place),), binding.line)

    def _entry(self, owner: Scope, scope: Scope, read: Read, place: int, standing: Standing) -> Node | str:
        if read.index is None:
            raise _NotReadError(f"{read.name} is assigned entry by entry; write out its entries")
        index = read.index
        choices = [index] if len(index) > 1 else [index, (*index, 0)]
        choices += [index[:1]] if index[1:] == (0,) else []
        bindings = next((standing.entries[choice] for choice in choices if choice in standing.entries), None)
        if bindings is None:
            if standing.has_zeros:
                return "0"
            raise _NotReadError(f"an entry of {read.name} is read that is not assigned")
        if owner is scope and place <= bindings[-1].place:
            raise _NotReadError(f"{read.name} is used before it is assigned, in {bindings[-1].line}")
        pieces = tuple((b.value, b.place) for b in bindings if isinstance(b.value, Formula))
        return Node(read.name, bindings[0].index, owner, pieces, bindings[0].line)

    def _itself(self, scope: Scope, owner: Scope | None, read: Read) -> str | None:
        """Return what stands for a name that the notation has to know."""
        names, plain = self.names, plain_name(read.name)
        outside = owner.outer.bindings.get(read.name, []) if owner is not None and owner.outer is not None else []
        is_symbol = owner is not None and any(isinstance(b.value, Symbol) for b in owner.bindings[read.name])
        if not is_symbol and any(b.value == FunctionNamed("") for b in outside):
            raise _NotReadError(self._is_function(read.name))
        if read.index is not None:
            position = names.position(read.index)
            if position is None or not names.vocabulary.knows(f"{plain}{position + 1}"):
                raise _NotReadError(f"an entry of {read.name} is read, which is no vector of the robot's")
            self._check_free(scope, f"{plain}{position + 1}")
            return f"{plain}{position + 1}"
        if not names.vocabulary.knows(read.name):
            if owner is not None or names.vocabulary.split(plain) is None:
                raise _NotReadError(f"unknown name {read.name[:40]!r} ({names.vocabulary.nearest(read.name[:60])})")
            inside = next((bound for bound in self._bound(scope) if len(bound) < len(plain) and bound in plain), "")
            if inside:
                raise _NotReadError(f"unknown name {read.name[:40]!r}, which is no product: {inside} is the program's")
        self._check_free(scope, read.name)
        if owner is not None:
            self._check_symbol(owner, read.name)
        return None

    @staticmethod
    def _bound(scope: Scope) -> list[str]:
        return [*scope.bindings, *(scope.outer.bindings if scope.outer is not None else ())]

    def _check_free(self, scope: Scope, name: str) -> None:
        """Refuse c1 where the program makes something else of q1."""
        for word in self.names.find(name) or ():
            owner = scope.owner(word) if word[0].isalpha() and word != name else None
            if owner is None or word in FUNCTION_NAMES:
                continue
            standing = self.names.standing(owner, word)
            if standing.wrong or not (standing.is_itself or standing.library):
                raise _NotReadError(standing.wrong or f"{name} would be read as {word}, which the program assigns")

    def _check_symbol(self, owner: Scope, name: str) -> None:
        """Refuse two symbols that the notation takes for one thing: m1 and M1."""
        meaning = self.names.find(name)
        is_symbol = any(isinstance(b.value, Symbol) and not b.value.is_argument for b in owner.bindings[name])
        if meaning is None or not is_symbol:
            return
        line = owner.bindings[name][0].line
        known, known_line = self._symbols.setdefault((str(id(owner)), *meaning), (plain_name(name), line))
        if known != plain_name(name):
            raise _NotReadError(f"{known} ({known_line}) and {name} ({line}) would both be read as {''.join(meaning)}")
