"""Random changes of trees: ones that keep the value, and single slips that may not."""

from __future__ import annotations

from grading.data.trees import VARIABLE, mapped, names_in, places, replaced

ONE, TWO = ("n", "1"), ("n", "2")
PI = ("s", "pi")


def flat(tree):
    """Join sums in sums and products in products, and signs of signs."""

    def join(node):
        if node[0] in "+*":
            items = []
            for one in node[1:]:
                items += one[1:] if one[0] == node[0] else (one,)
            return items[0] if len(items) == 1 else (node[0], *items)
        if node[0] == "-" and node[1][0] == "-":
            return node[1][1]
        return node

    return mapped(tree, join)


def function(name, *arguments):
    return ("f", name, *arguments)


def is_call(tree, *names):
    return tree[0] == "f" and tree[1] in names


def sum_of(a, b):
    return ("+", a, b)


def less(a, b):
    return ("+", a, ("-", b))


# What keeps the value: each returns a new node, or None where it does not apply.


def commuted(node, rng):
    if node[0] not in "+*":
        return None
    items = list(node[1:])
    rng.shuffle(items)
    return (node[0], *items)


def distributed(node, rng):
    if node[0] != "*" or not any(one[0] == "+" for one in node[1:]):
        return None
    k = rng.choice([i for i, one in enumerate(node) if i and one[0] == "+"])
    rest = [one for i, one in enumerate(node) if i and i != k]
    items = []
    for term in node[k][1:]:
        items.append(("-", ("*", *rest, term[1])) if term[0] == "-" else ("*", *rest, term))
    return ("+", *items)


def factored(node, rng):
    if node[0] != "+":
        return None
    found = []
    for term in node[1:]:
        inner = term[1] if term[0] == "-" else term
        found.append(set(inner[1:]) if inner[0] == "*" else set())
    common = sorted(set.intersection(*found)) if found else []
    if not common:
        return None
    shared = rng.choice(common)
    items = []
    for term in node[1:]:
        inner = list((term[1] if term[0] == "-" else term)[1:])
        inner.remove(shared)
        rest = inner[0] if len(inner) == 1 else ("*", *inner) if inner else ONE
        items.append(("-", rest) if term[0] == "-" else rest)
    return ("*", shared, ("+", *items))


def neutral(node, rng):
    if node[0] == "n":
        return None
    own = sorted(names_in(node) - {"pi"})
    other = rng.choice([ONE, TWO, ("n", "0.25"), *(("s", one) for one in own)])
    return rng.choice(
        [
            ("*", ONE, node),
            ("/", ("*", TWO, node), TWO),
            ("+", node, other, ("-", other)),
            ("-", ("-", node)),
            ("^", node, ONE) if node[0] != "-" else ("*", ONE, node),
            ("*", ("/", ("n", "3"), ("n", "6")), TWO, node),
            ("+", ("*", ("n", "0.75"), node), ("*", ("n", "0.25"), node)),
        ]
    )


def pythagoras(node, rng):
    if not is_call(node, "sin", "cos"):
        return None
    one = ("+", ("^", function("sin", node[2]), TWO), ("^", function("cos", node[2]), TWO))
    return ("*", node, one)


def shifted(node, rng):
    quarter = ("/", PI, TWO)
    if is_call(node, "cos"):
        x = node[2]
        return rng.choice(
            [
                function("sin", sum_of(x, quarter)),
                function("cos", ("-", x)),
                ("-", function("cos", sum_of(x, PI))),
            ]
        )
    if is_call(node, "sin"):
        x = node[2]
        return rng.choice(
            [
                function("cos", less(x, quarter)),
                ("-", function("sin", ("-", x))),
                function("sin", less(PI, x)),
            ]
        )
    return None


def angle_sums(node, rng):
    if not is_call(node, "sin", "cos") or node[2][0] != "+" or len(node[2]) != 3:
        return None
    a, b = node[2][1:]
    sign = 1
    if b[0] == "-":
        b, sign = b[1], -1
    sa, ca, sb, cb = function("sin", a), function("cos", a), function("sin", b), function("cos", b)
    if node[1] == "sin":
        return (sum_of if sign > 0 else less)(("*", sa, cb), ("*", ca, sb))
    return (less if sign > 0 else sum_of)(("*", ca, cb), ("*", sa, sb))


