"""Right-hand sides of MATLAB: formulas and matrices, and the names that they read."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate

from dhkit.grading.answers.programs.bindings import (
    MAX_ENTRIES,
    MAX_INDEX,
    PLAIN_NUMBER,
    Formula,
    Index,
    Read,
    Use,
    join_formulas,
    vector_of_names,
)
from dhkit.grading.answers.programs.matlab_statements import MatlabToken, Tokens, closing, is_call, split_rows
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES

UNCHANGED = ("simplify", "expand", "collect", "combine", "simplifyFraction")
"""Functions that write an expression in another way."""

SIGNS = {".*": "*", "./": "/", ".^": "^", ".**": "^", "**": "^"}
"""Signs between numbers that mean the same as another one."""

OPERATORS = frozenset(("+", "-", "*", "/", "^", *SIGNS))
FUNCTIONS = frozenset(FUNCTION_NAMES) - {"square", "pow", "S", "Float", "Integer", "Rational", "number"}

MAX_WRAPPERS = 20
"""Largest number of brackets and functions that are taken off a right-hand side."""

MAX_INDEX_TOKENS = 64
"""Largest number of tokens of what may be an index, or the arguments of diff and sym."""


class _UnreadableError(Exception):
    """A formula that is not read; the message says why."""


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
        tokens, wrapper_reads = _unwrap(tokens)
        formula = _zeros(tokens) or _symbol_vector(tokens) or self._matrix(tokens) or self._scalar(tokens)
        return formula.after_reads(wrapper_reads)

    # Matrices

    def _matrix(self, tokens: Tokens) -> Formula | None:
        """Return a matrix in brackets, with factors multiplied out and the transpose taken."""
        groups: list[tuple[int, int]] = []
        depth = at = 0
        while at < len(tokens):
            if depth == 0 and tokens[at].is_sign("["):
                groups.append((at, closing(tokens, at)))
                at = groups[-1][1]
            else:
                depth += tokens[at].nesting
            at += 1
        if not groups:
            return None
        text = _text(tokens)
        if len(groups) > 1:
            return Formula(text, problem="a sum or a product of matrices is not read")
        ((start, end),) = groups
        before, after = list(tokens[:start]), list(tokens[end + 1 :])
        is_transposed = False
        while after and after[0].text in ("'", ".'") and not after[0].is_spaced:
            is_transposed = not is_transposed
            after = after[1:]
        if not _are_factors(before, after):
            return Formula(text, problem="factors of a matrix are not read")
        rows = _without_row_brackets(split_rows(tokens[start + 1 : end]))
        if not rows or len({len(row) for row in rows}) != 1 or len(rows) * len(rows[0]) > MAX_ENTRIES:
            return Formula(text, problem="the rows of a matrix differ in length, or are not read")
        entries: dict[Index, Formula] = {}
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                if before or after:
                    brackets = [MatlabToken("sign", bracket, entry[0].line, False) for bracket in "()"]
                    entry = (*before, brackets[0], *entry, brackets[1], *after)
                entries[(j, i) if is_transposed else (i, j)] = self._scalar(_unwrap(entry)[0])
        entries = dict(sorted(entries.items()))
        pieces: list[str | Formula] = ["["]
        for (i, j), entry_formula in entries.items():
            pieces += [", " if j else "; " if i else "", entry_formula]
        return replace(join_formulas([*pieces, "]"]), entries=entries)

    # Scalars

    def _scalar(self, tokens: Tokens) -> Formula:
        """Return a formula without matrices, its names, and their places."""
        try:
            return replace(join_formulas(self._pieces(tokens)), number=_number(tokens))
        except _UnreadableError as error:
            return Formula(_text(tokens), problem=str(error))

    def _pieces(self, tokens: Tokens) -> list[str | Formula]:
        """Return the texts of a formula's signs and numbers, and its names as formulas, in order."""
        pieces: list[str | Formula] = []
        is_operand = False  # whether an operand ends here
        is_exponent = False  # whether that operand is an exponent
        outer_exponents: list[bool] = []  # the same outside each open bracket
        k = 0
        while k < len(tokens):
            token, end = tokens[k], k + 1
            space = " " if token.is_spaced and pieces else ""
            match token.kind, token.text:
                case (("number" | "name"), text) if is_operand:
                    raise _UnreadableError(f"an operator is missing in front of {text[:20]!r}")
                case "number", text:
                    if PLAIN_NUMBER.fullmatch(text) is None:
                        raise _UnreadableError(f"the number {text[:20]!r} is not read")
                    pieces.append(space + text)
                    is_operand = True
                case "name", _:
                    end, name = self._name(tokens, k)
                    pieces += [space, name]
                    is_operand = not tokens[end - 1].is_sign("(")
                    if not is_operand:
                        outer_exponents.append(is_exponent)
                        is_exponent = False
                case "sign", "'" | ".'" if is_operand:
                    pass  # the transpose of a scalar
                case "sign", "(":
                    if is_operand:
                        raise _UnreadableError("an operator is missing in front of '('")
                    pieces.append(space + "(")
                    outer_exponents.append(is_exponent)
                    is_exponent = False
                case "sign", ")" if is_operand:
                    pieces.append(")")
                    is_exponent = outer_exponents.pop() if outer_exponents else False
                case "sign", ",":
                    pieces.append(",")
                    is_operand = is_exponent = False
                case "sign", operator if operator in OPERATORS:
                    sign = SIGNS.get(operator, operator)
                    if sign == "^" and is_exponent:
                        raise _UnreadableError("a power of a power without brackets is not read")
                    if not is_operand and sign not in ("+", "-"):
                        raise _unreadable(tokens)
                    is_exponent = sign == "^" or (is_exponent and not is_operand)  # the sign of an exponent: 2^-1
                    pieces.append(space + sign)
                    is_operand = False
                case _:
                    raise _unreadable(tokens)
            k = end
        if not is_operand:
            text = _text(tokens)[:40]
            raise _UnreadableError(f"{text!r} ends where a number or a name was expected")
        return pieces

    def _name(self, tokens: Tokens, k: int) -> tuple[int, Formula]:
        """Return where the name at k ends, its index, its member or its argument included, and its formula."""
        name = tokens[k].text
        behind = [token.text if token.kind in ("sign", "name") else "" for token in tokens[k + 1 : k + 4]]
        if behind[:1] == ["{"]:
            raise _UnreadableError(f"{name}{{...}} is not read")
        if behind[:1] == ["."]:
            if len(behind) < 2 or tokens[k + 2].kind != "name":
                raise _UnreadableError(f"{name}.(...) is not read")
            text = f"{name}.{behind[1]}"
            if behind[2:] and behind[2] in ("(", ".", "{"):
                raise _UnreadableError(f"{text}{behind[2]} is not read")
            return k + 3, Formula(text, (Read(name, 0, len(text), member=behind[1]),))
        if behind[:1] != ["("]:
            return k + 1, Formula(name, (Read(name, 0, len(name)),))
        end = k + 1 + closing(tokens[k + 1 : k + 1 + MAX_INDEX_TOKENS], 0)
        inside = tokens[k + 2 : end] if tokens[end].text == ")" else tokens[k + 1 : k + 2]
        if name in ("diff", "sym") and not self.is_bound(name):
            formula = _time_derivative(inside) if name == "diff" else _exact_number(inside)
            if formula is None:
                raise _unreadable(tokens[k : end + 1])
            return end + 1, formula
        if [token.text for token in inside] == ["t"] and name not in FUNCTIONS:
            at = len(name) + 1
            return end + 1, Formula(f"{name}(t)", (Read(name, 0, len(name)), Read("t", at, at + 1, use=Use.TIME)))
        if name in FUNCTIONS and not self.is_bound(name):
            return k + 2, Formula(f"{name}(", (Read(name, 0, len(name), use=Use.CALL),))
        index = constant_index(inside)
        if index is None:
            raise _unreadable(tokens[k : end + 1])
        text = f"{name}({', '.join(str(i + 1) for i in index)})"
        return end + 1, Formula(text, (Read(name, 0, len(text), index),))


