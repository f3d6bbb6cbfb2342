"""Students' notations brought to one: shorthand, derivatives, products without a sign, functions without brackets."""

from __future__ import annotations

from collections.abc import Sequence

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.tokens import closing_bracket, fail
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary, plain_name

__all__ = ["rewritten"]

CALLED = frozenset(FUNCTION_NAMES.values())
MODULES = frozenset(("np", "numpy", "math", "sp", "sympy", "sym", "ca", "cs", "casadi", "cmath", "mpmath", "mp", "cas"))
DERIVATIVES = frozenset(("diff", "Derivative"))
MAX_DEPTH = 50
MAX_TOKENS = 300_000


def rewritten(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Return tokens of the plain grammar, in the robot's own names.

    Raises
    ------
    AnswerError
        An unknown name, an attribute, or brackets that do not match.
    """
    _check_depth(tokens, text)
    found = _without_modules(tokens, text)
    found = _without_time(_indexed(_without_primes(found, vocabulary), vocabulary, text), vocabulary)
    # Square brackets that are left stand for round ones.
    found = [Token("sign", {"[": "(", "]": ")"}.get(x.text, x.text), x.at) if x.kind == "sign" else x for x in found]
    found = _derivatives(found, text)
    found = _named(found, vocabulary, text)
    found = _functions(found, text)
    return _products(found)


def _check_depth(tokens: Sequence[Token], text: str) -> None:
    depth = 0
    for token in tokens:
        depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(token.text, 0)
        if depth > MAX_DEPTH:
            fail(text, token.at, f"brackets nested more than {MAX_DEPTH} deep")


def _without_modules(tokens: Sequence[Token], text: str) -> list[Token]:
    """Take np. off np.sin; no other attribute is read."""
    found: list[Token] = []
    for token in tokens:
        if len(found) > 1 and found[-1].text == "." and token.kind == "name" and token.text in FUNCTION_NAMES:
            module = found[-2]
            if module.kind != "name" or module.text not in MODULES:
                fail(text, module.at, f"an attribute of {module.text!r}, which is not read,")
            del found[-2:]
        found.append(token)
    for token in found:
        if token.text == ".":
            fail(text, token.at, "an attribute, which is not read,")
    return found


def _without_primes(tokens: Sequence[Token], vocabulary: Vocabulary) -> list[Token]:
    """Read Lagrange's prime behind a joint's variable as a rate, and drop MATLAB's ' behind anything else.

    A scalar is its own transpose, and nobody transposes theta1.
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
    return found


def _indexed(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Read q[0] as Python's first joint, q(1) as MATLAB's."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        name, *behind = tokens[k : k + 4]
        pattern = [x.text if x.kind == "sign" else x.kind for x in behind]
        if (
            name.kind == "name"
            and pattern in (["[", "number", "]"], ["(", "number", ")"])
            and behind[1].text.isdecimal()
        ):
            number = int(behind[1].text[:4]) + (pattern[0] == "[")
            whole = plain_name(name.text) + str(number)
            is_index = pattern[0] == "[" or (name.text not in FUNCTION_NAMES and not vocabulary.knows(name.text))
            if is_index and vocabulary.knows(whole):
                found.append(Token("name", whole, name.at))
                k += 4
                continue
            if pattern[0] == "[":
                fail(text, name.at, f"unknown name {name.text}[{behind[1].text}]")
        found.append(name)
        k += 1
    return found


def _without_time(tokens: Sequence[Token], vocabulary: Vocabulary) -> list[Token]:
    """Read theta1(t) as theta1."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        found.append(tokens[k])
        is_name = tokens[k].kind == "name" and tokens[k].text not in FUNCTION_NAMES
        of_time = [x.text for x in tokens[k + 1 : k + 4]] == ["(", "t", ")"] and not vocabulary.knows("t")
        k += 4 if is_name and of_time else 1
    return found


def _derivatives(tokens: Sequence[Token], text: str) -> list[Token]:
    """Read diff(theta1, t) and Derivative(theta1, (t, 2)) as rates and accelerations."""
    found: list[Token] = []
    k = 0
    while k < len(tokens):
        token = tokens[k]
        if token.text not in DERIVATIVES or k + 1 == len(tokens) or tokens[k + 1].text != "(":
            found.append(token)
            k += 1
            continue
        end = _closing(tokens, k + 1, text)
        name, *rest = tokens[k + 2 : end]
        order = {",t": 1, ",t,t": 2, ",t,2": 2, ",(t,2)": 2, ",(t,1)": 1}.get("".join(x.text for x in rest))
        if order is None or name.kind != "name":
            fail(text, token.at, "a derivative other than of a joint's variable by t")
        found.append(Token("name", plain_name(name.text) + ("dot", "ddot")[order - 1], name.at))
        k = end + 1
    return found


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
        if token.text in FUNCTION_NAMES and (meaning is None or calls):
            found.append(Token("function", FUNCTION_NAMES[token.text], token.at))
        elif meaning is not None:
            found += [_token(word, token.at) for word in meaning]
        else:
            found += _split(token, calls, vocabulary, text)
    return found


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
            if "".join(x.text for x in power).strip("^()") == "-1" and token.text in ("sin", "cos", "tan"):
                token, power = Token("function", f"a{token.text}", token.at), []  # cos^-1 is the arc cosine
        end = _operand(tokens, k, text, product=True)
        argument = _functions(tokens[k:end], text)
        if not argument:
            fail(text, token.at, f"{token.text} without an argument")
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
