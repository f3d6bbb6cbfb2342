"""Random expressions for programs with branches."""

import casadi as ca

_PAIRS = (
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: b - a,
    lambda a, b: a * b,
    lambda a, b: a / (1.0 + b * b),
    ca.atan2,
    ca.fmin,
    ca.fmax,
    lambda a, b: ca.if_else(ca.logic_and(a < b, ca.logic_not(b == 1.0)), a, -b),
    lambda a, b: ca.if_else(ca.logic_or(a <= 0.0, b != 0.5), b - 1.0, a),
)
_SINGLE = (
    lambda a: -a,
    ca.fabs,
    lambda a: ca.sqrt(ca.fabs(a)),
    ca.sin,
    ca.cos,
    ca.floor,
    lambda a: a < 0.25,
)


def branches_of(rng, symbols, branches):
    """Return expressions (branches, 2) and whole numbers (branches,) for each branch, and one number of them all.

    A step is the same operation for all branches, on the same values or on each branch's own, with signs; or, more
    seldom, another operation for some of them.
    """
    shared = [*ca.vertsplit(ca.vertcat(*symbols)), ca.SX(0.5)]
    own = [[rng.choice([-1.0, 1.0]) * shared[-2] for _ in range(branches)]]
    for _ in range(25):
        operations = [_operation(rng)] * branches
        if rng.random() < 0.3:
            other = _operation(rng)
            operations = [other if rng.random() < 0.5 else operations[0] for _ in range(branches)]
        places = [rng.integers(len(own)), rng.integers(len(shared))]
        mixes = rng.random() < 0.2
        row = []
        for k, operation in enumerate(operations):
            column = rng.integers(branches) if mixes else k
            row.append(operation(own[places[0]][column], shared[places[1]], rng.random() < 0.5))
        own.append(row)
        if rng.random() < 0.3:
            shared.append(
                _operation(rng)(shared[rng.integers(len(shared))], shared[places[1]], True)
            )

    rows = [ca.horzcat(own[-1][k], own[-2][k]) for k in range(branches)]
    counts = [ca.if_else(own[-3][k] > own[-4][k], 3.0, 0.0) for k in range(branches)]
    total = sum(own[-1][k] for k in range(branches)) + own[5][0]
    return rows, counts, total


def _operation(rng):
    """Return a function of two expressions and a truth value, which exchanges them or changes a sign."""
    if rng.random() < 0.35:
        single = _SINGLE[rng.integers(len(_SINGLE))]
        return lambda a, b, turned: -single(a) if turned else single(a)
    pair = _PAIRS[rng.integers(len(_PAIRS))]
    return lambda a, b, turned: pair(b, a) if turned else pair(a, b)
