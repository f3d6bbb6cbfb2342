"""Formulas as small trees: read from Python text, evaluated in 50 digits, printed in the notations of students.

Nothing here comes from dhkit, so that the corpus and the fuzz laws judge it from outside. A tree is a tuple:

``("n", "0.25")``, ``("s", "l1")``, ``("+", a, b, ...)``, ``("-", a)``, ``("*", a, b, ...)``, ``("/", a, b)``,
``("^", a, b)`` and ``("f", "sin", a, ...)``. Joint variables are q1, q2, ..., their rates qd1, accelerations qdd1.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

import mpmath

DIGITS = 50
FUNCTIONS = {
    "sin",
    "cos",
    "tan",
    "sqrt",
    "atan",
    "atan2",
    "acos",
    "asin",
    "abs",
    "exp",
    "sec",
    "cot",
    "min",
    "max",
}
VARIABLE = re.compile(r"(qdd|qd|q)(\d+)")
SHORTHAND = re.compile(r"([sc])(\d{1,4})")


def number(value) -> tuple:
    """Return the tree of an integer or a fraction."""
    text = str(value)
    if text.startswith("-"):
        return ("-", number(text[1:]))
    if "/" in text:
        above, below = text.split("/")
        return ("/", ("n", above), ("n", below))
    return ("n", text)


def angle_sum(digits: str) -> tuple:
    """Return q1 + q2 for "12"."""
    terms = [("s", f"q{k}") for k in digits]
    return terms[0] if len(terms) == 1 else ("+", *terms)


@lru_cache(maxsize=4096)
def parse(text: str, own: tuple[str, ...] = ()) -> tuple:
    """Read Python's notation; s12 and c12 are sines and cosines unless they are names of one's own."""
    return _read(ast.parse(" ".join(text.split()).replace("^", "**"), mode="eval").body, own, text)


def _read(node, own, text):
    def again(child):
        return _read(child, own, text)

    match node:
        case ast.Constant():
            return ("n", ast.get_source_segment(" ".join(text.split()).replace("^", "**"), node))
        case ast.Name(id=name):
            short = SHORTHAND.fullmatch(name)
            if short and name not in own:
                return ("f", "sin" if short[1] == "s" else "cos", angle_sum(short[2]))
            return ("s", name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return ("-", again(operand))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return again(operand)
        case ast.BinOp(op=ast.Add() | ast.Sub() as sign, left=left, right=right):
            first, second = again(left), again(right)
            if isinstance(sign, ast.Sub):
                second = ("-", second)
            return ("+", *(first[1:] if first[0] == "+" else (first,)), second)
        case ast.BinOp(op=ast.Mult(), left=left, right=right):
            first, second = again(left), again(right)
            if first[0] == "-":
                inner = first[1]
                return ("-", ("*", *(inner[1:] if inner[0] == "*" else (inner,)), second))
            return ("*", *(first[1:] if first[0] == "*" else (first,)), second)
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            first, second = again(left), again(right)
            return ("-", ("/", first[1], second)) if first[0] == "-" else ("/", first, second)
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            return ("^", again(left), again(right))
        case ast.Call(func=ast.Name(id=name), args=args) if name.lower() in FUNCTIONS:
            return ("f", name.lower(), *(again(one) for one in args))
    raise ValueError(f"no formula: {ast.dump(node)}")


def names_in(tree) -> set[str]:
    """Return the symbols of a tree."""
    if tree[0] == "s":
        return {tree[1]}
    if tree[0] == "n":
        return set()
    return set().union(*(names_in(child) for child in tree[1:] if isinstance(child, tuple)))


def evaluate(tree, state):
    """Return a tree's value, in mpmath's numbers."""
    kind = tree[0]
    if kind == "n":
        return mpmath.mpf(tree[1])
    if kind == "s":
        return mpmath.pi if tree[1] == "pi" else state[tree[1]]
    if kind == "f":
        return _function(tree[1], [evaluate(one, state) for one in tree[2:]])
    values = [evaluate(one, state) for one in tree[1:]]
    if kind == "+":
        return mpmath.fsum(values)
    if kind == "-":
        return -values[0]
    if kind == "*":
        return mpmath.fprod(values)
    if kind == "/":
        return values[0] / values[1]
    return values[0] ** (int(values[1]) if values[1] == int(values[1]) else values[1])


def _function(name, values):
    if name in ("abs", "min", "max"):
        return {"abs": abs, "min": min, "max": max}[name](*values)
    return getattr(mpmath, name)(*values)


# Paths into a tree.


def places(tree, at=()):
    """Yield every subtree with its path."""
    yield at, tree
    for k, child in enumerate(tree):
        if isinstance(child, tuple):
            yield from places(child, (*at, k))


def replaced(tree, path, new):
    """Return a tree with one subtree replaced."""
    if not path:
        return new
    head, *rest = path
    return (*tree[:head], replaced(tree[head], rest, new), *tree[head + 1 :])


def mapped(tree, change):
    """Return a tree rebuilt from its leaves, each node passed through ``change``."""
    return change(
        tuple(mapped(child, change) if isinstance(child, tuple) else child for child in tree)
    )


def terms(tree) -> list[tuple[int, tuple]]:
    """Return the terms of a sum with their signs."""
    found = []
    for one in tree[1:] if tree[0] == "+" else (tree,):
        found.append((-1, one[1]) if one[0] == "-" else (1, one))
    return found


def summed(parts) -> tuple:
    """Return the sum of signed terms."""
    items = [("-", one) if sign < 0 else one for sign, one in parts]
    return ("n", "0") if not items else items[0] if len(items) == 1 else ("+", *items)


# Printing.


@dataclass(frozen=True)
class Notation:
    """How formulas are written.

    Attributes
    ----------
    kind
        python, matlab, latex, mathematica, maple, maxima, unicode or c.
    q, qd, qdd
        Patterns of the joint variables' names, with ``{}`` for the number.
    shorthand
        Whether sines and cosines of sums of joint angles are written c12.
    times
        The sign of a product.
    options
        latex: "dfrac", "mathrm", "left"; python: prefix of functions such as "np.".
    names
        Own names for symbols.
    """

    kind: str = "python"
    q: str = "q{}"
    qd: str = "qd{}"
    qdd: str = "qdd{}"
    shorthand: bool = False
    times: str = "*"
    power: str = "**"
    divide: str = "/"
    options: frozenset = frozenset()
    names: dict = field(default_factory=dict)
    prefix: str = ""
    first: int = 1


SUM, PRODUCT, SIGN, POWER, ATOM = range(1, 6)
MATHEMATICA = {
    "sin": "Sin",
    "cos": "Cos",
    "tan": "Tan",
    "sqrt": "Sqrt",
    "abs": "Abs",
    "atan": "ArcTan",
}
GREEK = {"beta": r"\beta"}
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def written(tree, notation: Notation) -> str:
    """Return a formula in a notation."""
    return (_latex if notation.kind == "latex" else _linear)(tree, notation)[0]


def symbol(name: str, notation: Notation) -> str:
    """Return a symbol in a notation."""
    if name in notation.names:
        return notation.names[name]
    joint = VARIABLE.fullmatch(name)
    if joint:
        pattern = {"q": notation.q, "qd": notation.qd, "qdd": notation.qdd}[joint[1]]
        index = int(joint[2]) - 1 + notation.first
        return pattern.format(
            str(index).translate(SUBSCRIPTS) if notation.kind == "unicode" else index
        )
    if notation.kind == "latex":
        if name == "pi":
            return r"\pi"
        parts = re.fullmatch(r"([A-Za-z]+?)(\d*)", name)
        if name in GREEK:
            return GREEK[name]
        if parts and len(parts[1]) > 1:  # lc1 -> l_{c1}
            return f"{parts[1][0]}_{{{parts[1][1:]}{parts[2]}}}"
        return (
            f"{parts[1]}_{{{parts[2]}}}"
            if parts and len(parts[2]) > 1
            else name[0] + (f"_{parts[2]}" if parts[2] else "")
        )
    if notation.kind == "unicode":
        return (
            name.translate(SUBSCRIPTS)
            if re.fullmatch(r"[A-Za-z]\d", name)
            else {"beta": "β", "pi": "π"}.get(name, name)
        )
    if name == "pi":
        return {"mathematica": "Pi", "maple": "Pi", "maxima": "%pi"}.get(
            notation.kind, notation.prefix + "pi"
        )
    return name


def _angle_digits(tree, notation):
    """Return "12" for q1 + q2 where that is all."""
    parts = tree[1:] if tree[0] == "+" else (tree,)
    found = [re.fullmatch(r"q(\d)", one[1]) if one[0] == "s" else None for one in parts]
    digits = "".join(one[1] for one in found if one) if all(found) else ""
    return digits if digits and list(digits) == sorted(set(digits)) else ""


def _bracket(pair, least, left="(", right=")"):
    text, level = pair
    return text if level >= least else f"{left}{text}{right}"


def _linear(tree, notation):
    kind = tree[0]
    if kind == "n":
        text = tree[1]
        if notation.kind == "mathematica" and "e" in text:
            mantissa, exponent = text.split("e")
            return f"{mantissa}*^{int(exponent)}", ATOM
        return (text + ".0" if notation.kind == "c" and text.isdigit() else text), ATOM
    if kind == "s":
        return symbol(tree[1], notation), ATOM
    if kind == "+":
        text = ""
        for k, one in enumerate(tree[1:]):
            negative = one[0] == "-"
            part = _bracket(
                _linear(one[1] if negative else one, notation), PRODUCT if k or negative else SUM
            )
            if part.startswith("-") and k:
                part = f"({part})"
            text += (" - " if negative else " + ") + part if k else ("-" if negative else "") + part
        return text, SUM
    if kind == "-":
        return "-" + _bracket(
            _linear(tree[1], notation), SIGN if tree[1][0] in "+-" else PRODUCT
        ), SUM
    if kind == "*":
        parts = []
        for k, one in enumerate(tree[1:]):
            least = POWER if one[0] in "+-" else PRODUCT if not k else SIGN
            parts.append(_bracket(_linear(one, notation), least))
        return _product(parts, notation), PRODUCT
    if kind == "/":
        above = _bracket(_linear(tree[1], notation), PRODUCT)
        below = _bracket(_linear(tree[2], notation), POWER)
        return f"{above}{notation.divide}{below}", PRODUCT
    if kind == "^":
        base = _bracket(_linear(tree[1], notation), ATOM)
        if notation.kind == "unicode" and tree[2][0] == "n" and tree[2][1].isdigit():
            if tree[1][0] == "f":
                base = f"({base})"
            return base + tree[2][1].translate(SUPERSCRIPTS), POWER
        if notation.kind == "c":
            exponent = _linear(tree[2], notation)[0].removesuffix(".0")
            return f"pow({_linear(tree[1], notation)[0]}, {exponent})", ATOM
        return f"{base}{notation.power}{_bracket(_linear(tree[2], notation), ATOM)}", POWER
    if notation.shorthand and tree[1] in ("sin", "cos"):
        digits = _angle_digits(tree[2], notation)
        if digits:
            digits = digits.translate(SUBSCRIPTS) if notation.kind == "unicode" else digits
            return tree[1][0] + digits, ATOM
    arguments = ", ".join(_linear(one, notation)[0] for one in tree[2:])
    if notation.kind == "mathematica":
        return f"{MATHEMATICA[tree[1]]}[{arguments}]", ATOM
    if notation.kind == "unicode" and tree[1] == "sqrt":
        return f"√({arguments})", ATOM
    return f"{notation.prefix}{tree[1]}({arguments})", ATOM


def _product(parts, notation):
    if notation.times.strip():
        return notation.times.join(parts)
    text = parts[0]
    for one in parts[1:]:
        text += (" · " if one[0] in ".0123456789" else " ") + one
    return text


def _latex(tree, notation):
    kind = tree[0]
    if kind == "n":
        if "e" in tree[1]:
            mantissa, exponent = tree[1].split("e")
            return rf"{mantissa}\times 10^{{{int(exponent)}}}", PRODUCT
        return tree[1], ATOM
    if kind == "s":
        return symbol(tree[1], notation), ATOM
    left, right = (r"\left(", r"\right)") if "left" in notation.options else ("(", ")")

    def bracket(one, least):
        return _bracket(_latex(one, notation), least, left, right)

    if kind == "+":
        text = ""
        for k, one in enumerate(tree[1:]):
            negative = one[0] == "-"
            part = bracket(one[1] if negative else one, PRODUCT if k or negative else SUM)
            if part.startswith("-") and k:
                part = f"{left}{part}{right}"
            text += (" - " if negative else " + ") + part if k else ("-" if negative else "") + part
        return text, SUM
    if kind == "-":
        return "-" + bracket(tree[1], SIGN if tree[1][0] in "+-" else PRODUCT), SUM
    if kind == "*":
        parts = [bracket(one, POWER if one[0] in "+-" else PRODUCT) for one in tree[1:]]
        text = parts[0]
        for before, one in pairwise(parts):
            numbers = before.replace(".", "").isdigit() and one.startswith(
                ("\\frac", "\\dfrac", "\\tfrac")
            )
            text += (r" \cdot " if numbers or one[0] in ".0123456789" else notation.times) + one
        return text, PRODUCT
    if kind == "/":
        frac = (
            r"\dfrac"
            if "dfrac" in notation.options
            else r"\tfrac"
            if "tfrac" in notation.options
            else r"\frac"
        )
        return f"{frac}{{{_latex(tree[1], notation)[0]}}}{{{_latex(tree[2], notation)[0]}}}", POWER
    if kind == "^":
        exponent = _latex(tree[2], notation)[0]
        exponent = exponent if len(exponent) == 1 else f"{{{exponent}}}"
        if tree[1][0] == "f" and tree[1][1] in ("sin", "cos", "tan"):
            text = _latex(tree[1], notation)[0]
            if "_" in text[:14] and not text.startswith(("\\sin", "\\cos", "\\tan")):
                return f"{text}^{exponent}", POWER
            return f"\\{tree[1][1]}^{exponent}{text[4:]}", POWER
        base = bracket(tree[1], ATOM)
        if (
            tree[1][0] == "s"
            and VARIABLE.fullmatch(tree[1][1])
            and tree[1][1] not in notation.names
        ):
            return f"{base}^{exponent}", POWER
        return f"{base}^{exponent}", POWER
    name = tree[1]
    if notation.shorthand and name in ("sin", "cos"):
        digits = _angle_digits(tree[2], notation)
        if digits:
            letter = rf"\mathrm{{{name[0]}}}" if "mathrm" in notation.options else name[0]
            return f"{letter}_{{{digits}}}" if len(digits) > 1 else f"{letter}_{digits}", ATOM
    if name == "sqrt":
        return rf"\sqrt{{{_latex(tree[2], notation)[0]}}}", ATOM
    if name == "abs":
        return rf"\left|{_latex(tree[2], notation)[0]}\right|", ATOM
    inside = ", ".join(_latex(one, notation)[0] for one in tree[2:])
    bare = "bare" in notation.options and len(tree) == 3 and tree[2][0] == "s"
    command = {
        "atan2": r"\operatorname{atan2}",
        "acos": r"\arccos",
        "atan": r"\arctan",
        "asin": r"\arcsin",
    }
    head = command.get(name, "\\" + name)
    return (f"{head} {inside}" if bare else f"{head}{left}{inside}{right}"), POWER if bare else ATOM


PYTHON = Notation()
NOTATIONS = {
    "python": PYTHON,
    "numpy": Notation(q="q[{}]", qd="qd[{}]", qdd="qdd[{}]", prefix="np.", first=0),
    "sympy": Notation(q="theta{}", qd="theta{}_dot", qdd="theta{}_ddot", prefix="sp."),
    "theta": Notation(q="theta{}", qd="dtheta{}", qdd="ddtheta{}"),
    "q1dot": Notation(q="q{}", qd="q{}dot", qdd="q{}ddot"),
    "dq1": Notation(q="q{}", qd="dq{}", qdd="ddq{}", power="^"),
    "short": Notation(shorthand=True, times=" ", power="^", qd="q{}dot", qdd="q{}ddot"),
    "short_star": Notation(shorthand=True, power="^", qd="dq{}", qdd="ddq{}"),
    "prime": Notation(q="th{}", qd="th{}'", qdd="th{}''", power="^"),
    "matlab": Notation("matlab", q="q({})", qd="dq({})", qdd="ddq({})", power="^"),
    "matlab_dots": Notation(
        "matlab", q="q{}", qd="qd{}", qdd="qdd{}", times=".*", power=".^", divide="./"
    ),
    "matlab_names": Notation("matlab", q="th{}", qd="thd{}", qdd="thdd{}", power="^"),
    "latex": Notation(
        "latex", q=r"\theta_{}", qd=r"\dot{{\theta}}_{}", qdd=r"\ddot{{\theta}}_{}", times=" "
    ),
    "latex_q": Notation(
        "latex",
        q="q_{}",
        qd=r"\dot q_{}",
        qdd=r"\ddot q_{}",
        times=" ",
        options=frozenset({"left"}),
    ),
    "latex_short": Notation(
        "latex",
        q=r"\theta_{}",
        qd=r"\dot\theta_{}",
        qdd=r"\ddot\theta_{}",
        times=" ",
        shorthand=True,
    ),
    "latex_roman": Notation(
        "latex",
        q="q_{}",
        qd=r"\dot{{q}}_{}",
        qdd=r"\ddot{{q}}_{}",
        times=r"\,",
        shorthand=True,
        options=frozenset({"mathrm", "dfrac", "left"}),
    ),
    "latex_bare": Notation(
        "latex",
        q=r"\theta_{}",
        qd=r"\dot{{\theta}}_{}",
        qdd=r"\ddot{{\theta}}_{}",
        times=r" \cdot ",
        options=frozenset({"bare", "dfrac"}),
    ),
    "latex_braces": Notation(
        "latex",
        q=r"\theta_{{{}}}",
        qd=r"\dot{{\theta}}_{{{}}}",
        qdd=r"\ddot{{\theta}}_{{{}}}",
        times=" ",
        options=frozenset({"left", "tfrac"}),
    ),
    "mathematica": Notation(
        "mathematica", q="q{}[t]", qd="q{}'[t]", qdd="q{}''[t]", times=" ", power="^"
    ),
    "mathematica_star": Notation(
        "mathematica", q="\\[Theta]{}[t]", qd="\\[Theta]{}'[t]", qdd="\\[Theta]{}''[t]", power="^"
    ),
    "maple": Notation(
        "maple",
        q="theta[{}](t)",
        qd="diff(theta[{}](t), t)",
        qdd="diff(theta[{}](t), t, t)",
        power="^",
    ),
    "maxima": Notation("maxima", q="q{}", qd="'diff(q{}, t)", qdd="'diff(q{}, t, 2)", power="^"),
    "unicode": Notation("unicode", q="θ{}", qd="θ̇{}", qdd="θ̈{}", times="·", power="^"),
    "unicode_q": Notation("unicode", q="q{}", qd="q̇{}", qdd="q̈{}", times=" ", power="^"),
    "c": Notation("c", q="q[{}]", qd="qd[{}]", qdd="qdd[{}]", first=0),
}


def matrix(rows, notation: Notation, layout: str = "") -> str:
    """Return a matrix in the notation's own writing; rows hold trees."""
    cells = [[written(one, notation) for one in row] for row in rows]
    if notation.kind == "latex":
        name = layout or "bmatrix"
        body = " \\\\ ".join(" & ".join(row) for row in cells)
        return rf"\begin{{{name}}} {body} \end{{{name}}}"
    if notation.kind == "mathematica":
        return "{" + ", ".join("{" + ", ".join(row) + "}" for row in cells) + "}"
    if notation.kind == "maxima":
        return "matrix(" + ", ".join("[" + ", ".join(row) + "]" for row in cells) + ")"
    if notation.kind == "maple":
        return "Matrix([" + ", ".join("[" + ", ".join(row) + "]" for row in cells) + "])"
    if notation.kind == "matlab":
        return "[" + "; ".join(", ".join(row) for row in cells) + "]"
    return "[" + ", ".join("[" + ", ".join(row) + "]" for row in cells) + "]"
