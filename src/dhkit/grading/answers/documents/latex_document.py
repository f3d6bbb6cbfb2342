r"""LaTeX documents: their displays and formulas in the text as statements, macros, and the answers that they give."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.grading.answers.documents.latex_rows import ROWS
from dhkit.grading.answers.documents.statements import (
    STARTS,
    STARTS_WITH_RELATION,
    Statement,
    has_relation,
    latex_statements,
    left_hand_name,
)
from dhkit.grading.answers.latex import DOTS, FRACTIONS, GREEK, SIZES, SPACE_NAMES, TIMES, UPRIGHT, latex_tokens
from dhkit.grading.answers.programs.standing import NameTable
from dhkit.grading.answers.quantity_names import QuantityNames, Target
from dhkit.grading.answers.sheet import AnswerSheet, Chain, Entries, Names, Refusal, quantity_names
from dhkit.grading.answers.tokens import folded
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, plain_name

MAX_STATEMENTS = 5_000
MAX_DEFINITIONS = 2_000
MAX_LEFT_OUT = 20
MAX_MACROS = 300
MACRO = re.compile(
    r"\\(?:(?:re)?newcommand|providecommand|DeclareMathOperator|DeclareRobustCommand"
    r"|(?:New|Renew|Declare|Provide)DocumentCommand|DeclareMathSymbol|DeclareMathAccent"
    r"|(?:New|Renew|Declare)CommandCopy)(?![A-Za-z])\*?"
    r"\s*\{?\s*\\([A-Za-z]+)\s*\}?|\\(?:[gex]?def|let|futurelet|mathchardef|chardef)\s*\\([A-Za-z]+)"
)
DEFINES = re.compile(r"\\(?:[gex]?def|let|renewcommand|futurelet|mathchardef|chardef)(?![A-Za-z])")
CHANGES = re.compile(
    r"\\(?:catcode|mathcode|lccode|uccode|csname|endcsname|expandafter|scantokens|lowercase|uppercase|aftergroup)"
    r"(?![A-Za-z])|\\renewenvironment\s*\{(?:"
    + "|".join(sorted(ROWS))
    + r"|[bpvBV]?matrix|smallmatrix|array|document)\*?\}"
)
"""What may change the meaning of anything behind it."""
READ_MACROS = frozenset(
    {*GREEK, *FUNCTION_NAMES, *FRACTIONS, *TIMES, *DOTS, *UPRIGHT, *SIZES, *SPACE_NAMES.split()}
    | {"sqrt", "over", "partial", "top", "begin", "end", "label", "tag", "equiv", "approx", "pm", "mp", "mbox"}
)
"""Macros that have a meaning, which no document should change."""
ATOM = re.compile(
    r"(?:\\[A-Za-z]+|[A-Za-z])(?:\s*\{\s*\\?[A-Za-z]+(?:_(?:\w|\{\w+\}))?\s*\})?(?:_(?:[A-Za-z0-9]|\{[A-Za-z0-9,]+\}))?",
    re.ASCII,
)
"""One symbol, perhaps with an accent and an index: what a macro may stand for and be put in place of it."""
HIDDEN = re.compile(r"\\begin\s*\{(verbatim\*?|comment|lstlisting|minted|filecontents\*?)\}|\\iffalse(?![A-Za-z])")
OPENING = re.compile(
    r"(?<!\\)\$\$?|(?<!\\)\\\[|\\\(|\\begin\{(?P<name>(?:"
    + "|".join(sorted(ROWS - {"cases", "dcases", "rcases", "split", "aligned", "gathered", "multlined", "alignedat"}))
    + r")\*?)\}"
)
CLOSERS = {"$": "$", "$$": "$$", "\\[": "\\]", "\\(": "\\)"}
MATRIX = re.compile(r"\\begin\s*\{(?:[bpvBV]?|small)?(?:matrix|array)\*?\}")
VALUE_WORDS = re.compile(r"\\(?:pi|circ|[td]?frac|deg)(?![A-Za-z])|\\(?:mathrm|text|textrm|si)\s*\{[^{}]*\}")
"""What the value of a joint variable may be made of besides numbers."""
UNITS = re.compile(
    r"([-+]?\s*(?:\d+\.?\d*|\.\d+))(?:\\[,;: ]|~|\s)*"
    r"(?:\\(?:mathrm|text|textrm|si|unit)\s*\{[^{}]*\}(?:\^(?:\d|\{-?\d\}))?/?)*",
    re.ASCII,
)


def latex_answers(text: str, file: str, line_name: Callable[[int], str], description: Description) -> AnswerSheet:
    """Return the answers of a document.

    Raises
    ------
    AnswerError
        It gives none, or more statements than are read.
    """
    found: list[Statement] = []
    try:
        for statement in _statements(text):
            found.append(statement)
            if len(found) > MAX_STATEMENTS:
                raise AnswerError(f"more than {MAX_STATEMENTS} equations")
    except AnswerError as error:
        raise AnswerError(f"{file}: {error}") from None
    return _Document(found, file, line_name, description).sheet()


# Text


def _without_hidden(text: str) -> str:
    """Blank what is not typeset as mathematics: listings and comments."""
    pieces: list[str] = []
    at = 0
    for match in HIDDEN.finditer(text):
        if match.start() < at:
            continue
        closer = f"\\end{{{match[1]}}}" if match[1] else "\\fi"
        end = text.find(closer, match.end())
        end = len(text) if end < 0 else end + len(closer)
        pieces += [text[at : match.start()], "\n" * text.count("\n", match.start(), end)]
        at = end
    return "".join([*pieces, text[at:]])


def _statements(text: str) -> Iterator[Statement]:
    r"""Yield the statements of a document's mathematics; of text without dollars and displays, of all of it."""
    text = text.replace("\r\n", "\n").replace("\r", "\n").replace("\f", " ")
    text = re.sub(r"(?<!\\)((?:\\\\)*)%[^\n]*", r"\1", text)
    text = _without_hidden(text)
    preamble, begins, body = text.partition("\\begin{document}")
    _refuse_changes(text)
    macros = _macros(text)
    if begins:
        text = _without_macros(re.sub(r"[^\n]", "", preamble) + body.partition("\\end{document}")[0])
    else:
        text = _without_macros(text)
    last: Statement | None = None
    for line, inside, is_inline in _displays(text):
        expanded = _expanded(inside, macros)
        rows = list(latex_statements(expanded[0], line))
        unseen = [why for name, why in expanded[1].items() if not any(f"\\{name}" in row.text for row in rows)]
        if unseen:
            rows = [replace(row, problem=row.problem or unseen[0]) for row in rows]
        for k, statement in enumerate(rows):
            statement = _with_macro_problem(statement, expanded[1])
            is_rest = STARTS_WITH_RELATION.match(statement.text) or not has_relation(statement.text)
            begins_inside = k == 0 and not is_inline and STARTS.match(statement.text) is not None and is_rest
            if begins_inside and last is not None and not statement.targets:
                yield replace(last, problem=f"it goes on in another display, in line {line}")
                last = None
                continue
            if last is not None:
                yield last
            last = statement
    if last is not None:
        yield last