def _unreadable(tokens: Tokens) -> _UnreadableError:
    return _UnreadableError(f"{_text(tokens)[:40]!r} is not read")


def _unwrap(tokens: Tokens) -> tuple[Tokens, list[Read]]:
    """Take simplify(...) and brackets around everything away; return also the names of the functions."""
    reads: list[Read] = []
    for _ in range(MAX_WRAPPERS):
        if len(tokens) <= 2:
            break
        inner = tokens[1:-1]
        if not (tokens[0].is_sign("(") and closing(tokens, 0) == len(tokens) - 1):
            inner = _first_argument(tokens[2:-1])
            is_precision = is_call(tokens, "vpa") and len(inner) == len(tokens) - 3
            if not (is_precision or is_call(tokens, *UNCHANGED)):
                break
            reads.append(Read(tokens[0].text, 0, 0, use=Use.CALL))
        if not inner or inner[0].kind == "row":
            break
        tokens = inner
    return tokens, reads


def _zeros(tokens: Tokens) -> Formula | None:
    """Return zeros(...) as a matrix of zeros, perhaps in sym(...)."""
    while is_call(tokens, "sym"):
        tokens = tokens[2:-1]
    if not is_call(tokens, "zeros"):
        return None
    return Formula(_text(tokens), (Read("zeros", 0, 0, use=Use.CALL),), is_zeros=True)


