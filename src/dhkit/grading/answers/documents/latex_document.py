r"""The answers that a LaTeX document gives: which of its statements are about quantities, and what they are made of."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.documents.latex_rows import (
    MATRIX_BEGINNING,
    has_symmetry_marks,
    marked_places,
    matrix_rows,
)
from dhkit.grading.answers.documents.latex_source import document_statements
from dhkit.grading.answers.documents.statements import Statement, left_hand_name
from dhkit.grading.answers.latex import latex_tokens
from dhkit.grading.answers.programs.robot_names import RobotNames, is_same_number
from dhkit.grading.answers.quantity_names import Target
from dhkit.grading.answers.sheet import source_sheet
from dhkit.grading.answers.sheet_values import (
    NO_NAMES,
    AnswerSheet,
    Entries,
    EqualFormulas,
    Names,
    Refusal,
)
from dhkit.grading.answers.tokens import to_ascii
from dhkit.grading.answers.vocabulary import plain_name

_VALUE_WORDS = re.compile(
    r"\\(?:pi|circ|[td]?frac|deg)(?![A-Za-z])|\\(?:mathrm|text|textrm|si)\s*\{[^{}]*\}"
)
"""Macros that the value of a joint variable may have besides numbers."""

_NUMBER_WITH_UNIT = re.compile(
    r"([-+]?\s*(?:\d+\.?\d*|\.\d+))(?:\\[,;: ]|~|\s)*"
    r"(?:\\(?:mathrm|text|textrm|si|unit)\s*\{[^{}]*\}(?:\^(?:\d|\{-?\d\}))?/?)*",
    re.ASCII,
)

_ENERGIES = ("K", "V", "L")

_ADVICE = "write it out in one formula, or on a sheet"
"""Advice to the author of a document that cannot be read."""


def latex_answers(
    text: str,
    file: str,
    line_name: Callable[[int], str],
    description: Description,
    names: Names = NO_NAMES,
) -> AnswerSheet:
    """Return the answers of a document.

    Parameters
    ----------
    text
        The document.
    file
        Beginning of messages.
    line_name
        How messages name a line, which counts from 1.
    description
        The robot.
    names
        The task's names of the joint variables.

    Raises
    ------
    AnswerError
        It gives none, or more statements than are read.
    """
    try:
        statements = list(document_statements(text))
    except AnswerError as error:
        raise AnswerError(f"{file}: {error}") from None
    return _DocumentAnswers(statements, line_name, description, names).sheet(file)


class _DocumentAnswers:
    def __init__(
        self,
        statements: Sequence[Statement],
        line_name: Callable[[int], str],
        description: Description,
        names: Names,
    ) -> None:
        self.line_name = line_name
        self.names = RobotNames(description, names)
        self.quantities = self.names.quantities
        self.left_out: list[str] = []
        self.notes: list[str] = []
        self.parameters: dict[str, str | Refusal] = {}
        self.by_name: dict[str, list[Statement]] = {}
        self._used: set[str] = set()
        """Names whose statements are part of an answer."""
        for statement in statements:
            if not statement.targets and len(statement.formulas) > 1:
                self.left_out.append(self._quote(statement))
            for name in statement.targets:
                self.by_name.setdefault(name, []).append(statement)

    def _line(self, statement: Statement) -> str:
        return self.line_name(statement.line)

    def _quote(self, statement: Statement) -> str:
        return f"{self._line(statement)}: {statement.text[:80]}"

    @staticmethod
    def _add(messages: list[str], message: str) -> None:
        if message not in messages:
            messages.append(message)

    def sheet(self, file: str) -> AnswerSheet:
        answers: dict[str, str | EqualFormulas | Entries | Refusal] = {}
        own = {
            name
            for name in self.by_name
            if name in self.quantities.whole and self._of_quantity(name, name)
        }
        for name in list(self.by_name):
            quantity = self.quantities.quantity(name)
            is_alias = self.quantities.is_alias(name)
            if not quantity or quantity in answers or (is_alias and quantity in own):
                continue
            if statements := self._of_quantity(name, quantity):
                answers[quantity] = self._whole(name, quantity, statements)
                if is_alias:
                    self.notes.append(f"{self._line(statements[0])}: {name} is read as {quantity}")
        for quantity, entries in self._entries().items():
            if quantity not in answers:
                answers[quantity] = entries
            elif not all(name in self._used for name, _ in self._entry_statements(quantity)):
                _, line = next(self._entry_statements(quantity))
                answers[quantity] = _refused(
                    f"{quantity} is given as a whole and entry by entry, in {line}"
                )
        for name in self.by_name:
            if self.names.vocabulary.is_state(name):
                self._defining(name)
        return source_sheet(
            file, self.quantities.n, answers, self.parameters, self.notes, self.left_out
        )

    # Quantities

    def _of_quantity(self, name: str, quantity: str) -> list[Statement]:
        """Return the statements that give a whole quantity: a matrix of a matrix, no number of an energy."""
        fitting = []
        for statement in self.by_name[name]:
            formula = statement.formulas[-1]
            is_matrix = MATRIX_BEGINNING.search(formula) is not None
            is_number = _NUMBER_WITH_UNIT.fullmatch(formula) is not None
            if self.quantities.is_scalar(quantity) and not is_matrix:
                is_other_number = is_number and (
                    quantity in ("K", "L") or self.quantities.is_alias(name)
                )
                fits = not self.quantities.is_parameter(name) and not is_other_number
            else:
                fits = is_matrix and quantity not in _ENERGIES
            if fits:
                fitting.append(statement)
            elif not is_number:
                self._add(self.left_out, self._quote(statement))
        return fitting

    def _whole(
        self, name: str, quantity: str, statements: Sequence[Statement]
    ) -> str | EqualFormulas | Entries | Refusal:
        first = statements[0]
        if broken := next((s for s in statements if s.problem), None):
            return _refused(f"{self._line(broken)}: {broken.problem}")
        if other := next((s for s in statements if s.formulas != first.formulas), None):
            return _refused(
                f"{name} is assigned twice, in {self._line(first)} and in {self._line(other)}"
            )
        self._note_relations(first)
        formulas = first.formulas
        if quantity not in _ENERGIES:
            formulas = self._matrices(quantity, first)
            entries = self._by_names(quantity, formulas[0]) if len(formulas) == 1 else None
            if entries is not None:
                return entries
        return self._with_definitions(formulas, {name})

    def _with_definitions(
        self, formulas: tuple[str, ...], outer: set[str]
    ) -> str | EqualFormulas | Refusal:
        """Return formulas whose names are all defined, or why they cannot be."""
        for formula in formulas:
            if problem := self._define_names_in(formula, outer):
                return _refused(problem)
        return formulas[0] if len(formulas) == 1 else EqualFormulas(formulas)

    def _note_relations(self, statement: Statement) -> None:
        r"""Note a \approx that is read as =."""
        for sign in re.findall(r"\\(?:approx|simeq|cong|doteq)(?![A-Za-z])", statement.text):
            self._add(self.notes, f"{self._line(statement)}: {sign} is read as =")

    def _matrices(self, quantity: str, statement: Statement) -> tuple[str, ...]:
        """Return the sides of a chain that are matrices of the quantity's shape, the last in any case."""
        *earlier, last = statement.formulas
        fitting = [
            side
            for side in earlier
            if self._rows_of_shape(quantity, side) and not has_symmetry_marks(side)
        ]
        if has_symmetry_marks(last):
            fitting = []
        if len(fitting) < len(earlier):
            self.notes.append(
                f"{self._line(statement)}: a side of {quantity}'s equation is not read; the last is judged"
            )
        return (*fitting, last)

    def _rows_of_shape(self, quantity: str, formula: str) -> list[list[str]] | None:
        """Return the rows of a matrix of the quantity's shape; None of any other formula."""
        rows = matrix_rows(formula)
        shape = self.quantities.shape(quantity)
        if rows is None:
            return None
        lengths = [len(row) for row in rows]
        fits = sum(lengths) == shape[0] if len(shape) == 1 else lengths == [shape[1]] * shape[0]
        return rows if fits else None

    def _by_names(self, quantity: str, formula: str) -> Entries | None:
        """Return a matrix of names, M_11 & M_12, by the formulas of its names; None of any other matrix.

        An entry of M for which a sign stands, * or sym., is left out, and is taken from the other half.
        """
        rows = self._rows_of_shape(quantity, formula)
        if rows is None:
            return None
        shape = self.quantities.shape(quantity)
        flat = list(chain.from_iterable(rows))
        named = [self._entry_name(entry) for entry in flat]
        marks = marked_places(rows) if quantity == "M" else set()
        if not any(named) and not marks:
            return None
        texts: dict[tuple[int, ...], str | EqualFormulas | Refusal] = {}
        for k, (entry, name) in enumerate(zip(flat, named, strict=True)):
            index = (k,) if len(shape) == 1 else divmod(k, shape[1])
            if index not in marks:
                texts[index] = (
                    self._entry(name) if name else self._with_definitions((entry,), set())
                )
        return Entries(texts)

    def _entry_name(self, entry: str) -> str:
        name = left_hand_name(entry)
        is_entry = (
            name in self.by_name
            and self.quantities.entries(name)
            and not self.quantities.is_parameter(name)
        )
        return name if is_entry else ""

    # Entries

    def _entry_statements(self, quantity: str) -> Iterator[tuple[str, str]]:
        """Yield the names of a quantity's entries, each with its line."""
        for name, statements in self.by_name.items():
            if any(target.quantity == quantity for target in self._targets(name)):
                yield name, self._line(statements[0])

    def _targets(self, name: str) -> list[Target]:
        """Return the entries that a name may stand for."""
        is_other = self.quantities.quantity(name) or self.quantities.is_parameter(name)
        if is_other or all(MATRIX_BEGINNING.search(s.formulas[-1]) for s in self.by_name[name]):
            return []
        return self.quantities.entries(name)

    def _entries(self) -> dict[str, Entries | Refusal]:
        texts: dict[str, dict[tuple[int, ...], str | EqualFormulas | Refusal]] = {}
        refused: dict[str, Refusal] = {}
        for name, statements in self.by_name.items():
            targets = self._targets(name)
            if not targets or name in self._used or self._is_part_of_energy(name, targets[0]):
                continue
            line = self._line(statements[0])
            if len(targets) > 1:
                problem = f"{name} in {line} may be {' or '.join(map(str, targets))}; write a comma"
                refused |= {target.quantity: _refused(problem) for target in targets}
                continue
            (target,) = targets
            text = self._entry(name)
            if texts.setdefault(target.quantity, {}).setdefault(target.index or (), text) != text:
                refused[target.quantity] = _refused(f"{target} is assigned twice, in {line}")
        return {
            quantity: Entries(dict(sorted(own.items()))) for quantity, own in texts.items()
        } | refused

    def _is_part_of_energy(self, name: str, target: Target) -> bool:
        """Whether a name is rather a height or a transform that an energy is made of than an entry of h, T, J or A."""
        if target.quantity in ("M", "C", "g", "tau"):
            return False
        for key, statements in self.by_name.items():
            if self.quantities.quantity(key) not in ("K", "V"):
                continue
            for formula in chain.from_iterable(statement.formulas for statement in statements):
                if name in self._names_in(formula):
                    line = self._line(self.by_name[name][0])
                    self.notes.append(f"{line}: {name} is read as a name of the document's own")
                    return True
        return False

    def _entry(self, name: str) -> str | EqualFormulas | Refusal:
        self._used.add(name)
        statements = self.by_name[name]
        if broken := next((s for s in statements if s.problem), None):
            return _refused(f"{self._line(broken)}: {broken.problem}")
        formulas: tuple[str, ...] = ()
        for statement in statements:
            self._note_relations(statement)
            is_only_name = len(statement.formulas) == 1 and self._entry_name(statement.formulas[0])
            if formulas and formulas != statement.formulas and not is_only_name:
                return _refused(f"{name} is assigned twice, in {self._line(statement)}")
            formulas = formulas or statement.formulas
        names = [s.formulas[0] for s in statements if s.formulas != formulas]
        return self._with_definitions((*names, *formulas), {name})

    # Names

    def _names_in(self, formula: str) -> list[str]:
        """Return the names that a formula uses, also together with a number after them."""
        try:
            tokens = latex_tokens(
                to_ascii(formula)[0],
                lambda name: plain_name(name) in self.by_name or self.names.vocabulary.knows(name),
            )
        except AnswerError:
            return []
        names = []
        for k, token in enumerate(tokens):
            if token.kind == "name":
                name = plain_name(token.text)
                has_number = k + 1 < len(tokens) and tokens[k + 1].kind == "number"
                number = tokens[k + 1].text if has_number else ""
                names += [name, f"{name}{number}"]
        return list(dict.fromkeys(names))

    def _define_names_in(self, formula: str, outer: set[str]) -> str:
        """Define the document's own names that a formula uses, each after those that it needs; return why not."""
        waiting: list[tuple[str, str | None]] = [
            (name, None) for name in reversed(self._names_in(formula))
        ]
        open_names = set(outer)
        while waiting:
            name, definition = waiting.pop()
            if definition is not None:  # all that it needs is defined
                open_names.discard(name)
                self.parameters.setdefault(name, definition)
                continue
            if name not in self.by_name:
                if problem := self._shorthand_problem(name):
                    return problem
                continue
            is_settled = name in self.parameters or name in outer or not self._changing(name)
            if not is_settled and name in open_names:
                return f"{name} is defined by itself, in {self._line(self.by_name[name][0])}"
            if problem := self._problem(name):
                return problem
            changing = self._changing(name)
            if is_settled or not changing:
                continue
            definition = changing[0].formulas[-1]
            self._used.add(name)
            open_names.add(name)
            waiting.append((name, definition))
            waiting += [
                (other, None) for other in reversed(self._names_in(definition)) if other != name
            ]
            if len(self.parameters) + len(waiting) > BOUNDS.definitions * 10:
                return f"made of more than {BOUNDS.definitions} names"
        return ""

    def _shorthand_problem(self, name: str) -> str:
        """Return why c1 cannot be read where the document makes something else of q1."""
        for word in self.names.find(name) or ():
            if word in self.by_name and word != name and (problem := self._problem(word)):
                return problem
        return ""

    def _defining(self, name: str) -> Iterable[Statement]:
        """Return the statements that define a name in formulas: no matrix, and no value of a joint variable."""
        defining = []
        for statement in self.by_name.get(name, ()):
            formula = statement.formulas[-1]
            if MATRIX_BEGINNING.search(formula) and self.quantities.quantity(name):
                continue
            if self.names.vocabulary.is_state(name) and not re.search(
                r"[A-Za-z]", _VALUE_WORDS.sub("", formula)
            ):
                self._add(self.left_out, self._quote(statement))
            else:
                defining.append(statement)
        return defining

    def _changing(self, name: str) -> list[Statement]:
        """Return the statements that give a name another meaning than its usual one."""
        return [
            statement
            for statement in self._defining(name)
            if not self._keeps_usual_meaning(name, statement)
        ]

    def _keeps_usual_meaning(self, name: str, statement: Statement) -> bool:
        formula = statement.formulas[-1]
        if len(statement.formulas) > 1 or statement.problem:
            return False
        if self.quantities.is_parameter(name) and (number := _NUMBER_WITH_UNIT.fullmatch(formula)):
            is_same = is_same_number(
                self.names.parameter_value(name), float(number[1].replace(" ", ""))
            )
            if is_same:
                self._add(
                    self.notes,
                    f"{self._line(statement)}: {name} = {formula[:40]} is the file's own number",
                )
            return is_same
        other = left_hand_name(formula)
        meaning = self.names.find(other) if other else None
        return (
            meaning is not None
            and meaning == self.names.find(name)
            and self.names.is_reserved(name)
        )

    def _problem(self, name: str) -> str:
        """Return why a name cannot be relied on; nothing where it can."""
        changing = self._changing(name)
        if not changing:
            return ""
        first = changing[0]
        line = self._line(changing[0])
        if first.problem:
            return f"{name} is given in {line}: {first.problem}"
        if self.names.is_reserved(name):
            return f"{name} is set to {first.formulas[-1][:40]!r} in {line}, and is the robot's own name"
        if other := next((s for s in changing if s.formulas != first.formulas), None):
            return f"{name} is assigned twice, in {self._line(other)}"
        if len(first.formulas) > 1:
            return f"{name} is given by several formulas in {line}; write the one that is meant"
        return ""


def _refused(reason: str) -> Refusal:
    return Refusal(reason, _ADVICE)