def _displays(text: str) -> Iterator[tuple[int, str, bool]]:
    """Yield displays and formulas in the text: line, inside, and whether it stands in the text."""
    line, counted, at, has_math = 1, 0, 0, False
    absent: set[str] = set()
    while match := OPENING.search(text, at):
        name = match["name"]
        closer = f"\\end{{{name}}}" if name else CLOSERS[match[0]]
        end = -1 if closer in absent else text.find(closer, match.end())
        while match[0] in ("$", "$$") and end > 0 and text[end - 1] == "\\":
            end = text.find(closer, end + 1)
        if end < 0:
            absent.add(closer)
            at = match.end()
            continue
        has_math = True
        inside = text[match.end() : end]
        line += text.count("\n", counted, match.end())
        counted = match.end()
        if name and name.rstrip("*") in ("alignat", "xalignat", "IEEEeqnarray"):
            inside = re.sub(r"\A\s*(?:\[[^\]\n]*\])?\s*\{[^{}]*\}", "", inside)
        if name and name.rstrip("*") in ("eqnarray", "IEEEeqnarray"):
            inside = rf"\begin{{eqnarray}}{inside}\end{{eqnarray}}"
        yield line, inside, match[0] in ("$", "\\(")
        at = end + len(closer)
    if has_math:
        return
    line = 1
    for part in re.split(r"(\n[ \t]*\n)", text):
        yield line, part, False
        line += part.count("\n")


