"""Names of a program while it is read: each is bound once, and a value made of a name keeps that name.

An answer is judged only if every name that it is made of was bound once, to a value that is read, and was not changed
by anything else in the program, before or after.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.robot_names import RobotNames
from dhkit.grading.answers.programs.values import (
    Function,
    Given,
    Index,
    Level,
    Library,
    Matrix,
    Module,
    Part,
    Scalar,
    Several,
    Structure,
    Text,
    Unread,
    UnreadError,
    Value,
    entry_of,
    joined,
    vector_of,
)
from dhkit.grading.answers.rewriting import DERIVATIVES, MODULES
from dhkit.grading.answers.tokens import word_set
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Meaning, plain_name

_NOT_NAMES = word_set("t T top pi e Matrix array matrix sym simplify transpose DM SX")
"""Words that the reader of formulas takes for something else than a name."""


@dataclass(frozen=True)
class Binding:
    """Binding of a name.

    Attributes
    ----------
    value
        The value, as it was assigned.
    reference
        The value where the name is read: long formulas by their names.
    where
        The line in which it is bound, as messages name it.
    """

    value: Value
    reference: Value
    where: str


class Definition(NamedTuple):
    """Definition of a name that answers are made of, as it stands beside them."""

    name: str
    """The name there; another than the program's where that would be read as something else."""
    formula: Scalar
    """The formula that the name stands for."""


class StatePlace(NamedTuple):
    """Place of an entry of a state, such as x(1), in one call of a function."""

    call: int
    """Number of the call."""
    vector: str
    """Name of the state."""
    place: int
    """Index of the entry, from 0."""


class SymbolMade(NamedTuple):
    """A symbol that the program makes."""

    name: str
    """Its name in the program."""
    where: str
    """The line in which it is made, as messages name it."""


@dataclass
class Record:
    """Knowledge of a whole program, collected while it is read.

    Attributes
    ----------
    robot
        Names of the robot.
    power
        Sign of powers in the language.
    broken
        Names whose values are unknown, by key, each with the reason.
    definitions
        Definitions beside the answers, by the key of the name in the program.
    notes, left_out
        As in :class:`~dhkit.grading.answers.sheet_values.AnswerSheet`.
    """

    robot: RobotNames
    power: str
    broken: dict[str, str] = field(default_factory=dict)
    definitions: dict[str, Definition] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    scopes: int = 0
    calls: int = 0
    taken: dict[StatePlace, str] = field(default_factory=dict)
    """Joint variables that entries of states are."""
    symbols: dict[Meaning, SymbolMade] = field(default_factory=dict)
    """Symbols that the program makes, by meaning."""
    _texts: dict[str, str] = field(default_factory=dict)

    def note(self, text: str) -> None:
        """Add a note, once."""
        if text not in self.notes:
            self.notes.append(text)

    def argument(self, name: str) -> Given:
        """Return an argument of a function as itself, told from those of the same name of other functions."""
        self.calls += 1
        return Given(name, is_argument=True, number=self.calls)

    def note_left_out(self, text: str) -> None:
        """Note an answer that is not read, once."""
        if text not in self.left_out:
            self.left_out.append(text)

    def define(self, key: str, base: str, where: str, scalar: Scalar) -> Scalar:
        """Return a name for a formula, which is defined beside the answers; a number stands for itself."""
        known = frozenset((key,))
        if re.fullmatch(r"[\d.]+", scalar.text):
            return replace(scalar, uses=scalar.uses | known)
        name = self._free_name(base, where, scalar.text)
        self._texts[plain_name(name)] = scalar.text
        self.definitions[key] = Definition(name, scalar)
        if len(self.definitions) > 10 * BOUNDS.definitions:
            raise AnswerError(f"answers are made of more than {BOUNDS.definitions} names")
        return Scalar(name, Level.ATOM, scalar.number, known)

    def _free_name(self, base: str, where: str, text: str) -> str:
        if self._is_free(base, text) and ("_" not in base or not self.robot.vocabulary.knows(base)):
            return base
        letters = re.sub(r"[\W_]", "", base, flags=re.ASCII) or "x"
        name = f"{'' if letters[0].isalpha() else 'x'}{letters}_{re.sub(chr(92) + 'W', '', where, flags=re.ASCII)}"
        while not self._is_free(name, text):
            name += "x"
        return name

    def _is_free(self, name: str, text: str) -> bool:
        plain = plain_name(name)
        is_special = (
            name in FUNCTION_NAMES or name in _NOT_NAMES or name in MODULES or name in DERIVATIVES
        )
        vocabulary = self.robot.vocabulary
        is_known = (
            vocabulary.is_state(plain)
            or self.robot.is_vector(plain)
            or self.robot.quantities.is_parameter(name)
        )
        is_name = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) is not None
        return is_name and not is_special and not is_known and self._texts.get(plain, text) == text

    def closure(self, uses: Iterable[str]) -> list[str]:
        """Return the keys that formulas are made of, each after those that it needs.

        Raises
        ------
        UnreadError
            One of them is not to be relied on.
        """
        done: dict[str, None] = {}
        waiting = [(key, False) for key in sorted(uses)]
        while waiting:
            key, is_ready = waiting.pop()
            if is_ready:
                done[key] = None
                continue
            if key in done:
                continue
            if key in self.broken:
                raise UnreadError(self.broken[key])
            waiting.append((key, True))
            if key in self.definitions:
                needed = self.definitions[key].formula.uses
                waiting += [(other, False) for other in sorted(needed) if other not in done]
        return list(done)