def doubled(node, rng):
    if node[0] == "^" and node[2] == TWO and is_call(node[1], "sin", "cos"):
        double = function("cos", ("*", TWO, node[1][2]))
        if node[1][1] == "cos":
            return rng.choice(
                [
                    ("/", sum_of(ONE, double), TWO),
                    less(ONE, ("^", function("sin", node[1][2]), TWO)),
                ]
            )
        return rng.choice(
            [("/", less(ONE, double), TWO), less(ONE, ("^", function("cos", node[1][2]), TWO))]
        )
    return None


def product_to_sum(node, rng):
    if node[0] != "*":
        return None
    calls = [k for k, one in enumerate(node) if k and is_call(one, "sin", "cos")]
    if len(calls) < 2:
        return None
    i, j = calls[:2]
    a, b = node[i][2], node[j][2]
    plus, minus = sum_of(a, b), less(a, b)
    kinds = node[i][1] + node[j][1]
    both = {
        "coscos": sum_of(function("cos", minus), function("cos", plus)),
        "sinsin": less(function("cos", minus), function("cos", plus)),
        "sincos": sum_of(function("sin", plus), function("sin", minus)),
        "cossin": less(function("sin", plus), function("sin", minus)),
    }[kinds]
    return ("*", *(one for k, one in enumerate(node) if k and k not in (i, j)), ("/", both, TWO))


def powers(node, rng):
    if node[0] == "^" and node[2] == TWO:
        return ("*", node[1], node[1])
    return None


def numbers(node, rng):
    if (
        node[0] == "/"
        and node[1][0] == node[2][0] == "n"
        and node[1][1].isdigit()
        and node[2][1].isdigit()
    ):
        a, b = int(node[1][1]), int(node[2][1])
        k = rng.choice([2, 3, 5])
        return ("/", ("n", str(a * k)), ("n", str(b * k)))
    if node[0] == "/" and node[2] == TWO:
        return ("*", ("n", rng.choice(["0.5", "0.50", ".5", "5e-1"])), node[1])
    if node[0] == "n" and node[1].isdigit() and int(node[1]) > 1:
        return ("+", ("n", str(int(node[1]) - 1)), ONE)
    return None


def divided(node, rng):
    if node[0] == "/" and node[1][0] == "*":
        first, *rest = node[1][1:]
        return ("*", ("/", first, node[2]), *rest)
    return None


def tangent(node, rng):
    # The tangent of a constant angle may be undefined: pi/2.
    if is_call(node, "sin") and any(VARIABLE.fullmatch(name) for name in names_in(node)):
        return ("*", function("tan", node[2]), function("cos", node[2]))
    return None


REWRITINGS = [
    *(
        commuted,
        distributed,
        factored,
        neutral,
        pythagoras,
        shifted,
        angle_sums,
        doubled,
        product_to_sum,
        powers,
    ),
    *(numbers, divided, tangent),
]


def inside_angle(tree, path):
    """Whether a path leads into an argument of a sine or into an exponent."""
    node = tree
    for k in path:
        if node[0] == "f" or (node[0] == "^" and k == 2):
            return True
        node = node[k]
    return False


def rewritten(tree, rng, steps):
    """Return a tree of the same value after some random steps, with their names."""
    done = []
    for _ in range(20 * steps):
        if len(done) == steps:
            break
        rule = rng.choice(REWRITINGS)
        spots = [path for path, _ in places(tree) if not inside_angle(tree, path)]
        path = rng.choice(spots)
        node = tree
        for k in path:
            node = node[k]
        new = rule(node, rng)
        if new is not None and new != node:
            tree = flat(replaced(tree, path, new))
            done.append(rule.__name__)
    return tree, done


# Slips: each returns a new node, or None.


def sign(node, rng):
    if node[0] == "-":
        return node[1]
    if node[0] == "+":
        k = rng.randrange(1, len(node))
        one = node[k]
        return (*node[:k], one[1] if one[0] == "-" else ("-", one), *node[k + 1 :])
    return None


