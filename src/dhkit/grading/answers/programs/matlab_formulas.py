"""Right-hand sides of MATLAB: which are formulas and matrices, and which names they read."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from dhkit.grading.answers.programs.bindings import Formula, Read, Use
from dhkit.grading.answers.programs.matlab_statements import MatlabToken
from dhkit.grading.answers.programs.python_formulas import joined
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
UNCHANGED = frozenset(("simplify", "expand", "collect", "combine", "simplifyFraction"))
OPERATORS = frozenset(("+", "-", "*", "/", "^", "**", ".*", "./", ".^", ".**"))
POWERS = frozenset(("^", "**", ".^", ".**"))
FUNCTIONS = frozenset(FUNCTION_NAMES) - {"square", "pow", "S", "Float", "Integer", "Rational", "number"}
MAX_INDEX = 1_000
MAX_WRAPPERS = 20
LONGEST_INDEX = 64
"""Tokens of what may be an index, or the arguments of diff and sym."""
MAX_ENTRIES = 1_024

Tokens = Sequence[MatlabToken]


def closing(tokens: Tokens, k: int) -> int:
    """Return where the bracket at k closes; the tokenizer has checked that it does."""
    depth = 0
    for end in range(k, len(tokens)):
        depth += tokens[end].nesting
        if depth == 0:
            return end
    return len(tokens) - 1


def split_rows(tokens: Tokens) -> list[list[Tokens]]:
    """Split the inside of a matrix: at ; and new lines into rows, at commas and spaces into entries."""
    rows: list[list[Tokens]] = [[]]
    entry: list[MatlabToken] = []
    depth = 0

    def close_entry() -> None:
        if entry:
            rows[-1].append(tuple(entry))
            entry.clear()

    for k, token in enumerate(tokens):
        is_sign = token.kind == "sign"
        if depth == 0 and (token.kind == "row" or (is_sign and token.text == ";")):
            close_entry()
            rows.append([])
            continue
        if depth == 0 and is_sign and token.text == ",":
            close_entry()
            continue
        if depth == 0 and token.spaced and entry and _begins(token, tokens[k + 1] if k + 1 < len(tokens) else None):
            before = entry[-1]
            if before.kind in ("name", "number", "string") or before.text in (")", "]", "}", "'", ".'"):
                close_entry()
        depth += token.nesting
        entry.append(token)
    close_entry()
    return [row for row in rows if row]


def _begins(token: MatlabToken, after: MatlabToken | None) -> bool:
    """Whether a token behind a space begins an entry: a name, a bracket, a sign that stands close to what follows."""
    if token.kind != "sign" or token.text in ("(", "[", "{", "@"):
        return True
    return token.text in ("+", "-", "~", "!") and after is not None and not after.spaced and after.kind != "row"


class MatlabFormulas:
    """Reads right-hand sides.

    Parameters
    ----------
    is_bound
        Whether the program assigns a name, which then is no function.
    """

    def __init__(self, is_bound: Callable[[str], bool]) -> None:
        self.is_bound = is_bound

    def formula(self, tokens: Tokens) -> Formula:
        """Return a right-hand side as a formula, a matrix, or why it cannot be read."""
        tokens, wrappers = self._unwrapped(tokens)
        found = self._zeros(tokens) or self._symbols(tokens) or self._matrix(tokens) or self._scalar(tokens)
        return replace(found, reads=(*wrappers, *found.reads)) if wrappers else found

    def _unwrapped(self, tokens: Tokens) -> tuple[Tokens, list[Read]]:
        """Take simplify(...) and brackets around everything away."""
        wrappers: list[Read] = []
        for _ in range(MAX_WRAPPERS):
            if len(tokens) <= 2:
                break
            first, second = tokens[0], tokens[1]
            if first.text == "(" and first.kind == "sign" and closing(tokens, 0) == len(tokens) - 1:
                inner = tokens[1:-1]
            elif first.kind == "name" and first.text in UNCHANGED and second.text == "(":
                if closing(tokens, 1) != len(tokens) - 1:
                    break
                inner = _first_argument(tokens[2:-1])
                wrappers.append(Read(first.text, 0, 0, use=Use.CALL))
            elif (
                first.kind == "name"
                and first.text == "vpa"
                and second.text == "("
                and closing(tokens, 1) == len(tokens) - 1
            ):
                inner = tokens[2:-1]
                if _first_argument(inner) != inner:
                    break
                wrappers.append(Read(first.text, 0, 0, use=Use.CALL))
            else:
                break
            if not inner or any(t.kind == "row" for t in inner[:1]):
                break
            tokens = inner
        return tokens, wrappers

    # Matrices

    def _zeros(self, tokens: Tokens) -> Formula | None:
        while (
            len(tokens) > 3
            and tokens[0].text == "sym"
            and tokens[1].text == "("
            and closing(tokens, 1) == len(tokens) - 1
        ):
            tokens = tokens[2:-1]
        is_call = len(tokens) > 2 and tokens[0].text == "zeros" and tokens[1].text == "("
        if not is_call or closing(tokens, 1) != len(tokens) - 1:
            return None
        return Formula(_text(tokens), (Read("zeros", 0, 0, use=Use.CALL),), is_zeros=True)

    @staticmethod
    def _symbols(tokens: Tokens) -> Formula | None:
        """Return the entries of sym('q', [2 1])."""
        if len(tokens) < 6 or tokens[0].text != "sym" or tokens[2].kind != "string" or tokens[3].text != ",":
            return None
        end = closing(tokens, 4)
        if tokens[4].text != "[" or closing(tokens, 1) != len(tokens) - 1:
            return None
        shape = [t.text for t in tokens[5:end] if t.kind == "number"]
        numbers = [int(k) for k in shape if k.isdecimal() and len(k) <= 3]
        if len(numbers) != 2 or len(shape) != 2 or 1 not in numbers or not 0 < max(numbers) <= MAX_INDEX:
            return None
        letters = tokens[2].text[1:-1].replace("%d", "")
        if not re.fullmatch(r"[A-Za-z]\w*", letters, re.ASCII):
            return None
        entries: dict[tuple[int, ...], Formula] = {(k,): Formula(f"{letters}{k + 1}") for k in range(max(numbers))}
        return Formula("[" + ", ".join(entry.text for entry in entries.values()) + "]", entries=entries)

    def _matrix(self, tokens: Tokens) -> Formula | None:
        """Return a matrix in brackets, with factors multiplied out and the transpose taken."""
        depth, groups, at = 0, [], 0
        while at < len(tokens):
            token = tokens[at]
            if token.kind == "sign" and token.text == "[" and depth == 0:
                end = closing(tokens, at)
                groups.append((at, end))
                at = end + 1
                continue
            depth += token.nesting
            at += 1
        if len(groups) != 1:
            return None if not groups else Formula(_text(tokens), problem="a sum or a product of matrices is not read")
        start, end = groups[0]
        before, after = list(tokens[:start]), list(tokens[end + 1 :])
        transposed = False
        while after and after[0].text in ("'", ".'") and not after[0].spaced:
            transposed = not transposed
            after = after[1:]
        whole = Formula(_text(tokens), problem="factors of a matrix are not read")
        if not self._are_factors(before, after):
            return whole
        rows = self._nested(split_rows(tokens[start + 1 : end]))
        if rows is None or not rows or len({len(row) for row in rows}) != 1 or len(rows) * len(rows[0]) > MAX_ENTRIES:
            return replace(whole, problem="the rows of a matrix differ in length, or are not read")
        entries: dict[tuple[int, ...], Formula] = {}
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                if before or after:
                    bracket = MatlabToken("sign", "(", entry[0].line, False)
                    closed = MatlabToken("sign", ")", entry[0].line, False)
                    entry = (*before, bracket, *entry, closed, *after)
                entries[(j, i) if transposed else (i, j)] = self._scalar(self._unwrapped(entry)[0])
        return self._of_entries(dict(sorted(entries.items())))

    @staticmethod
    def _of_entries(entries: dict[tuple[int, ...], Formula]) -> Formula:
        pieces: list[str | Formula] = ["["]
        for (i, j), entry in entries.items():
            pieces += [", " if j else "; " if i else "", entry]
        return replace(joined([*pieces, "]"]), entries=entries)

    @staticmethod
    def _nested(rows: list[list[Tokens]]) -> list[list[Tokens]] | None:
        """Return rows that stand in brackets of their own as rows."""
        if not any(entry[0].text == "[" for row in rows for entry in row):
            return rows
        found: list[list[Tokens]] = []
        for row in rows:
            (entry, *rest) = row
            if rest or entry[0].text != "[" or closing(entry, 0) != len(entry) - 1:
                return None
            inner = split_rows(entry[1:-1])
            if len(inner) != 1 or any(piece[0].text == "[" for piece in inner[0]):
                return None
            found.append(inner[0])
        return found

    @staticmethod
    def _are_factors(before: Tokens, after: Tokens) -> bool:
        """Whether what stands before and behind a matrix multiplies or divides it."""
        for tokens, inner in ((before, before[1:]), (after, after)):
            depth = 0
            for k, token in enumerate(inner):
                depth += token.nesting
                previous = inner[k - 1].text if k else ""
                if depth == 0 and token.text in ("+", "-") and token.kind == "sign" and previous not in OPERATORS:
                    return False
            if any(token.kind == "row" for token in tokens):
                return False
        starts = not before or before[-1].text in ("*", ".*") or [t.text for t in before] in (["-"], ["+"])
        ends = not after or after[0].text in ("*", ".*", "/", "./")
        return starts and ends

    # Scalars

    def _scalar(self, tokens: Tokens) -> Formula:
        """Return a formula without matrices, its names, and their places."""
        text = _text(tokens)
        pieces: list[str | Formula] = []
        operand = False  # whether what came before ends an operand
        power = False  # whether that operand is an exponent
        powers: list[bool] = []
        k = 0
        while k < len(tokens):
            token = tokens[k]
            what = f"{text[:40]!r} is not read"
            space = " " if token.spaced and pieces else ""
            if token.kind in ("number", "name") and operand:
                return Formula(text, problem=f"an operator is missing in front of {token.text[:20]!r}")
            if token.kind == "number":
                if NUMBER.fullmatch(token.text) is None:
                    return Formula(text, problem=f"the number {token.text[:20]!r} is not read")
                pieces.append(space + token.text)
                operand = True
            elif token.kind == "name":
                end, piece, why = self._name(tokens, k)
                if why:
                    return Formula(text, problem=why)
                pieces += [space, piece]
                operand = tokens[end - 1].text != "(" or tokens[end - 1].kind != "sign"
                if not operand:
                    powers.append(power)
                    power = False
                k = end
                continue
            elif token.kind != "sign":
                return Formula(text, problem=what)
            elif token.text in ("'", ".'"):
                if not operand:
                    return Formula(text, problem=what)
            elif token.text == "(":
                if operand:
                    return Formula(text, problem="an operator is missing in front of '('")
                pieces.append(space + "(")
                powers.append(power)
                power = False
            elif token.text == ")":
                if not operand:
                    return Formula(text, problem=what)
                pieces.append(")")
                operand = True
                power = powers.pop() if powers else False
            elif token.text == ",":
                pieces.append(",")
                operand = power = False
            elif token.text in OPERATORS:
                if token.text in POWERS:
                    if power:
                        return Formula(text, problem="a power of a power without brackets is not read")
                    power = True
                elif operand or token.text not in ("+", "-"):
                    power = False
                if not operand and token.text not in ("+", "-"):
                    return Formula(text, problem=what)
                plain = {".*": "*", "./": "/", ".^": "^", ".**": "^", "**": "^"}.get(token.text, token.text)
                pieces.append(space + plain)
                operand = False
            else:
                return Formula(text, problem=what)
            k += 1
        if not operand:
            return Formula(text, problem=f"{text[:40]!r} ends where a number or a name was expected")
        return replace(joined(pieces), number=_number(tokens))

    def _name(self, tokens: Tokens, k: int) -> tuple[int, str | Formula, str]:
        """Read a name with its index, its member or its call; return where it ends, and why it cannot be read."""
        token = tokens[k]
        name = token.text
        after = tokens[k + 1] if k + 1 < len(tokens) else None
        if after is None or after.kind != "sign" or after.text not in ("(", ".", "{"):
            return k + 1, Formula(name, (Read(name, 0, len(name)),)), ""
        if after.text == "{":
            return k, "", f"{name}{{...}} is not read"
        if after.text == ".":
            member = tokens[k + 2] if k + 2 < len(tokens) else None
            if member is None or member.kind != "name":
                return k, "", f"{name}.(...) is not read"
            text = f"{name}.{member.text}"
            follows = tokens[k + 3].text if k + 3 < len(tokens) else ""
            if follows in ("(", ".", "{"):
                return k, "", f"{text}{follows} is not read"
            return k + 3, Formula(text, (Read(name, 0, len(text), member=member.text),)), ""
        near = tokens[k + 1 : k + 1 + LONGEST_INDEX]
        end = k + 1 + closing(near, 0)
        inside = tokens[k + 2 : end] if tokens[end].text == ")" else tokens[k + 1 : k + 2]
        if name in ("diff", "sym") and not self.is_bound(name):
            found = _by_time(inside) if name == "diff" else _exact(inside)
            return (
                (end + 1, found, "")
                if found is not None
                else (k, "", f"{_text(tokens[k : end + 1])[:40]!r} is not read")
            )
        if [t.text for t in inside] == ["t"] and name not in FUNCTIONS:
            at = len(name) + 1
            return end + 1, Formula(f"{name}(t)", (Read(name, 0, len(name)), Read("t", at, at + 1, use=Use.TIME))), ""
        if name in FUNCTIONS and not self.is_bound(name):
            return k + 2, Formula(f"{name}(", (Read(name, 0, len(name), use=Use.CALL),)), ""
        index = _index(inside)
        if index is None:
            return k, "", f"{_text(tokens[k : end + 1])[:40]!r} is not read"
        text = f"{name}({', '.join(str(i + 1) for i in index)})"
        return end + 1, Formula(text, (Read(name, 0, len(text), index),)), ""


def _index(inside: Tokens) -> tuple[int, ...] | None:
    """Return an index from 0."""
    numbers = inside[::2]
    commas = inside[1::2]
    if not numbers or len(inside) % 2 == 0 or any(t.text != "," for t in commas):
        return None
    if not all(t.kind == "number" and t.text.isdecimal() and 0 < int(t.text[:5]) <= MAX_INDEX for t in numbers):
        return None
    return tuple(int(t.text) - 1 for t in numbers)


def _by_time(inside: Tokens) -> Formula | None:
    """Return diff(q1, t), diff(q1(t), t, 2) and diff(q1, t, t) as the reader of formulas has them."""
    words = "".join(t.text for t in inside)
    match = re.fullmatch(r"([A-Za-z]\w*)(?:\(t\))?,t(,[2t])?", words, re.ASCII)
    if match is None:
        return None
    reads = (Read(match[1], 0, 0), Read("t", 0, 0, use=Use.TIME), Read("diff", 0, 0, use=Use.CALL))
    return Formula(f"diff({match[1]}, t{', 2' if match[2] else ''})", reads)


def _exact(inside: Tokens) -> Formula | None:
    """Return sym(1), sym(1/3) and sym('1/3') as numbers."""
    words = "".join(t.text for t in inside)
    words = words[1:-1] if inside and inside[0].kind == "string" and len(inside) == 1 else words
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(/\d+(?:\.\d+)?)?|pi", words, re.ASCII)
    return Formula(f"({words})", (Read("sym", 0, 0, use=Use.CALL),)) if match else None


def _number(tokens: Tokens) -> float | None:
    words = "".join(t.text for t in tokens)
    match = re.fullmatch(r"([-+]?)(\d+\.?\d*(?:[eE][-+]?\d{1,3})?|\.\d+)(?:/(\d+\.?\d*))?", words, re.ASCII)
    if match is None:
        return None
    divisor = float(match[3] or 1)
    return float(match[1] + match[2]) / divisor if divisor else None


def _first_argument(tokens: Tokens) -> Tokens:
    depth = 0
    for k, token in enumerate(tokens):
        if token.kind == "sign" and token.text == "," and depth == 0:
            return tokens[:k]
        depth += token.nesting
    return tokens


def _text(tokens: Tokens) -> str:
    """Return tokens in one line, with the spaces between them."""
    pieces = [(" " if token.spaced or token.kind == "row" else "") + token.text.strip() for token in tokens]
    return "".join(pieces).strip()