def _refuse_changes(text: str) -> None:
    """Refuse what may change the meaning of signs, or of macros that cannot be told."""
    named = {match.start() for match in MACRO.finditer(text)}
    for match in re.finditer(rf"{CHANGES.pattern}|{DEFINES.pattern}", text):
        if match.start() not in named:
            line = text.count("\n", 0, match.start()) + 1
            raise AnswerError(f"line {line}: {match[0]} may change what formulas mean, and is not read")


def _macros(text: str) -> dict[str, tuple[int, str | None]]:
    """Return macros that a document defines: the line, and one symbol where that is what it stands for."""
    found: dict[str, tuple[int, str | None]] = {}
    line, at = 1, 0
    for match in MACRO.finditer(text):
        line += text.count("\n", at, match.start())
        at = match.start()
        name = match[1] or match[2]
        body = re.compile(r"\s*\{([^{}]*(?:\{[^{}]*\}[^{}]*)*)\}").match(text, match.end())
        simple = body[1].strip() if body else ""
        is_command = text.startswith(("\\newcommand", "\\renewcommand", "\\providecommand", "\\def"), match.start())
        is_atom = ATOM.fullmatch(simple) is not None and is_command
        if name in READ_MACROS and simple not in (f"\\var{name}", f"\\{name.removeprefix('var')}"):
            is_atom = False
        if len(found) > MAX_MACROS:
            raise AnswerError(f"more than {MAX_MACROS} macros")
        found[name] = (line, simple if is_atom and name not in found else None)
    return found


def _without_macros(text: str) -> str:
    """Blank definitions of macros, whose bodies are no statements."""
    pattern = re.compile(MACRO.pattern + r"")
    pieces: list[str] = []
    at = 0
    for match in pattern.finditer(text):
        if match.start() < at:
            continue
        end = match.end()
        body = re.compile(r"(?:\s*\[[^\]\n]*\]|#\d|\s)*\{").match(text, end)
        if body:
            depth, end = 1, body.end()
            while depth and end < len(text):
                depth += (text[end] == "{") - (text[end] == "}")
                end += 1
        pieces += [text[at : match.start()], "\n" * text.count("\n", match.start(), end)]
        at = end
    return "".join([*pieces, text[at:]])


def _expanded(text: str, macros: dict[str, tuple[int, str | None]]) -> tuple[str, dict[str, str]]:
    """Return a display with macros for one symbol put in, and why those that are used otherwise are not read."""
    problems: dict[str, str] = {}
    for name, (line, body) in macros.items():
        used = re.search(rf"\\{name}(?![A-Za-z])", text)
        if not used:
            continue
        inner = re.findall(r"\\([A-Za-z]+)", body or "")
        if body is None or any(other in macros for other in inner):
            problems[name] = f"the macro \\{name}, which line {line} defines, is not read"
        else:
            text = re.sub(rf"\\{name}(?![A-Za-z])", lambda _, new=body: f"{{{new}}}", text)  # type: ignore[misc]
    return text, problems


def _with_macro_problem(statement: Statement, problems: dict[str, str]) -> Statement:
    for name, problem in problems.items():
        if re.search(rf"\\{name}(?![A-Za-z])", statement.text):
            return replace(statement, problem=problem)
    return statement


# Answers


