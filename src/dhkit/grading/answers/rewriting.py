"""Students' notations brought to one: shorthand, derivatives, products without a sign, functions without brackets."""

from __future__ import annotations

import re
from collections.abc import Sequence

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.indices import without_indices
from dhkit.grading.answers.tokens import check_depth, closing_bracket, fail
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary, plain_name

TURNS = ("sin", "cos", "tan")
SHORTHAND = ("c", "s")
CALLED = frozenset(FUNCTION_NAMES.values())
MODULES = frozenset(("np", "numpy", "math", "sp", "sympy", "sym", "ca", "cs", "casadi", "cmath", "mpmath", "mp", "cas"))
ATTRIBUTES = frozenset((*FUNCTION_NAMES, "pi"))
DERIVATIVES = frozenset(("diff", "Derivative"))
MATLAB = re.compile(r"\.[*/^']")
"""Signs that are MATLAB's alone."""
MAX_TOKENS = 300_000


def rewritten(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Return tokens of the plain grammar, in the robot's own names.

    Raises
    ------
    AnswerError
        An unknown name, an attribute, or brackets that do not match.
    """
    check_depth(tokens, text)
    found = _without_modules(_methods(tokens), text)
    found = _without_time(without_indices(_without_primes(found, vocabulary, text), vocabulary, text), vocabulary, text)
    # Square brackets that are left stand for round ones.
    found = [Token("sign", {"[": "(", "]": ")"}.get(x.text, x.text), x.at) if x.kind == "sign" else x for x in found]
    found = _derivatives(found, text)
    found = _fractions_by_time(found, vocabulary, text)
    found = _named(found, vocabulary, text)
    found = _functions(found, text)
    return _products(found)


def _methods(tokens: Sequence[Token]) -> list[Token]:
    """Read q1.diff(t) as diff(q1, t)."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        if [x.text for x in tokens[k : k + 3]] == [".", "diff", "("] and found and found[-1].kind == "name":
            name = found.pop()
            found += [tokens[k + 1], tokens[k + 2], name, Token("sign", ",", tokens[k].at)]
            k += 3
            continue
        found.append(tokens[k])
        k += 1
    return found


def _without_modules(tokens: Sequence[Token], text: str) -> list[Token]:
    """Take np. off np.sin; no other attribute is read."""
    found: list[Token] = []
    for token in tokens:
        if len(found) > 1 and found[-1].text == "." and token.kind == "name" and token.text in ATTRIBUTES:
            module = found[-2]
            if module.kind != "name" or module.text not in MODULES:
                fail(text, module.at, f"an attribute of {module.text!r}, which is not read,")
            del found[-2:]
        found.append(token)
    for token in found:
        if token.text == ".":
            fail(text, token.at, "an attribute, which is not read,")
    return found


def _without_primes(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Read Lagrange's prime behind a joint's variable as a rate, and drop MATLAB's transpose.

    Raises
    ------
    AnswerError
        A prime behind anything but a matrix where nothing else is MATLAB's: it may be a derivative.
    """
    found: list[Token] = []
    for token in tokens:
        if token.text not in ("'", ".'") or not found or (found[-1].kind == "sign" and found[-1].text not in ")]"):
            found.append(token)
            continue
        name = found[-1].text if found[-1].kind == "name" else ""
        if token.text == "'" and vocabulary.is_position(name):
            found[-1] = Token("name", f"{name}dot", found[-1].at)
        elif token.text == "'" and vocabulary.is_position(name.removesuffix("dot")):
            found[-1] = Token("name", f"{name.removesuffix('dot')}ddot", found[-1].at)
        elif token.text == "'" and found[-1].text != "]" and not MATLAB.search(text):
            fail(text, token.at, "a prime that belongs to no joint variable,")
    return found


def _without_time(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Read theta1(t), and Mathematica's theta1[t], as theta1.

    Raises
    ------
    AnswerError
        The robot has a parameter t.
    """
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        found.append(tokens[k])
        is_operand = (tokens[k].kind == "name" and tokens[k].text not in FUNCTION_NAMES) or tokens[k].text in (")", "}")
        behind = [x.text for x in tokens[k + 1 : k + 4]]
        is_of_time = is_operand and behind in (["(", "t", ")"], ["[", "t", "]"])
        if is_of_time and vocabulary.is_exactly("t"):
            fail(text, tokens[k].at, f"{tokens[k].text}(t) may be a function of time, or a product; t is a parameter")
        k += 4 if is_of_time else 1
    return found


ORDERS = {"t": 1, "t,t": 2, "t,2": 2, "(t,2)": 2, "(t,1)": 1, "t,1": 1}
"""Orders of derivatives, by what stands behind the expression that is differentiated."""


def _derivatives(tokens: Sequence[Token], text: str) -> list[Token]:
    """Read diff(theta1, t) and Derivative(l1*theta1(t), (t, 2)) as time derivatives of what stands there."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        token = tokens[k]
        if token.text not in DERIVATIVES or k + 1 == len(tokens) or tokens[k + 1].text != "(":
            found.append(token)
            k += 1
            continue
        end = _closing(tokens, k + 1, text)
        inner = list(tokens[k + 2 : end])
        comma = _comma(inner)
        order = ORDERS.get("".join(x.text for x in inner[comma + 1 :]), 0)
        if not comma or not order:
            fail(text, token.at, "a derivative other than by t")
        found += _by_time(_derivatives(inner[:comma], text), order, token.at)
        k = end + 1
    return found


def _comma(tokens: Sequence[Token]) -> int:
    """Return where the first comma outside brackets is; 0 without one."""
    depth = 0
    for k, token in enumerate(tokens):
        depth += {"(": 1, ")": -1}.get(token.text, 0)
        if depth == 0 and token.text == ",":
            return k
    return 0


def _by_time(inner: Sequence[Token], order: int, at: int) -> list[Token]:
    found = list(inner)
    for _ in range(order):
        found = [Token("function", "ddt", at), Token("sign", "(", at), *found, Token("sign", ")", at)]
    return found


def _fractions_by_time(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Read dtheta1/dt, d(5 theta1)/dt, d/dt(theta1/2) and d^2 theta1/dt^2 as time derivatives."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        token = tokens[k]
        if token.kind == "name" and token.text[0] == "d" and "d" not in vocabulary.own:
            read = _fraction_by_time(tokens, k, vocabulary, text)
            if read is not None:
                found += read[0]
                k = read[1]
                continue
        if token.kind == "name" and token.text == "dt" and not vocabulary.is_own("dt"):
            fail(text, token.at, "dt that belongs to no derivative")
        found.append(token)
        k += 1
    return found


def _fraction_by_time(
    tokens: Sequence[Token], k: int, vocabulary: Vocabulary, text: str
) -> tuple[list[Token], int] | None:
    """Return a derivative that begins with the d at k, and where it ends; None where there is none."""
    token, order, at = tokens[k], 1, k + 1
    if token.text == "d" and [x.text for x in tokens[at : at + 2]] == ["^", "2"]:
        order, at = 2, at + 2
    elif token.text == "d" and [x.text for x in tokens[at : at + 4]] == ["^", "(", "2", ")"]:
        order, at = 2, at + 4
    if token.text == "d" and (end := _over_time(tokens, at, order)):
        stop = _operand(tokens, end, text)  # d/dt(...)
        is_enclosed = end < len(tokens) and (tokens[end].text == "(" or _is_by_time(text, tokens[end].at))
        following = tokens[stop] if stop < len(tokens) else None
        goes_on = following is not None and (following.kind != "sign" or following.text in ("(", "*", "/"))
        is_raised = following is not None and following.text == "^"
        if stop == end or is_raised or (goes_on and not is_enclosed):
            fail(
                text, token.at, "a derivative that may reach further than the name behind it; put brackets around what"
            )
        return _by_time(tokens[end:stop], order, token.at), stop
    if token.text == "d":
        stop = _operand(tokens, at, text)
        end = _over_time(tokens, stop, order) if stop > at else 0
        return (_by_time(tokens[at:stop], order, token.at), end) if end else None
    twice = re.fullmatch(r"d[2d](\w+)", token.text, re.ASCII)
    if twice and vocabulary.is_position(twice[1]) and [x.text for x in tokens[k + 1 : k + 3]] == ["/", "dt2"]:
        return _by_time([Token("name", twice[1], token.at)], 2, token.at), k + 3
    name, end = token.text[1:], _over_time(tokens, k + 1, 1)
    if end and vocabulary.is_state(name):
        return _by_time([Token("name", name, token.at)], 1, token.at), end
    return None


BY_TIME = re.compile(r"\w+\s*(?:\(\s*t\s*\)|\[\s*t\s*\])")


def _is_by_time(text: str, at: int) -> bool:
    """Whether (t) stands behind the name that begins at a place of a text."""
    return BY_TIME.match(text, at) is not None


def _over_time(tokens: Sequence[Token], k: int, order: int) -> int:
    """Return where / dt, or / dt^2, ends that begins at k; 0 where something else stands there."""
    texts = [x.text for x in tokens[k : k + 6]]
    for below in (["/", "dt"], ["/", "d", "t"], ["/", "(", "dt", ")"]):
        if texts[: len(below)] != below:
            continue
        end = k + len(below)
        rest = [x.text for x in tokens[end : end + 4]]
        for power in (["^", "2"], ["^", "(", "2", ")"]):
            if order == 2 and rest[: len(power)] == power:
                return end + len(power)
        return end if order == 1 else 0
    return 0


def _named(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Put in what names stand for."""
    found: list[Token] = []
    for k, token in enumerate(tokens):
        if len(found) > MAX_TOKENS:
            fail(text, token.at, f"more than {MAX_TOKENS} signs, names written out,")
        if token.kind != "name":
            found.append(token)
            continue
        calls = k + 1 < len(tokens) and tokens[k + 1].text in ("(", "^")
        meaning = vocabulary.find(token.text)
        _refuse_ambiguous(tokens, k, vocabulary, text)
        _refuse_shorthand(tokens, k, vocabulary, text)
        is_known = token.text in vocabulary.own or token.text in vocabulary.symbols
        is_raised = calls and tokens[k + 1].text == "^" and is_known
        if token.text in FUNCTION_NAMES and (meaning is None or (calls and not is_raised)):
            found.append(Token("function", FUNCTION_NAMES[token.text], token.at))
        elif meaning is not None:
            found += [_token(word, token.at) for word in meaning]
        else:
            found += _split(token, calls, vocabulary, text)
    return found


def _refuse_shorthand(tokens: Sequence[Token], k: int, vocabulary: Vocabulary, text: str) -> None:
    """Refuse c (...) where c is a parameter or the cosine, c W where W is no angle, and q1(0).

    Raises
    ------
    AnswerError
        One of these.
    """
    name, at = tokens[k].text, tokens[k].at
    behind = [x.text for x in tokens[k + 1 : k + 4]]
    if name in FUNCTION_NAMES and vocabulary.is_exactly(name) and behind[:1] == ["("]:
        fail(
            text, at, f"{name} (...) may be the parameter {name} times the brackets, or a function; write {name}*(...)"
        )
    following = tokens[k + 1] if k + 1 < len(tokens) else None
    is_shorthand = name in SHORTHAND and not vocabulary.is_exactly(name)
    if (
        is_shorthand
        and following is not None
        and following.kind == "name"
        and not _is_angle(following.text, vocabulary)
    ):
        fail(text, at, f"{name} before {following.text[:40]}, which is no angle,")
    if (
        vocabulary.is_state(name)
        and len(behind) == 3
        and behind[0] == "("
        and behind[2] == ")"
        and behind[1].isdecimal()
    ):
        fail(text, at, f"{name}({behind[1][:20]}) may be a value at a time, or a product; write which")


def _is_angle(name: str, vocabulary: Vocabulary) -> bool:
    """Whether a sine may be taken of a name: a joint's variable, or what is no length, mass or other parameter."""
    return vocabulary.is_position(name) or not vocabulary.is_exactly(name)


AMBIGUOUS = re.compile(r"(sin|cos|tan|[sScC](?=\d+[A-Za-z]))(\d+)([A-Za-z]\w*)?", re.ASCII)


def _refuse_ambiguous(tokens: Sequence[Token], k: int, vocabulary: Vocabulary, text: str) -> None:
    """Refuse sin2q1, s2q1 and sin2(q1): the sine of q2 times q1, the sine of 2 q1, or a square."""
    match = AMBIGUOUS.fullmatch(tokens[k].text)
    if match is None or tokens[k].text in vocabulary.own:
        return
    function, number, rest = match.groups()
    following = tokens[k + 1] if k + 1 < len(tokens) else None
    if rest is None and following is not None and following.text == "(":
        fail(
            text,
            tokens[k].at,
            f"{function}{number}(...) may be {function}(...)^{number} or {function} of {number}(...)",
        )
    if rest is None and following is not None and following.kind == "name" and vocabulary.is_position(following.text):
        rest = following.text
    if rest is not None and vocabulary.is_position(rest):
        both = f"{function}({number}*{rest}) or {function}(q{number})*{rest}"
        fail(text, tokens[k].at, f"{tokens[k].text} may be {both}; put brackets")


def _split(token: Token, calls: bool, vocabulary: Vocabulary, text: str) -> list[Token]:
    """Read names that are run together: m2l1, sintheta1, and in front of a bracket l2cos."""
    for function in ("sin", "cos", "tan"):
        name, rest = plain_name(token.text), ""
        if calls and name.endswith(function):
            name, rest = name.removesuffix(function), function
            before = _split(Token("name", name, token.at), False, vocabulary, text) if name else []
            return [*before, *([_token("*", token.at)] if before else []), Token("function", rest, token.at)]
        if name.startswith(function) and vocabulary.is_position(name.removeprefix(function)):
            inner = vocabulary.find(name.removeprefix(function)) or ()
            return [Token("function", function, token.at), *(_token(word, token.at) for word in inner)]
    if vocabulary.knows(token.text):
        return [_token(word, token.at) for word in vocabulary.find(token.text) or ()]
    pieces = vocabulary.split(plain_name(token.text))
    if pieces is None:
        fail(text, token.at, f"unknown name {token.text[:60]!r} ({vocabulary.nearest(token.text[:60])})")
    vocabulary.taken_for[token.text] = " ".join(pieces)
    found: list[Token] = []
    for piece in pieces:
        found += [_token("*", token.at)] if found else []
        found += [_token(word, token.at) for word in vocabulary.find(piece) or ()]
    return found


def _token(word: str, at: int) -> Token:
    if word[0] in "0123456789.":
        return Token("number", word, at)
    if word in CALLED:
        return Token("function", word, at)
    return Token("name" if word[0].isalpha() else "sign", word, at)


def _functions(tokens: Sequence[Token], text: str) -> list[Token]:
    """Give functions their brackets, sin q1 and sin 2 q1, and put powers of functions behind them, sin^2(q1)."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        token = tokens[k]
        k += 1
        if token.kind != "function":
            found.append(token)
            continue
        power: list[Token] = []
        if k < len(tokens) and tokens[k].text == "^":
            end = _operand(tokens, k + 1, text)
            power, k = list(tokens[k:end]), end
            if "".join(x.text for x in power).strip("^()") == "-1":
                if token.text in ("sec", "csc", "cot"):
                    fail(text, token.at, f"{token.text}^-1 may be the inverse function or 1/{token.text}")
                if token.text in ("sin", "cos", "tan"):
                    token, power = Token("function", f"a{token.text}", token.at), []  # cos^-1 is the arc cosine
        end = _operand(tokens, k, text, product=True)
        if token.text == "sqrt" and end - k > 1 and tokens[k].kind == "number":
            both = " ".join(x.text for x in tokens[k:end])
            fail(
                text,
                token.at,
                f"sqrt {both} may be sqrt({both}) or sqrt({tokens[k].text}) times the rest; put brackets",
            )
        argument = _functions(tokens[k:end], text)
        if not argument:
            fail(text, token.at, f"{token.text} without an argument")
        following = tokens[end] if end < len(tokens) else Token("sign", "", token.at)
        goes_on = following.kind in ("name", "function") or (argument[-1].text != ")" and following.text == "/")
        if token.text in TURNS and goes_on and all(x.kind in ("number", "sign") for x in argument):
            fail(text, token.at, f"{token.text} of a number, or of more; put its argument in brackets")
        if argument[0].text != "(" or _closing(argument, 0, text) != len(argument) - 1:
            argument = [Token("sign", "(", token.at), *argument, Token("sign", ")", token.at)]
        found += [Token("call", token.text, token.at), *argument, *power]
        k = end
    return found


def _operand(tokens: Sequence[Token], k: int, text: str, product: bool = False) -> int:
    """Return where an operand ends that begins at k: brackets, or a name, perhaps with numbers in front of it."""
    if k < len(tokens) and tokens[k].text == "(":
        return _closing(tokens, k, text) + 1
    while k < len(tokens) and (tokens[k].text in "+-" if not product else tokens[k].kind == "number"):
        k += 1
    if k < len(tokens) and tokens[k].text == "(" and product:
        return _closing(tokens, k, text) + 1
    return k + 1 if k < len(tokens) and tokens[k].kind in ("name", "number") else k


def _products(tokens: Sequence[Token]) -> list[Token]:
    """Put in the signs of products that stand without one."""
    found: list[Token] = []
    for token in tokens:
        if found:
            before = found[-1]
            ends = before.kind in ("name", "number") or before.text == ")"
            begins = token.kind in ("name", "number", "call") or token.text == "("
            if ends and begins and not (before.kind == "number" == token.kind):
                found.append(Token("sign", "*", token.at))
        found.append(token)
    return [Token("name", token.text, token.at) if token.kind == "call" else token for token in found]


def _closing(tokens: Sequence[Token], k: int, text: str) -> int:
    """Return where the bracket at k closes."""
    end = closing_bracket(tokens, k)
    return end if end < len(tokens) else fail(text, tokens[k].at, "a bracket that does not close")
