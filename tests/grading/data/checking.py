"""Answers held against truths in numbers, 50 digits, without dhkit: labels of the corpus are facts."""

from __future__ import annotations

import random

import mpmath
import sympy as sp

from grading.data.trees import DIGITS, evaluate, names_in, parse

STATES = 5
SAME = mpmath.mpf("1e-30")


def tree(value):
    """Return a tree of a tree, a text or an expression."""
    return value if isinstance(value, tuple) else parse(str(value), ("g",))


def trees(value):
    """Return nested lists of trees."""
    return [trees(one) for one in value] if isinstance(value, list) else tree(value)


def flat(value, at=()):
    """Yield index and tree of every entry."""
    if isinstance(value, list):
        for k, one in enumerate(value):
            yield from flat(one, (*at, k))
    else:
        yield at, value


def states(names, seed=0, count=STATES, values=None):
    """Return random states: variables and parameters; those with values fixed keep them."""
    rng = random.Random(seed)
    found = []
    with mpmath.workdps(DIGITS):
        for _ in range(count):
            state = {}
            for name in sorted(names):
                low, high = (-2.8, 2.8) if name[0] == "q" else (0.3, 2.0)
                state[name] = mpmath.mpf(rng.randrange(10**18)) / 10**18 * (high - low) + low
            state.update({k: mpmath.mpf(str(v)) for k, v in (values or {}).items()})
            found.append(state)
    return found


def differing(name, answer, truth, values=None, tolerance=SAME):
    """Return which entries of an answer differ from the truth: M12, g1, K. C by C qd; V and L up to a constant."""
    if name == "C":
        answer = [
            ("+", *(("*", one, ("s", f"qd{j + 1}")) for j, one in enumerate(row)))
            for row in trees(answer)
        ]
        truth = [
            ("+", *(("*", one, ("s", f"qd{j + 1}")) for j, one in enumerate(row)))
            for row in trees(truth)
        ]
    pairs = zip(flat(trees(answer)), flat(trees(truth)), strict=True)
    wrong = []
    with mpmath.workdps(DIGITS):
        for (index, mine), (_, right) in pairs:
            label = name + "".join(str(k + 1) for k in index)
            known = names_in(mine) | names_in(right)
            found = states(known - {"pi"}, seed=len(label), values=values)
            if name in ("V", "L"):
                base = found[0]
                found = [
                    {k: (v if k[0] == "q" else base[k]) for k, v in state.items()}
                    for state in found
                ]
            gaps, size = [], mpmath.mpf(0)
            for state in found:
                a, b = evaluate(mine, state), evaluate(right, state)
                gaps.append(a - b)
                size = max(size, abs(a), abs(b), 1)
            if name in ("V", "L"):
                gaps = [gap - gaps[0] for gap in gaps]
            if any(abs(gap) > tolerance * size for gap in gaps):
                wrong.append(label)
    return wrong


def to_tree(expression):
    """Return the tree of a sympy expression."""
    return parse(str(sp.sympify(expression)), ("g",))
