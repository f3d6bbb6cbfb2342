"""Texts of a program's formulas: every name in them is known, or one of the definitions that go with them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from dhkit.errors import AnswerError
from dhkit.grading.answers.programs.bindings import (
    Binding,
    Formula,
    Index,
    LibraryFunction,
    Module,
    OwnFunction,
    Read,
    Scope,
    Structure,
    Symbol,
    Use,
)
from dhkit.grading.answers.programs.name_resolution import (
    NameResolver,
    Resolution,
    UnreliableError,
    is_same_number,
    vector_place,
)
from dhkit.grading.answers.rewriting import DERIVATIVES, MODULES
from dhkit.grading.answers.sheet_values import Refusal
from dhkit.grading.answers.tokens import MAX_LENGTH, word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

MAX_DEFINITIONS = 2_000
"""Largest number of names that the answers of one file are made of; reading each takes about a millisecond."""

NOT_NAMES = word_set("t T top pi e Matrix array matrix sym simplify transpose DM SX")
"""Words that the reader of formulas takes for something else than a name."""

DefinitionKey: TypeAlias = tuple[int, str, Index | None, int]
"""Identity of a scope, name, index and order of the first term."""


@dataclass(frozen=True)
class Definition:
    """A formula that defines a name or an entry, with what the program adds to it later.

    Attributes
    ----------
    name, index
        What it defines; the index from 0, None for the whole name.
    scope
        Where the names in its formulas are looked up.
    terms
        Formulas whose sum it is, each with its order in the program.
    line
        Line of the first term.
    """

    name: str
    index: Index | None
    scope: Scope
    terms: tuple[tuple[Formula, int], ...]
    line: str

    @property
    def key(self) -> DefinitionKey:
        """What tells it from other definitions."""
        return id(self.scope), self.name, self.index, self.terms[0][1]


@dataclass
class Definitions:
    """The texts of one program's formulas.

    Attributes
    ----------
    names
        Meanings of the program's names.
    parameters
        Texts of definitions by the names that they go by, each after those that it needs.
    notes
        What a reader should know.
    """

    names: NameResolver
    parameters: dict[str, str | Refusal] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _texts: dict[DefinitionKey, str | Refusal] = field(default_factory=dict)
    _closures: dict[DefinitionKey, frozenset[tuple[int, str, Index | None]]] = field(default_factory=dict)
    _names_given: dict[DefinitionKey, str] = field(default_factory=dict)
    _texts_by_name: dict[str, str] = field(default_factory=dict)
    _symbols: dict[tuple[str, ...], tuple[str, str]] = field(default_factory=dict)

    def text_of(self, definition: Definition) -> str | Refusal:
        """Return an answer's text; what it is made of goes to ``parameters``."""
        for needed in self._closure(definition):
            if needed.key not in self._texts:
                try:
                    self._texts[needed.key] = self._text(needed)
                except UnreliableError as error:
                    self._texts[needed.key] = Refusal(str(error))
        return self._texts[definition.key]

    def closure(self, definition: Definition) -> frozenset[tuple[int, str, Index | None]]:
        """Return the names that a formula is made of, each with the identity of its scope and its index."""
        if definition.key not in self._closures:
            self._closures[definition.key] = frozenset(needed.key[:3] for needed in self._closure(definition))
        return self._closures[definition.key]

    def _closure(self, definition: Definition) -> Sequence[Definition]:
        """Return a definition and all that it needs, each after those that it needs: what is read was bound before."""
        needed, waiting = {definition.key: definition}, [definition]
        while waiting:
            for read in self._definitions_read(waiting.pop()):
                if read.key not in needed:
                    needed[read.key] = read
                    waiting.append(read)
            if len(needed) > MAX_DEFINITIONS:
                raise AnswerError(f"an answer is made of more than {MAX_DEFINITIONS} names")
        return sorted(needed.values(), key=lambda d: (d.scope.outer is not None, max(order for _, order in d.terms)))

    def _definitions_read(self, definition: Definition) -> Iterable[Definition]:
        for formula, order in definition.terms:
            for read in formula.reads:
                try:
                    meaning = self._meaning(definition.scope, read, order)
                except UnreliableError:
                    continue
                if isinstance(meaning, Definition):
                    yield meaning

    # Texts

    def _text(self, definition: Definition) -> str:
        texts = [self._term_text(definition, formula, order) for formula, order in definition.terms]
        text = texts[0] + "".join(f" + ({added})" for added in texts[1:])
        if len(text) > MAX_LENGTH:
            raise UnreliableError(
                f"{definition.name} has {len(text)} characters in {definition.line}; expected at most {MAX_LENGTH}"
            )
        return text

    def _term_text(self, definition: Definition, formula: Formula, order: int) -> str:
        if formula.problem:
            raise UnreliableError(f"{definition.line}: {formula.problem}")
        pieces: list[str] = []
        at = 0
        for read in sorted(formula.reads, key=lambda read: (read.start, read.end)):
            meaning = self._meaning(definition.scope, read, order)
            if isinstance(meaning, Definition):
                meaning = self._name_of(meaning)
            if meaning is not None and read.end == read.start and read.use is Use.VALUE:
                raise UnreliableError(
                    f"{definition.line}: {read.name} is the program's own name, of which no rate is read"
                )
            if meaning is not None and read.end > read.start:
                pieces += [formula.text[at : read.start], meaning]
                at = read.end
        return "".join([*pieces, formula.text[at:]])

    def _name_of(self, definition: Definition) -> str:
        """Return the name that a definition goes by: its own where that is free; a number stands for itself."""
        if definition.key in self._names_given:
            return self._names_given[definition.key]
        text = self._texts[definition.key]
        if isinstance(text, Refusal):
            raise UnreliableError(text.reason)
        if re.fullmatch(r"[\d.]+", text):
            name = text  # q(k) with k = 1 is q(1), and no product
        else:
            name = self._free_name(definition, text)
            if plain_name(name) not in self._texts_by_name:
                self._texts_by_name[plain_name(name)] = self.parameters[name] = text
            if len(self.parameters) > MAX_DEFINITIONS:
                raise AnswerError(f"answers are made of more than {MAX_DEFINITIONS} names")
        self._names_given[definition.key] = name
        return name

    def _free_name(self, definition: Definition, text: str) -> str:
        base = definition.name + "".join(f"_{k + 1}" for k in definition.index or ())
        if self._is_free(base, text) and (definition.index is None or not self.names.vocabulary.knows(base)):
            return base
        letters = re.sub(r"[\W_]", "", base, flags=re.ASCII) or "x"
        line = re.sub(r"\W", "", definition.line, flags=re.ASCII)
        name = f"{'' if letters[0].isalpha() else 'x'}{letters}_{line}"
        while not self._is_free(name, text):
            name += "x"
        return name

    def _is_free(self, name: str, text: str) -> bool:
        plain = plain_name(name)
        is_special = name in FUNCTION_NAMES or name in NOT_NAMES or name in MODULES or name in DERIVATIVES
        is_known = self.names.vocabulary.is_state(plain) or self.names.quantities.is_parameter(name)
        is_name = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) is not None
        return is_name and not is_special and not is_known and self._texts_by_name.get(plain, text) == text

    # Names

    def _meaning(self, scope: Scope, read: Read, order: int) -> Definition | str | None:
        """Return what replaces a name in a formula: a definition, another text, or None where the name stays.

        Raises
        ------
        UnreliableError
            The name cannot be relied on.
        """
        owner = scope.owner(read.name)
        resolution = self.names.resolve(owner, read.name) if owner is not None else Resolution(has_usual_meaning=True)
        if resolution.problem:
            raise UnreliableError(resolution.problem)
        if read.use is Use.MODULE:
            if not isinstance(resolution.library_name, Module) and (owner is not None or read.name not in MODULES):
                raise UnreliableError(f"{read.name} is no module that is imported")
            return None
        if read.use is Use.CALL:
            return self._function_name(read, resolution, is_bound=owner is not None)
        is_field = bool(read.member) and resolution.library_name == Structure()
        if resolution.library_name is not None and not is_field:
            raise UnreliableError(self._is_function(read.name))
        if read.use is Use.TIME:
            if resolution.definition is not None or resolution.entries:
                raise UnreliableError(f"{read.name} is not the time")
            return None
        if read.member:
            return self._field(scope, owner, read, resolution)
        if resolution.note and resolution.note not in self.notes:
            self.notes.append(resolution.note)
        definition, entries = resolution.definition, resolution.entries
        is_before = definition is not None and resolution.has_usual_meaning and order <= definition.order
        if owner is not None and definition is not None and not is_before:
            return self._definition(owner, scope, read, order, definition)
        first_order = min((binding.order for bindings in entries.values() for binding in bindings), default=order)
        if resolution.has_usual_meaning and read.index is None and owner is scope and order > first_order:
            raise UnreliableError(f"{read.name} is used behind {next(iter(entries.values()))[0].line}, as a vector")
        if owner is not None and entries and (read.index is not None or not resolution.has_usual_meaning):
            return self._entry(owner, scope, read, order, resolution)
        return self._usual_name(scope, owner, read)

    def _is_function(self, name: str) -> str:
        if not self.names.quantities.is_parameter(name):
            return f"{name} is a function or a module"
        quantity = self.names.quantities.quantity(name)
        return f"{name} is the robot's parameter; name the function {name.upper() if quantity else 'otherwise'}"

    @staticmethod
    def _function_name(read: Read, resolution: Resolution, is_bound: bool) -> str | None:
        """Return the name of the library's function that is called; None where the call stays as it is typed."""
        if not is_bound:
            if read.name in FUNCTION_NAMES or read.start == read.end or read.name in DERIVATIVES:
                return None
            raise UnreliableError(f"{read.name}(...) is not read")
        if isinstance(resolution.library_name, OwnFunction):
            raise UnreliableError(f"{read.name}(...) is a function of this file, which is not read where it is called")
        if not isinstance(resolution.library_name, LibraryFunction):
            raise UnreliableError(f"{read.name}(...) is called, and {read.name} is no function of a library")
        function = resolution.library_name.name
        if read.start == read.end:
            if function != read.name:
                raise UnreliableError(f"{read.name} is {function}")
            return None
        if function not in FUNCTION_NAMES:
            raise UnreliableError(f"{function}(...) is not read")
        return None if FUNCTION_NAMES.get(read.name) == FUNCTION_NAMES[function] else function

    def _field(self, scope: Scope, owner: Scope | None, read: Read, resolution: Resolution) -> str:
        """Return the robot's parameter that a field of a structure is, such as p.m2."""
        if owner is None or resolution.definition is not None or resolution.entries:
            raise UnreliableError(f"{read.name}.{read.member} is not read")
        parameters = self.names.quantities.parameters
        cleaned = {re.sub(r"\W", "_", name, flags=re.ASCII): name for name in parameters.values()}
        parameter = parameters.get(plain_name(read.member)) or cleaned.get(read.member)
        if not parameter:
            raise UnreliableError(f"{read.name}.{read.member[:40]} is no parameter of the robot")
        field_name = f"{read.name}.{read.member}"
        holder = scope.owner(field_name)
        value = self.names.values.get(parameter)
        for binding in holder.bindings[field_name] if holder is not None else ():
            if binding.formula is None or not is_same_number(value, binding.formula.number):
                raise UnreliableError(f"{field_name} is set in {binding.line} to another value than {value}")
        return plain_name(parameter)

    @staticmethod
    def _definition(owner: Scope, scope: Scope, read: Read, order: int, binding: Binding) -> Definition | str:
        """Return the definition of a name that is bound to one formula, or of one entry of that formula."""
        if owner is scope and order <= binding.order:
            raise UnreliableError(f"{read.name} is used before it is assigned, in {binding.line}")
        formula = binding.formula
        if formula is None:
            raise UnreliableError(f"{read.name} is not read, in {binding.line}")
        if read.index is None:
            if formula.is_matrix:
                raise UnreliableError(f"{read.name} is the matrix of {binding.line}; write out its entries")
            return definition_of(owner, read.name, [binding])
        entries, index = formula.entries or {}, read.index
        choices = [index] if len(index) > 1 else [index, (*index, 0), (0, *index)]
        entry = next((entries[choice] for choice in choices if choice in entries), None)
        if entry is None or (len(index) == 1 and len({i for i, *_ in entries}) > 1 and (0, 1) in entries):
            raise UnreliableError(f"an entry of {read.name} is read that {binding.line} does not assign")
        if not entry.reads and re.fullmatch(r"[A-Za-z]\w*|[\d.]+", entry.text):
            return entry.text
        return Definition(read.name, index, owner, ((entry, binding.order),), binding.line)

    @staticmethod
    def _entry(owner: Scope, scope: Scope, read: Read, order: int, resolution: Resolution) -> Definition | str:
        """Return the definition of an entry that the program assigns by itself."""
        if read.index is None:
            raise UnreliableError(f"{read.name} is assigned entry by entry; write out its entries")
        index = read.index
        choices = [index] if len(index) > 1 else [index, (*index, 0)]
        choices += [index[:1]] if index[1:] == (0,) else []
        bindings = next((resolution.entries[choice] for choice in choices if choice in resolution.entries), None)
        if bindings is None:
            if resolution.has_zeros:
                return "0"
            raise UnreliableError(f"an entry of {read.name} is read that is not assigned")
        if owner is scope and order <= bindings[-1].order:
            raise UnreliableError(f"{read.name} is used before it is assigned, in {bindings[-1].line}")
        return definition_of(owner, read.name, bindings)

    def _usual_name(self, scope: Scope, owner: Scope | None, read: Read) -> str | None:
        """Return the name that the notation has for an entry of a vector; None for a name that stays as typed."""
        names, plain = self.names, plain_name(read.name)
        outside = owner.outer.bindings.get(read.name, []) if owner is not None and owner.outer is not None else []
        is_symbol = owner is not None and any(isinstance(b.value, Symbol) for b in owner.bindings[read.name])
        if not is_symbol and any(isinstance(b.value, OwnFunction) for b in outside):
            raise UnreliableError(self._is_function(read.name))
        if read.index is not None:
            place = vector_place(read.index)
            if place is None or not names.vocabulary.knows(f"{plain}{place + 1}"):
                raise UnreliableError(f"an entry of {read.name} is read, which is no vector of the robot's")
            self._refuse_reassigned_words(scope, f"{plain}{place + 1}")
            return f"{plain}{place + 1}"
        if not names.vocabulary.knows(read.name):
            if owner is not None or names.vocabulary.split(plain) is None:
                nearest = names.vocabulary.nearest(read.name[:60])
                raise UnreliableError(f"unknown name {read.name[:40]!r} ({nearest})")
            bound = [*scope.bindings, *(scope.outer.bindings if scope.outer is not None else ())]
            inside = next((name for name in bound if len(name) < len(plain) and name in plain), "")
            if inside:
                raise UnreliableError(
                    f"unknown name {read.name[:40]!r}, which is no product: {inside} is the program's"
                )
        self._refuse_reassigned_words(scope, read.name)
        if owner is not None:
            self._refuse_same_symbol(owner, read.name)
        return None

    def _refuse_reassigned_words(self, scope: Scope, name: str) -> None:
        """Refuse c1 where the program makes something else of q1."""
        for word in self.names.find(name) or ():
            owner = scope.owner(word) if word[0].isalpha() and word != name else None
            if owner is None or word in FUNCTION_NAMES:
                continue
            resolution = self.names.resolve(owner, word)
            if resolution.problem or not (resolution.has_usual_meaning or resolution.library_name):
                raise UnreliableError(
                    resolution.problem or f"{name} would be read as {word}, which the program assigns"
                )

    def _refuse_same_symbol(self, owner: Scope, name: str) -> None:
        """Refuse two symbols that the notation takes for one thing: m1 and M1."""
        meaning = self.names.find(name)
        is_symbol = any(isinstance(b.value, Symbol) and not b.is_argument for b in owner.bindings[name])
        if meaning is None or not is_symbol:
            return
        line = owner.bindings[name][0].line
        known, known_line = self._symbols.setdefault((str(id(owner)), *meaning), (plain_name(name), line))
        if known != plain_name(name):
            raise UnreliableError(
                f"{known} ({known_line}) and {name} ({line}) would both be read as {''.join(meaning)}"
            )


def definition_of(scope: Scope, name: str, bindings: Sequence[Binding]) -> Definition:
    """Return the definition of a name, or of an entry, by its assignment and what is added to it later."""
    terms = tuple((binding.formula, binding.order) for binding in bindings if binding.formula is not None)
    return Definition(name, bindings[0].index, scope, terms, bindings[0].line)