class Scope:
    """Names of the program, or of one evaluation of a function.

    Parameters
    ----------
    record
        What is known of the whole program.
    outer
        Where names are looked up that this one does not bind; None for the program itself.
    local
        Names that a function binds; they are not looked up outside.
    """

    def __init__(
        self, record: Record, outer: Scope | None = None, local: frozenset[str] = frozenset()
    ) -> None:
        self.record = record
        self.robot = record.robot
        self.outer = outer
        self.local = local
        self.number = record.scopes
        record.scopes += 1
        self.names: dict[str, Binding] = {}
        self.read: set[str] = set()
        """Names that were read before they were bound."""
        self.assigned_entries: dict[str, set[Index]] = {}
        self.aliases: dict[str, set[str]] = {}

    def key(self, name: str, index: Index | None = None) -> str:
        """Return what tells a name, or an entry, from those of other scopes."""
        place = "" if index is None else str(list(index))
        return f"{self.number}:{name}{place}"

    def key_of(self, name: str) -> str:
        """Return the key of a name where it is bound, or, if it is not, where it would be looked up last."""
        owner = self.owner(name)
        if owner is None:
            self._outermost().read.add(name)
        return (owner or self._outermost()).key(name)

    def set_argument(self, name: str, value: Value, where: str) -> None:
        """Bind an argument of a function, whatever its name means outside."""
        self.names[name] = Binding(value, value, where)

    def owner(self, name: str) -> Scope | None:
        """Return the scope that binds a name."""
        if name in self.names or name in self.local:
            return self
        return self.outer.owner(name) if self.outer is not None else None

    # Binding

    def bind(self, name: str, value: Value, where: str) -> None:
        """Bind a name; one that was bound before to another value is not to be relied on."""
        try:
            self._bind(name, self._state(name, self._vector(value)), where)
        except UnreadError as error:
            self.break_name(name, _with_line(str(error), where), where, value)

    def _bind(self, name: str, value: Value, where: str) -> None:
        robot = self.robot
        is_quantity = isinstance(value, Matrix) and bool(robot.quantities.quantity(name))
        is_scalar = isinstance(value, Scalar) and robot.is_free_for_scalars(name)
        is_reserved = robot.is_reserved(name) and not is_quantity and not is_scalar
        reference = value
        if is_reserved and not isinstance(value, Unread | Function):
            if not robot.keeps_meaning(name, value):
                shown = value.text if isinstance(value, Scalar | Matrix) else "something else"
                raise UnreadError(
                    f"{name} is set to {shown[:40]!r} in {where}, and is the robot's own name"
                )
            if isinstance(value, Scalar) and value.number is not None:
                self.record.note(f"{where}: {name} = {value.text} is the file's own number")
            if isinstance(value, Scalar):
                reference = Scalar(name, uses=frozenset((self.key(name),)))
        elif name in self.names:
            known = self.names[name]
            if self._is_same(known.value, value) or self._is_same(known.reference, value):
                return
            is_declared = isinstance(known.value, Matrix) and known.value.is_zeros
            is_declared = is_declared and not self.assigned_entries.get(name)
            # The letter g, and then the gravity torques g.
            own = known.value.name if isinstance(known.value, Given) else ""
            is_letter = plain_name(own) == plain_name(name)
            is_letter = is_letter or (isinstance(known.value, Scalar) and robot.is_reserved(name))
            is_usual = is_quantity and is_letter
            if not is_declared and not is_usual:
                raise UnreadError(f"{name} is assigned twice, the second time")
        elif name in self.read and (is_scalar or not robot.is_reserved(name)):
            raise UnreadError(f"{name} is assigned after it was used")
        if isinstance(value, Given):
            self._refuse_same_symbol(value, where)
            reference = replace(value, uses=value.uses | {self.key(name)})
        elif isinstance(value, Scalar) and not is_reserved:
            reference = self.record.define(self.key(name), name, where, value)
        elif isinstance(value, Matrix) and not is_reserved:
            reference = self._named_entries(name, value, where)
        self.names[name] = Binding(value, reference, where)

    def _refuse_same_symbol(self, value: Given, where: str) -> None:
        """Refuse two symbols that the notation takes for one thing: m1 and M1."""
        meaning = self.robot.find(value.name) if value.is_symbol else None
        if meaning is None:
            return
        known = self.record.symbols.setdefault(meaning, SymbolMade(value.name, where))
        if known.name != value.name:
            raise UnreadError(
                f"{known.name} ({known.where}) and {value.name} would both be read as {''.join(meaning)}"
            )

    def _named_entries(self, name: str, matrix: Matrix, where: str) -> Matrix:
        entries = {}
        known = frozenset((self.key(name),))
        for index, entry in matrix.entries.items():
            base = name + "".join(f"_{k + 1}" for k in index)
            named = self.record.define(self.key(name, index), base, where, entry)
            entries[index] = replace(named, uses=named.uses | known)
        return replace(matrix, entries=entries)

    @staticmethod
    def _is_same(old: Value, new: Value) -> bool:
        match old, new:
            case Scalar(), Scalar():
                return old.text == new.text or (old.is_name and old.text == new.text)
            case Matrix(), Matrix():
                return {k: x.text for k, x in old.entries.items()} == {
                    k: x.text for k, x in new.entries.items()
                }
        return old == new

    def _vector(self, value: Value) -> Value:
        """Return several symbols under one name as the vector of them."""
        if (
            isinstance(value, Several)
            and value.values
            and all(isinstance(x, Given) for x in value.values)
        ):
            return vector_of([Scalar(x.name) for x in value.values if isinstance(x, Given)])
        return value

    def _state(self, name: str, value: Value) -> Value:
        """Return the joint variables that a name takes from a state: q1 = x(1), q = x(1:2); another value as it is."""
        if not isinstance(value, Part):
            return value
        robot = self.robot
        plain = plain_name(name)
        if value.is_slice and robot.is_vector(plain) and len(value.places) == robot.n:
            names = [f"{plain}{k + 1}" for k in range(robot.n)]
        elif not value.is_slice and robot.vocabulary.is_state(plain):
            names = [plain]
        else:
            places = ", ".join(str(place + 1) for place in value.places)
            raise UnreadError(
                f"{name} is entry {places} of {value.vector}, of which is not known what it holds"
            )
        for place, variable in zip(value.places, names, strict=True):
            taken = self.record.taken
            known = taken.setdefault(StatePlace(value.number, value.vector, place), variable)
            for other, taken_by in taken.items():
                is_same_state = other.call == value.number and other.vector == value.vector
                if is_same_state and other.place != place and robot.is_same(taken_by, variable):
                    here = f"{name} is entry {place + 1} of {value.vector}"
                    raise UnreadError(f"{here}, and entry {other.place + 1} elsewhere")
            if not robot.is_same(known, variable):
                raise UnreadError(f"{name} is an entry of {value.vector} that is {known} too")
        return Given(name) if value.is_slice else Scalar(name)

    def bind_entry(
        self, name: str, index: Index, scalar: Scalar, where: str, is_added: bool = False
    ) -> None:
        """Bind an entry of a matrix: of zeros that were made before, or of one that entries alone make."""
        try:
            self._bind_entry(name, index, scalar, where, is_added)
        except UnreadError as error:
            self.break_name(name, f"{error}, in {where}", where)

    def _bind_entry(
        self, name: str, index: Index, scalar: Scalar, where: str, is_added: bool
    ) -> None:
        binding = self.names.get(name)
        assigned = self.assigned_entries.setdefault(name, set())
        matrix = binding.value if binding is not None else None
        is_quantity = bool(self.robot.quantities.quantity(name))
        # The letter g, and then the gravity torques g.
        is_letter = is_quantity and not assigned and isinstance(matrix, Scalar | Given)
        if binding is not None and not isinstance(matrix, Matrix) and not is_letter:
            raise UnreadError(f"{name} is changed after it is assigned")
        if isinstance(matrix, Matrix) and not matrix.is_zeros and not assigned:
            raise UnreadError(f"{name} is changed after it is assigned")
        if binding is None and self.robot.is_reserved(name) and not is_quantity:
            place = index[0] if len(index) == 1 or index[1] == 0 else -1
            if not (self.robot.is_vector(name) and self.robot.has_entry(name, place)):
                raise UnreadError(f"an entry of {name} is set, which is the robot's own name")
            if not self.robot.keeps_meaning(f"{plain_name(name)}{place + 1}", scalar):
                raise UnreadError(f"an entry of {name} is set, which is the robot's own vector")
            return
        if self.aliases.get(name):
            raise UnreadError(
                f"{name} is changed, and may be the same matrix as {min(self.aliases[name])}"
            )
        entries = dict(matrix.entries) if isinstance(matrix, Matrix) else {}
        references = (
            dict(binding.reference.entries)
            if binding and isinstance(binding.reference, Matrix)
            else {}
        )
        if isinstance(matrix, Matrix) and matrix.is_zeros:
            index = _fitting(index, matrix)
        if is_added:
            if index not in entries:
                raise UnreadError(f"an entry of {name} is changed that was not assigned before")
            scalar = (
                scalar
                if entries[index].is_zero
                else joined(references[index], "+", scalar, self.record.power)
            )
        elif index in assigned and entries[index].text != scalar.text:
            raise UnreadError(f"an entry of {name} is assigned twice")
        if entries and len(next(iter(entries))) != len(index):
            raise UnreadError(f"an entry of {name} is set by another number of indices than before")
        assigned.add(index)
        base = name + "".join(f"_{k + 1}" for k in index)
        known = frozenset((self.key(name),))
        key = self.key(name, index)
        while is_added and key in self.record.definitions:
            key += "+"
        named = self.record.define(key, base, where, scalar)
        entries[index] = scalar
        references[index] = replace(named, uses=named.uses | known)
        is_zeros = isinstance(matrix, Matrix) and matrix.is_zeros
        options = {
            "is_zeros": is_zeros,
            "multiplies_entries": bool(getattr(matrix, "multiplies_entries", False)),
        }
        value = Matrix(dict(sorted(entries.items())), **options)
        reference = Matrix(references, **options)
        self.names[name] = Binding(
            value, reference, binding.where if isinstance(matrix, Matrix) and binding else where
        )

    def break_name(
        self, name: str, reason: str, where: str = "", value: Value | None = None
    ) -> None:
        """Note that a name, and whatever is made of it, is not to be relied on."""
        self.record.broken.setdefault(self.key(name), reason)
        if name not in self.names:
            self.names[name] = Binding(
                Unread(reason) if value is None else value, Unread(reason), where
            )

    def change(self, name: str, reason: str, only_matrices: bool = True) -> None:
        """Note that something changes a name, or the matrix that it stands for, in a way that is not read."""
        owner = self.owner(name) or self
        binding = owner.names.get(name)
        if not only_matrices or (binding is not None and _can_change(binding.value)):
            owner.break_name(name, reason)
        for other in [*self.same_matrices(name), *owner.same_matrices(name)]:
            holder = self.owner(other)
            binding = holder.names.get(other) if holder is not None else None
            if holder is not None and binding is not None and _can_change(binding.value):
                holder.break_name(other, f"{other} may be the same matrix as {name}: {reason}")

    def is_mutable(self, name: str) -> bool:
        """Whether a name stands for a matrix, or for something else that can be changed."""
        owner = self.owner(name)
        binding = owner.names.get(name) if owner is not None else None
        return binding is not None and _can_change(binding.value)

    def stands_for(self, name: str, value: Value) -> bool:
        """Whether a value is that of a name: M is returned, and not M.inv()."""
        binding = self.names[name]
        return self._is_same(binding.reference, value) or self._is_same(binding.value, value)

    def is_bare_zero(self, name: str) -> bool:
        """Whether a name is bound to a zero of the states' shape, which ``K[...] =`` replaces."""
        binding = self.names.get(name)
        return (
            binding is not None and isinstance(binding.value, Matrix) and not binding.value.entries
        )

    def add_alias(self, name: str, others: Iterable[str]) -> None:
        """Note that a name may be the same list or matrix as others, or share entries with them."""
        for other in others:
            if other != name:
                self.aliases.setdefault(name, set()).add(other)
                self.aliases.setdefault(other, set()).add(name)

    def same_matrices(self, name: str) -> Iterator[str]:
        """Yield the other names that may be the same list or matrix."""
        reached = {name}
        waiting = [name]
        while waiting:
            for other in self.aliases.get(waiting.pop(), ()):
                if other not in reached:
                    reached.add(other)
                    waiting.append(other)
                    yield other

    # Reading

    def value(self, name: str) -> Value:
        """Return the value that a name stands for.

        Raises
        ------
        UnreadError
            An unknown name, or one that is not to be relied on.
        """
        owner = self.owner(name)
        if owner is not None:
            if name not in owner.names and self.robot.is_reserved(name):
                return self._unbound(name)
            if name not in owner.names:
                raise UnreadError(f"{name} is used before it is assigned")
            if owner.key(name) in self.record.broken:
                raise UnreadError(self.record.broken[owner.key(name)])
            binding = owner.names[name]
            if isinstance(binding.reference, Matrix) and not binding.reference.entries:
                raise UnreadError(f"{name} is read before it is filled")
            if isinstance(binding.reference, Unread):
                raise UnreadError(binding.reference.reason)
            return binding.reference
        return self._unbound(name)

    def _unbound(self, name: str) -> Value:
        """Return the meaning of a name that the program does not bind: the robot's, or a function's of a library."""
        outermost = self
        while outermost.outer is not None:
            outermost = outermost.outer
        outermost.read.add(name)
        return Given(name)

    def scalar(self, value: Value) -> Scalar:
        """Return a value as a scalar.

        Raises
        ------
        UnreadError
            It is not one, or a name that the notation does not know.
        """
        match value:
            case Scalar():
                return value
            case Given(name):
                known = self.known(name)
                return replace(known, uses=known.uses | value.uses)
            case Matrix() if len(value.entries) == 1:
                return next(iter(value.entries.values()))
            case Matrix():
                raise UnreadError("a matrix instead of a number is not read")
            case Part(vector, places, False):
                return self.entry_of_state(value.number, vector, places[0])
            case Function(name=name) | Library(name) | Module(name):
                raise UnreadError(f"{name} is a function or a module")
        raise UnreadError("something instead of a number is not read")

    def known(self, name: str) -> Scalar:
        """Return a name of the robot's as a scalar."""
        vocabulary = self.robot.vocabulary
        plain = plain_name(name)
        owner = self.owner(name) or self._outermost()
        uses = {owner.key(name)}
        if not vocabulary.knows(name) and (
            self.owner(name) is not None or vocabulary.split(plain) is None
        ):
            raise UnreadError(f"unknown name {name[:40]!r} ({vocabulary.nearest(name[:60])})")
        if not vocabulary.knows(name):
            inside = next((x for x in self.everything() if len(x) < len(plain) and x in plain), "")
            if inside:
                raise UnreadError(
                    f"unknown name {name[:40]!r}, which is not a product: {inside} is the program's"
                )
        # c1 is the cosine of q1: whoever binds q1 to something else changes c1.
        for word in self.robot.find(name) or ():
            if word[0].isalpha() and word != name:
                holder = self.owner(word)
                uses.add((holder or self._outermost()).key(word))
                if holder is None:
                    self._outermost().read.add(word)
        return Scalar(name, uses=frozenset(uses))

    def everything(self) -> Iterator[str]:
        """Yield all names that are bound here and outside."""
        yield from self.names
        if self.outer is not None:
            yield from self.outer.everything()

    def _outermost(self) -> Scope:
        return self if self.outer is None else self.outer._outermost()

    def entry_of_state(self, number: int, vector: str, place: int) -> Scalar:
        """Return the joint variable that an entry of a state was said to be."""
        entry = StatePlace(number, vector, place)
        if entry not in self.record.taken:
            raise UnreadError(
                f"entry {place + 1} of {vector} is read, of which is not known what it holds"
            )
        return self.known(self.record.taken[entry])

    def entry(self, value: Value, index: Index) -> Value:
        """Return an entry of a matrix, of a vector of the robot's, or of a state."""
        match value:
            case Matrix():
                return entry_of(value, index)
            case Given(name, is_argument):
                place = index[0] if len(index) == 1 or (len(index) == 2 and index[1] == 0) else None
                if place is None:
                    raise UnreadError(
                        f"an entry of {name} is read, which is not a vector of the robot's"
                    )
                if self.robot.has_entry(name, place):
                    key = (self.owner(name) or self._outermost()).key(name)
                    scalar = self.known(f"{plain_name(name)}{place + 1}")
                    return replace(scalar, uses=scalar.uses | value.uses | {key})
                if is_argument or not self.robot.vocabulary.knows(name):
                    return Part(name, (place,), number=value.number)
                raise UnreadError(
                    f"an entry of {name} is read, which is not a vector of the robot's"
                )
        raise UnreadError("an entry of what is not a matrix is not read")

    def field(self, value: Value, name: str) -> Value:
        """Return a field of a structure: the robot's parameter of this name."""
        parameter = self.robot.parameter_of_field(name)
        match value:
            case Structure(fields) if name in fields:
                found = fields[name]
                if parameter is None or not self.robot.quantities.is_parameter(name):
                    return found
                if not self.robot.keeps_meaning(name, found):
                    raise UnreadError(
                        f"the field {name} is set to something else than the parameter"
                    )
                return Scalar(plain_name(parameter))
            case Given(structure, True):
                if parameter is None:
                    raise UnreadError(f"{structure}.{name[:40]} is not a parameter of the robot")
                key = (self.owner(structure) or self._outermost()).key(structure)
                return Scalar(plain_name(parameter), uses=frozenset((key, *value.uses)))
            case Text():
                raise UnreadError(f"the field {name} of a text is not read")
        raise UnreadError(f"the field {name[:40]} is not read")


def _can_change(value: Value) -> bool:
    """Whether something else than an assignment can change a value: numbers, expressions and symbols cannot change."""
    return isinstance(value, Matrix | Structure) or (
        isinstance(value, Given) and not value.is_symbol
    )


def _with_line(message: str, where: str) -> str:
    """Return a message that names a line."""
    return message if where in message else f"{message}, in {where}"


def _fitting(index: Index, matrix: Matrix) -> Index:
    """Return an index as the matrix of zeros has it: G(2) of a column is G(2, 1)."""
    if index in matrix.entries:
        return index
    if len(index) == 1 and not matrix.is_flat and 1 in matrix.shape:
        index = (0, index[0]) if matrix.shape[0] == 1 else (index[0], 0)
    if len(index) == 2 and matrix.is_flat and index[1] == 0:
        index = index[:1]
    if index not in matrix.entries:
        raise UnreadError("an entry is set that the matrix of zeros does not have")
    return index