def operator(node, rng):
    if node[0] == "+" and len(node) == 3 and node[2][0] != "-":
        return ("*", *node[1:])
    if node[0] == "*":
        k = rng.randrange(1, len(node) - 1) if len(node) > 2 else 1
        rest = node[k + 1 :]
        left = node[1] if k == 1 else ("*", *node[1 : k + 1])
        right = rest[0] if len(rest) == 1 else ("*", *rest)
        return rng.choice([("+", left, right), ("/", left, right)])
    if node[0] == "/":
        return ("*", node[1], node[2])
    return None


def name(node, rng):
    if node[0] != "s" or node[1] == "pi":
        return None
    joint = VARIABLE.fullmatch(node[1])
    if joint:
        other = {"1": "2", "2": "1"}[joint[2]]
        return ("s", joint[1] + other)
    choices = [one for one in ("m1", "m2", "l1", "l2", "g") if one != node[1]]
    return ("s", rng.choice(choices))


def small_coefficient(node, rng):
    """One unit or more in the last of 5 to 13 digits of a number."""
    if node[0] not in "s*f" or node == PI:
        return None
    k = rng.randrange(5, 13)
    gap = rng.choice([1, 1, 2, 7])
    factor = (
        ("n", "1." + str(gap).zfill(k))
        if rng.random() < 0.5
        else ("n", "0." + str(10**k - gap).zfill(k))
    )
    return ("*", factor, node)


def large_coefficient(node, rng):
    if node[0] == "n" and node[1].isdigit():
        return ("n", str(int(node[1]) + rng.choice([1, 2, 10])))
    if node[0] in "s*f":
        return rng.choice(
            [("*", TWO, node), ("/", node, TWO), ("*", ("n", "1.5"), node), ("*", ("n", "0"), node)]
        )
    return None


def exponent(node, rng):
    if node[0] == "^":
        return rng.choice(
            [node[1], ("^", node[1], ("n", "3")), ("^", node[1], ("n", "4")), ("*", TWO, node[1])]
        )
    if node[0] == "s" and node != PI:
        return ("^", node, TWO)
    return None


def function_name(node, rng):
    if is_call(node, "sin", "cos"):
        other = {"sin": "cos", "cos": "sin"}[node[1]]
        return function(rng.choice([other, other, "tan"]), node[2])
    return None


def term(node, rng):
    if node[0] in "+*" and len(node) > 2:
        k = rng.randrange(1, len(node))
        if rng.random() < 0.5:
            return (node[0], *node[1:], node[k])
        rest = [one for i, one in enumerate(node) if i and i != k]
        return rest[0] if len(rest) == 1 else (node[0], *rest)
    return None


def bracket(node, rng):
    if node[0] == "*":
        spots = [k for k, one in enumerate(node) if k and one[0] == "+"]
        if spots:
            k = rng.choice(spots)
            first, *rest = node[k][1:]
            others = [one for i, one in enumerate(node) if i and i != k]
            moved = (
                ("-", ("*", *others, rest[0][1])) if rest[0][0] == "-" else ("*", *others, rest[0])
            )
            return ("+", first, moved, *rest[1:])
    if is_call(node, "sin", "cos") and node[2][0] == "+":
        return ("+", function(node[1], node[2][1]), *node[2][2:])
    if node[0] == "^" and node[1][0] in "+*":
        *rest, last = node[1][1:]
        return (
            node[1][0],
            *rest,
            ("^", last, node[2]) if last[0] != "-" else ("-", ("^", last[1], node[2])),
        )
    return None


def angle(node, rng):
    if is_call(node, "sin", "cos"):
        other = rng.choice(
            [
                ("-", node[2]),
                ("*", TWO, node[2]),
                ("/", node[2], TWO),
                sum_of(node[2], ("/", PI, TWO)),
                sum_of(node[2], ("s", "q2")),
                sum_of(node[2], ("n", "1e-7")),
            ]
        )
        return function(node[1], other)
    return None


SLIPS = [
    sign,
    operator,
    name,
    small_coefficient,
    large_coefficient,
    exponent,
    function_name,
    term,
    bracket,
    angle,
]


def slipped(tree, rng):
    """Return a tree with one random slip, and which."""
    while True:
        rule = rng.choice(SLIPS)
        path, node = rng.choice(list(places(tree)))
        if (
            rule in (small_coefficient, large_coefficient)
            and inside_angle(tree, path)
            and rng.random() < 0.7
        ):
            continue
        new = rule(node, rng)
        if new is not None and new != node:
            return replaced(tree, path, new), rule.__name__