def _symbol_vector(tokens: Tokens) -> Formula | None:
    """Return the entries of sym('q', [2 1])."""
    if len(tokens) < 6 or not is_call(tokens, "sym") or tokens[2].kind != "string" or tokens[3].text != ",":
        return None
    shape = [token.text for token in tokens[5 : closing(tokens, 4)] if token.kind == "number"]
    lengths = [int(k) for k in shape if k.isdecimal() and len(k) <= 3]
    if tokens[4].text != "[" or len(shape) != 2 or len(lengths) != 2 or 1 not in lengths or max(lengths) > MAX_INDEX:
        return None
    letters = tokens[2].text[1:-1].replace("%d", "")
    if not re.fullmatch(r"[A-Za-z]\w*", letters, re.ASCII):
        return None
    return vector_of_names([f"{letters}{k + 1}" for k in range(max(lengths))])


def _without_row_brackets(rows: list[list[Tokens]]) -> list[list[Tokens]] | None:
    """Return rows that stand in brackets of their own as rows; None where brackets stand elsewhere."""
    if not any(entry[0].text == "[" for row in rows for entry in row):
        return rows
    plain: list[list[Tokens]] = []
    for entry, *rest in rows:
        if rest or entry[0].text != "[" or closing(entry, 0) != len(entry) - 1:
            return None
        inner = split_rows(entry[1:-1])
        if len(inner) != 1 or any(piece[0].text == "[" for piece in inner[0]):
            return None
        plain += inner
    return plain


def _are_factors(before: Tokens, after: Tokens) -> bool:
    """Whether what stands before and behind a matrix multiplies or divides it."""
    for tokens, inner in ((before, before[1:]), (after, after)):
        depth = 0
        for k, token in enumerate(inner):
            depth += token.nesting
            previous = inner[k - 1].text if k else ""
            if depth == 0 and token.is_sign("+", "-") and previous not in OPERATORS:
                return False
        if any(token.kind == "row" for token in tokens):
            return False
    begins = not before or before[-1].text in ("*", ".*") or [token.text for token in before] in (["-"], ["+"])
    return begins and (not after or after[0].text in ("*", ".*", "/", "./"))


def constant_index(inside: Tokens) -> Index | None:
    """Return the index, from 0, between brackets; None where it is not made of whole numbers."""
    numbers, commas = inside[::2], inside[1::2]
    if len(inside) % 2 == 0 or any(token.text != "," for token in commas):
        return None
    if not all(t.kind == "number" and t.text.isdecimal() and 0 < int(t.text[:5]) <= MAX_INDEX for t in numbers):
        return None
    return tuple(int(token.text) - 1 for token in numbers)


def _time_derivative(inside: Tokens) -> Formula | None:
    """Return diff(q1, t), diff(q1(t), t, 2) and diff(q1, t, t) as the reader of formulas has them."""
    text = "".join(token.text for token in inside)
    match = re.fullmatch(r"([A-Za-z]\w*)(?:\(t\))?,t(,[2t])?", text, re.ASCII)
    if match is None:
        return None
    reads = (Read(match[1], 0, 0), Read("t", 0, 0, use=Use.TIME), Read("diff", 0, 0, use=Use.CALL))
    return Formula(f"diff({match[1]}, t{', 2' if match[2] else ''})", reads)


def _exact_number(inside: Tokens) -> Formula | None:
    """Return sym(1), sym(1/3) and sym('1/3') as numbers."""
    text = "".join(token.text for token in inside)
    text = text[1:-1] if inside and inside[0].kind == "string" and len(inside) == 1 else text
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(/\d+(?:\.\d+)?)?|pi", text, re.ASCII)
    return Formula(f"({text})", (Read("sym", 0, 0, use=Use.CALL),)) if match else None


def _number(tokens: Tokens) -> float | None:
    """Return the value of a number or of a quotient of two; None of any other formula."""
    text = "".join(token.text for token in tokens)
    match = re.fullmatch(r"([-+]?)(\d+\.?\d*(?:[eE][-+]?\d{1,3})?|\.\d+)(?:/(\d+\.?\d*))?", text, re.ASCII)
    divisor = float(match[3] or 1) if match else 0.0
    return float(match[1] + match[2]) / divisor if match and divisor else None


def _first_argument(tokens: Tokens) -> Tokens:
    depths = accumulate(token.nesting for token in tokens)
    commas = (k for k, depth in enumerate(depths) if depth == 0 and tokens[k].is_sign(","))
    return tokens[: next(commas, len(tokens))]


def _text(tokens: Tokens) -> str:
    """Return tokens in one line, with the spaces between them."""
    pieces = [(" " if token.is_spaced or token.kind == "row" else "") + token.text.strip() for token in tokens]
    return "".join(pieces).strip()