class _Document:
    def __init__(
        self, found: list[Statement], file: str, line_name: Callable[[int], str], description: Description
    ) -> None:
        self.file = file
        self.line_name = line_name
        self.names = NameTable(description)
        self.quantities: QuantityNames = self.names.quantities
        self.left_out: list[str] = []
        self.notes: list[str] = []
        self.by_name: dict[str, list[Statement]] = {}
        for statement in found:
            self._sort(statement)
        self.parameters: dict[str, str | Refusal] = {}
        self._done: set[str] = set()

    def _line(self, statement: Statement) -> str:
        return self.line_name(statement.line)

    def _sort(self, statement: Statement) -> None:
        if not statement.targets:
            sides = len(statement.formulas)
            if sides > 1:
                self.left_out.append(f"{self._line(statement)}: {statement.text[:80]}")
            return
        for name in statement.targets:
            self.by_name.setdefault(name, []).append(statement)

    def sheet(self) -> AnswerSheet:
        answers: dict[str, Any] = {}
        own = {name for name in self.by_name if name in self.quantities.whole and self._of_quantity(name, name)}
        for name in list(self.by_name):
            quantity = self.quantities.quantity(name)
            if not quantity or quantity in answers:
                continue
            if self.quantities.is_alias(name) and quantity in own:
                continue
            whole = self._of_quantity(name, quantity)
            if whole:
                answers[quantity] = self._whole(name, quantity, whole)
                if self.quantities.is_alias(name):
                    self.notes.append(f"{self._line(whole[0])}: {name} is read as {quantity}")
        for quantity, entries in self._entries().items():
            if quantity not in answers:
                answers[quantity] = entries
            elif not self._uses_entries(quantity):
                line = next(iter(self._entry_statements(quantity)))[1]
                if self._stands_apart(quantity):
                    answers[quantity] = Refusal(f"{quantity} is given as a whole and entry by entry, in {line}")
        for name in self.by_name:
            if self.names.vocabulary.is_state(name):
                self._defining(name)
        if not answers:
            known = ", ".join(quantity_names(self.quantities.n)[:8])
            left = f"; left out: {self.left_out[0]}" if self.left_out else ""
            raise AnswerError(f"{self.file}: assigns no quantity; expected some of {known}, A1, T, J{left}")
        return AnswerSheet(
            names=Names(parameters=self.parameters, lenient=True),
            answers=answers,
            file=self.file,
            notes=tuple(self.notes),
            left_out=tuple(self.left_out[:MAX_LEFT_OUT]),
        )

    # Quantities

    def _of_quantity(self, name: str, quantity: str) -> list[Statement]:
        """Return the statements that give a whole quantity: a matrix of a matrix, no number of an energy."""
        found = []
        for statement in self.by_name[name]:
            formula = statement.formulas[-1]
            is_matrix = MATRIX.search(formula) is not None
            is_number = UNITS.fullmatch(formula) is not None
            if self.quantities.is_scalar(quantity) and not is_matrix:
                skips = self.quantities.is_parameter(name) or (is_number and quantity in ("K", "L"))
                fits = not skips and not (is_number and self.quantities.is_alias(name))
            else:
                fits = is_matrix and quantity not in ("K", "V", "L")
            if fits:
                found.append(statement)
            elif not is_number:
                self._leave_out(statement)
        return found

    def _leave_out(self, statement: Statement) -> None:
        told = f"{self._line(statement)}: {statement.text[:80]}"
        if told not in self.left_out:
            self.left_out.append(told)

    def _whole(self, name: str, quantity: str, statements: list[Statement]) -> str | Chain | Entries | Refusal:
        first = statements[0]
        if broken := next((s for s in statements if s.problem), None):
            return Refusal(f"{self._line(broken)}: {broken.problem}")
        other = next((s for s in statements if s.formulas != first.formulas), None)
        if other is not None:
            return Refusal(f"{name} is assigned twice, in {self._line(first)} and in {self._line(other)}")
        self._note_relations(first)
        formulas = first.formulas
        if quantity not in ("K", "V", "L"):
            formulas = self._matrices(quantity, first)
        if quantity not in ("K", "V", "L") and len(formulas) == 1:
            entries = self._by_names(quantity, formulas[0])
            if entries is not None:
                return entries
        reason = next((why for f in formulas if (why := self._define_names_in(f, {name}))), "")
        if reason:
            return Refusal(reason)
        return formulas[0] if len(formulas) == 1 else Chain(formulas)

    def _note_relations(self, statement: Statement) -> None:
        r"""Note a \approx that is read as =."""
        for sign in dict.fromkeys(re.findall(r"\\(?:approx|simeq|cong|doteq)(?![A-Za-z])", statement.text)):
            note = f"{self._line(statement)}: {sign} is read as ="
            self.notes += [] if note in self.notes else [note]

    def _matrices(self, quantity: str, statement: Statement) -> tuple[str, ...]:
        """Return the sides of a chain that are matrices of the quantity's shape, the last in any case."""
        *earlier, last = statement.formulas
        read = [side for side in earlier if self._fits(quantity, side)]
        if _has_marks(last):
            read = []
        if len(read) < len(earlier):
            self.notes.append(
                f"{self._line(statement)}: a side of {quantity}'s equation is not read; the last is judged"
            )
        return (*read, last)

    def _fits(self, quantity: str, side: str) -> bool:
        rows, shape = _matrix_rows(side), self.quantities.shape(quantity)
        if rows is None or _has_marks(side):
            return False
        if len(shape) == 1:
            return sum(map(len, rows)) == shape[0]
        return [len(row) for row in rows] == [shape[1]] * shape[0]

    def _by_names(self, quantity: str, formula: str) -> Entries | None:
        """Return a matrix of names, M_11 & M_12, by the formulas of its names; nothing of any other matrix.

        An entry of M for which a sign stands, * or sym., is left out, and is taken from the other half.
        """
        rows = _matrix_rows(formula)
        if rows is None:
            return None
        shape = self.quantities.shape(quantity)
        flat = [entry for row in rows for entry in row]
        is_vector = len(shape) == 1
        if is_vector and len(flat) != shape[0]:
            return None
        if not is_vector and [len(row) for row in rows] != [shape[1]] * shape[0]:
            return None
        named = [self._entry_name(entry) for entry in flat]
        marks = _marked(rows) if quantity == "M" else set()
        if not any(named) and not marks:
            return None
        found: dict[tuple[int, ...], str | Chain | Refusal] = {}
        for k, (entry, name) in enumerate(zip(flat, named, strict=True)):
            index = (k,) if is_vector else divmod(k, shape[1])
            if index in marks:
                continue
            if name:
                found[index] = self._entry(name, self.by_name[name])
            else:
                reason = self._define_names_in(entry, set())
                found[index] = Refusal(reason) if reason else entry
        return Entries(found)

    def _entry_name(self, entry: str) -> str:
        name = left_hand_name(entry)
        is_entry = name in self.by_name and self.quantities.entries(name) and not self.quantities.is_parameter(name)
        return name if is_entry else ""

    # Entries

    def _entry_statements(self, quantity: str) -> Iterable[tuple[str, str]]:
        for name, statements in self.by_name.items():
            if any(target.quantity == quantity for target in self._targets(name)):
                yield name, self._line(statements[0])

    def _targets(self, name: str) -> list[Target]:
        if self.quantities.quantity(name) or self.quantities.is_parameter(name):
            return []
        if all(MATRIX.search(s.formulas[-1]) for s in self.by_name[name]):
            return []
        return self.quantities.entries(name)

    def _uses_entries(self, quantity: str) -> bool:
        return all(name in self._done for name, _ in self._entry_statements(quantity))

    def _stands_apart(self, quantity: str) -> bool:
        return any(name not in self._done for name, _ in self._entry_statements(quantity))

    def _entries(self) -> dict[str, Entries | Refusal]:
        found: dict[str, dict[tuple[int, ...], str | Chain | Refusal]] = {}
        refused: dict[str, Refusal] = {}
        for name, statements in self.by_name.items():
            targets = self._targets(name)
            if not targets or name in self._done or self._is_height(name, targets[0]):
                continue
            if len(targets) > 1:
                reason = f"{name} in {self._line(statements[0])} may be {' or '.join(map(str, targets))}; write a comma"
                refused |= {target.quantity: Refusal(reason) for target in targets}
                continue
            (target,) = targets
            assert target.index is not None  # noqa: S101
            text = self._entry(name, statements)
            own = found.setdefault(target.quantity, {})
            if own.setdefault(target.index, text) != text:
                refused[target.quantity] = Refusal(f"{target} is assigned twice, in {self._line(statements[0])}")
        entries = {quantity: Entries(dict(sorted(texts.items()))) for quantity, texts in found.items()}
        return {**entries, **refused}

    def _is_height(self, name: str, target: Target) -> bool:
        """Whether a name is rather a height or a transform that an energy is made of than an entry of h, T, J or A."""
        if target.quantity in ("M", "C", "g", "tau"):
            return False
        energies = [s for key in self.by_name if self.quantities.quantity(key) in ("K", "V") for s in self.by_name[key]]
        uses = any(name in self._names_in(formula) for s in energies for formula in s.formulas)
        if uses:
            self.notes.append(f"{self._line(self.by_name[name][0])}: {name} is read as a name of the document's own")
        return uses

    def _entry(self, name: str, statements: list[Statement]) -> str | Chain | Refusal:
        self._done.add(name)
        if broken := next((s for s in statements if s.problem), None):
            return Refusal(f"{self._line(broken)}: {broken.problem}")
        formulas: tuple[str, ...] = ()
        for statement in statements:
            self._note_relations(statement)
            only_names = len(statement.formulas) == 1 and self._entry_name(statement.formulas[0])
            if formulas and formulas != statement.formulas and not only_names:
                return Refusal(f"{name} is assigned twice, in {self._line(statement)}")
            formulas = formulas or statement.formulas
        added = [s.formulas[0] for s in statements if s.formulas != formulas]
        chained = (*added, *formulas)
        reason = next((why for f in chained if (why := self._define_names_in(f, {name}))), "")
        if reason:
            return Refusal(reason)
        return chained[0] if len(chained) == 1 else Chain(chained)

    # Names

    def _knows(self, name: str) -> bool:
        return plain_name(name) in self.by_name or self.names.vocabulary.knows(name)

    def _names_in(self, formula: str) -> list[str]:
        """Return the names that a formula uses."""
        try:
            plain, _ = folded(formula)
            tokens = latex_tokens(plain, self._knows)
        except AnswerError:
            return []
        found = []
        for token, after in zip(tokens, [*tokens[1:], None], strict=True):
            if token.kind != "name":
                continue
            name = plain_name(token.text)
            number = after.text if after is not None and after.kind == "number" else ""
            found += [name, f"{name}{number}"]
        return list(dict.fromkeys(found))

    def _define_names_in(self, formula: str, outer: set[str]) -> str:
        """Define the document's own names that a formula uses, each after those that it needs; return why not."""
        waiting: list[tuple[str, bool]] = [(name, False) for name in reversed(self._names_in(formula))]
        open_names = set(outer)
        while waiting:
            name, is_done = waiting.pop()
            if is_done:
                open_names.discard(name)
                definition = self._definition(name)
                if definition is not None and name not in self.parameters:
                    self.parameters[name] = definition
                continue
            if name not in self.by_name:
                reason = self._shorthand_reason(name)
                if reason:
                    return reason
                continue
            if name in self.parameters or self._stays(name) or name in outer:
                reason = self._reason(name)
                if reason:
                    return reason
                continue
            if name in open_names:
                return f"{name} is defined by itself, in {self._line(self.by_name[name][0])}"
            reason = self._reason(name)
            if reason:
                return reason
            definition = self._definition(name)
            if definition is None:
                continue
            self._done.add(name)
            open_names.add(name)
            waiting.append((name, True))
            waiting += [(other, False) for other in reversed(self._names_in(definition)) if other != name]
            if len(self.parameters) + len(waiting) > MAX_DEFINITIONS * 10:
                return f"made of more than {MAX_DEFINITIONS} names"
        return ""

    def _shorthand_reason(self, name: str) -> str:
        """Say why c1 cannot be read where the document makes something else of q1."""
        for word in self.names.find(name) or ():
            if word in self.by_name and word != name and (reason := self._reason(word)):
                return reason
        return ""

    def _defining(self, name: str) -> list[Statement]:
        """Return the statements that define a name in formulas: no matrix, and no value of a joint variable."""
        found = []
        for statement in self.by_name.get(name, ()):
            formula = statement.formulas[-1]
            if MATRIX.search(formula) and self.quantities.quantity(name):
                continue
            if self.names.vocabulary.is_state(name) and not re.search(r"[A-Za-z]", VALUE_WORDS.sub("", formula)):
                self._leave_out(statement)
                continue
            found.append(statement)
        return found

    def _stays(self, name: str) -> bool:
        """Whether all that a document says of a name leaves it what it is."""
        return all(self._is_itself(name, statement) for statement in self._defining(name))

    def _is_itself(self, name: str, statement: Statement) -> bool:
        formula = statement.formulas[-1]
        if len(statement.formulas) > 1 or statement.problem:
            return False
        if self.quantities.is_parameter(name) and (number := UNITS.fullmatch(formula)):
            value = self.names.values.get(self.quantities.parameters[plain_name(name)])
            is_same = value is not None and abs(float(number[1].replace(" ", "")) - value) <= 1e-12 * abs(value)
            if is_same:
                note = f"{self._line(statement)}: {name} = {formula[:40]} is the file's own number"
                self.notes += [] if note in self.notes else [note]
            return is_same
        other = left_hand_name(formula)
        meaning = self.names.find(other) if other else None
        return meaning is not None and meaning == self.names.find(name) and self.names.is_proper(name)

    def _reason(self, name: str) -> str:
        """Say why a name cannot be relied on; nothing where it can."""
        defining = self._defining(name)
        changed = [s for s in defining if not self._is_itself(name, s)]
        if not changed:
            return ""
        first = changed[0]
        if first.problem:
            return f"{name} is given in {self._line(first)}: {first.problem}"
        if self.names.is_proper(name):
            return f"{name} is set to {first.formulas[-1][:40]!r} in {self._line(first)}, and is the robot's own name"
        if other := next((s for s in changed if s.formulas != first.formulas), None):
            return f"{name} is assigned twice, in {self._line(other)}"
        if len(first.formulas) > 1:
            return f"{name} is given by several formulas in {self._line(first)}; write the one that is meant"
        return ""

    def _definition(self, name: str) -> str | None:
        defining = [s for s in self._defining(name) if not self._is_itself(name, s)]
        return defining[0].formulas[-1] if defining else None


