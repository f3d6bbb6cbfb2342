"""Other ways to write the same: what people and computer algebra make of a truth."""

from __future__ import annotations

import sympy as sp
from sympy.simplify.fu import TR7

from grading.data.checking import to_tree
from grading.data.trees import mapped


def angles(expression):
    """Return the joint variables inside sines and cosines."""
    inside = [f.args[0] for f in expression.atoms(sp.sin, sp.cos)]
    return sorted({s for a in inside for s in a.free_symbols if s.name[0] == "q"}, key=str)


def single_angles(e):
    """Sines and cosines of single angles, multiplied out."""
    return sp.expand(sp.expand_trig(e))


def by_mass(e):
    """Collect by masses."""
    masses = sorted((s for s in e.free_symbols if s.name[0] == "m"), key=str)
    return sp.collect(sp.expand(e), masses)


def by_rate(e):
    """Collect by products of rates."""
    rates = sorted((s for s in e.free_symbols if s.name[:2] == "qd"), key=str)
    return sp.collect(sp.expand(e), [a * b for k, a in enumerate(rates) for b in rates[k:]])


def by_cosine(e):
    """Collect by sines and cosines."""
    return sp.collect(sp.expand(e), sorted(e.atoms(sp.sin, sp.cos), key=str))


def factored(e):
    """Factor."""
    return sp.factor(e)


def common_denominator(e):
    """Bring everything over one denominator."""
    return sp.together(sp.expand(e))


def shifted(e):
    """Cosines as sines of the angle and a quarter turn."""
    return e.replace(sp.cos, lambda x: sp.Function("sin")(x + sp.Symbol("pi") / 2)).replace(
        sp.Function("sin"), lambda x: sp.Function("sin")(x)
    )


def sines_shifted(e):
    """Sines as cosines of the angle less a quarter turn."""
    return e.replace(sp.sin, lambda x: sp.Function("cos")(x - sp.Symbol("pi") / 2))


def half_angles(e):
    """Write sines and cosines by the tangent of the half angle."""
    t = lambda x: sp.tan(x / 2)  # noqa: E731
    return (
        single_angles(e)
        .replace(sp.cos, lambda x: (1 - t(x) ** 2) / (1 + t(x) ** 2))
        .replace(sp.sin, lambda x: 2 * t(x) / (1 + t(x) ** 2))
    )


def squares(e):
    """Double angles as squares."""

    def two(f):
        a = sp.expand(f.args[0] / 2)
        return all(c.is_Integer for c in sp.Poly(a, *sorted(a.free_symbols, key=str)).coeffs())

    e = e.replace(
        lambda f: f.func is sp.cos and f.args[0].free_symbols and two(f),
        lambda f: 1 - 2 * sp.sin(f.args[0] / 2) ** 2,
    )
    return e.replace(
        lambda f: f.func is sp.sin and f.args[0].free_symbols and two(f),
        lambda f: 2 * sp.sin(f.args[0] / 2) * sp.cos(f.args[0] / 2),
    )


def doubles(e):
    """Squares as double angles."""
    return TR7(single_angles(e))


FORMS = {
    "as_is": sp.expand,
    "by_mass": by_mass,
    "factored": factored,
    "single_angles": single_angles,
    "common_denominator": common_denominator,
    "by_cosine": by_cosine,
    "by_rate": by_rate,
    "shifted": shifted,
    "sines_shifted": sines_shifted,
    "squares": squares,
    "doubles": doubles,
    "half_angles": half_angles,
}


def applied(form, value):
    """Apply a form to nested lists of expressions and return trees."""
    if isinstance(value, list):
        return [applied(form, one) for one in value]
    return to_tree(FORMS[form](sp.sympify(value)))


def decimals(value, digits, always=False):
    """Write quotients of numbers as decimals of so many significant digits; others as they are."""

    def fold(node):
        if node[0] == "/" and node[2][0] == "n":
            if node[1][0] == "n":
                return ("n", rounded(node[1][1], node[2][1], digits))
            return (
                "*",
                ("n", rounded("1", node[2][1], digits)),
                *(node[1][1:] if node[1][0] == "*" else (node[1],)),
            )
        return node

    if isinstance(value, list):
        return [decimals(one, digits) for one in value]
    return mapped(value, fold)


def rounded(above, below, digits) -> str:
    """Return a quotient in decimals; 17 digits print as a double does."""
    if digits == 17:
        return f"{float(above) / float(below):.17g}"
    return f"{float(above) / float(below):.{digits}g}"