MARK = re.compile(
    r"(?:\*|\\(?:ast|star|cdot|bullet)(?![A-Za-z])"
    r"|\\(?:text|textrm|mbox|mathrm|textit|rm)\s*\{\s*(?:[Ss]ymm?\.?|[Ss]ymmetric|SYM\.?)\s*\}|[Ss]ymm?\.?)"
)
"""What stands for an entry of a symmetric matrix that is that of the other half."""


def _marked(rows: list[list[str]]) -> set[tuple[int, ...]]:
    """Return the places of a matrix where a sign refers to the other half; nothing where both halves have one."""
    places = {
        (i, j) for i, row in enumerate(rows) for j, entry in enumerate(row) if not entry or MARK.fullmatch(_core(entry))
    }
    halves = {i > j for i, j in places}
    return set(places) if len(halves) == 1 and all(i != j for i, j in places) else set()


def _has_marks(side: str) -> bool:
    rows = _matrix_rows(side)
    return rows is not None and any(MARK.fullmatch(_core(entry)) for row in rows for entry in row)


def _core(entry: str) -> str:
    """Return an entry without the braces around it."""
    while entry.startswith("{") and entry.endswith("}"):
        entry = entry[1:-1].strip()
    return entry


def _matrix_rows(formula: str) -> list[list[str]] | None:
    r"""Return the entries of a matrix that is all of a formula, as typed."""
    match = re.fullmatch(
        r"\s*(?:\\left\s*[\[(]\s*)?\\begin\s*\{(\w+\*?)\}(?:\{[clr|]*\})?(.*)\\end\s*\{\1\}\s*(?:\\right\s*[\])])?\s*",
        formula,
        re.DOTALL,
    )
    if match is None or "\\begin" in match[2]:
        return None
    pieces = re.split(r"(\\\\(?:\s*\[[^\]]*\])?|(?<!\\)&|[{}])", match[2])
    rows: list[list[str]] = [[""]]
    depth = 0
    for piece in pieces:
        depth += (piece == "{") - (piece == "}")
        if depth == 0 and piece.startswith("\\\\"):
            rows.append([""])
        elif depth == 0 and piece == "&":
            rows[-1].append("")
        else:
            rows[-1][-1] += piece
    if not "".join(rows[-1]).strip():
        rows.pop()
    return [[entry.strip() for entry in row] for row in rows]
