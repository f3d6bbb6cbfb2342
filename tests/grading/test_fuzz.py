"""Two laws of random text: another writing of a right answer is never refused, and a slip never passes.

Trees, notations, rewritings and the evaluator in 50 digits are those of `data/`, which knows nothing of dhkit.
"""

import inspect
import random
from collections import Counter
from functools import lru_cache
from pathlib import Path

import mpmath
import pytest

from acceptance import ACCEPTING
from dhkit.description import library_robot, read_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade, grade_answers
from grading.data import derive
from grading.data.checking import states, trees
from grading.data.layouts import matlab_file, python_file, tex_file, whole_texts
from grading.data.rewriting import REWRITINGS, SLIPS, rewritten, slipped
from grading.data.trees import (
    DIGITS,
    NOTATIONS,
    Notation,
    evaluate,
    names_in,
    places,
    replaced,
    written,
)

pytestmark = pytest.mark.slow

ROBOTS = Path(__file__).parent / "data" / "robots"
ARMS = ("planar2r", "polar_rp", "cart_pendulum", "double_pendulum", "gantry", "craig2r")
QUANTITIES = ("M", "h", "g", "V", "K", "tau")
PLAIN = (
    *(
        "python",
        "dq1",
        "short_star",
        "matlab",
        "matlab_dots",
        "matlab_names",
        "numpy",
        "theta",
        "prime",
        "q1dot",
        "c",
    ),
    *(
        "latex",
        "latex_short",
        "latex_q",
        "latex_bare",
        "latex_braces",
        "unicode",
        "mathematica",
        "maxima",
    ),
)
SAMPLES = 20_000
WHOLE = 0.3
"""Share of matrices that are written as one text."""
DOCUMENTS = 0.2
"""Share of answers that stand in a document."""
SAME, DIFFERENT = mpmath.mpf("1e-40"), mpmath.mpf("1e-20")
WITHOUT_DIAGNOSIS = (
    {"explain": False} if "explain" in inspect.signature(grade_answers).parameters else {}
)
FILES_WITHOUT = {"explain": False} if "explain" in inspect.signature(grade).parameters else {}


@lru_cache(maxsize=1)
def truths():
    """Answers of every arm as trees, and the arms as dhkit reads them."""
    found = {}
    for name in ARMS:
        own = ROBOTS / f"{name}.toml"
        known = derive.derive(derive.library()[name])
        answers = {quantity: trees(known[quantity]) for quantity in QUANTITIES}
        found[name] = (read_robot(own) if own.exists() else library_robot(name), answers)
    return found


def entries(answer, at=()):
    """Paths of the entries of nested lists that are not zero."""
    if isinstance(answer, list):
        return [path for k, one in enumerate(answer) for path in entries(one, (*at, k))]
    return [] if answer == ("n", "0") else [at]


def changed(answer, path, new):
    """Nested lists with one entry replaced."""
    if not path:
        return new
    return [changed(one, path[1:], new) if k == path[0] else one for k, one in enumerate(answer)]


def entry(answer, path):
    for k in path:
        answer = answer[k]
    return answer


@lru_cache(maxsize=4096)
def state_of(names, quantity):
    """A few states: for V all with the same parameters, since it counts from any zero."""
    found = states(set(names), seed=11, count=3)
    if quantity == "V":
        found = [{k: v if k[0] == "q" else found[0][k] for k, v in one.items()} for one in found]
    return found


def gap(quantity, mine, right, fixed=()):
    """Return the largest relative difference over the states, some parameters fixed; None where one has no value."""
    names = tuple(sorted((names_in(mine) | names_in(right)) - {"pi"}))
    pairs = []
    with mpmath.workdps(DIGITS):
        try:
            for free in state_of(names, quantity):
                state = {**free, **dict(fixed)}
                pairs.append((evaluate(mine, state), evaluate(right, state)))
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        size = max(1, *(abs(value) for pair in pairs for value in pair))
        zero = pairs[0][0] - pairs[0][1] if quantity == "V" else 0
        return max(abs(a - b - zero) for a, b in pairs) / size


def as_text(answer, notation, rng):
    """Return an answer as the API takes it: text by entry, or one text of a matrix."""
    if (
        isinstance(answer, list)
        and rng.random() < WHOLE
        and notation.kind in ("latex", "matlab", "python")
    ):
        return whole_texts({"x": answer}, notation)["x"]
    return by_entry(answer, notation)


def by_entry(answer, notation):
    return (
        [by_entry(one, notation) for one in answer]
        if isinstance(answer, list)
        else written(answer, notation)
    )


def with_intermediate(text_of, answer, rng):
    """A program that gives a subtree a name before its use."""
    path = rng.choice(entries(answer))
    one = entry(answer, path)
    spots = [(at, node) for at, node in places(one) if node[0] in "+*f" and at]
    if not spots:
        return text_of(answer)
    at, node = rng.choice(spots)
    head = f"part = {written(node, Notation(q='q{}', qd='dq{}', qdd='ddq{}', prefix='np.'))}\n"
    text = text_of(changed(answer, path, replaced(one, at, ("s", "part"))))
    import_line, _, rest = text.partition("\n")
    return f"{import_line}\n{head}{rest}"


def judged(robot, quantity, answer, rng, folder):
    """Grade in a random notation or document; return the verdict and what was handed in."""
    document = rng.random() < DOCUMENTS
    if not document:
        notation = NOTATIONS[rng.choice(PLAIN)]
        text = as_text(answer, notation, rng)
        try:
            report = grade_answers(robot, {quantity: text}, **WITHOUT_DIAGNOSIS)
        except AnswerError as error:
            return f"unreadable: {error}", text
    else:
        style, kind = rng.randrange(12), rng.choice(("m", "py", "py", "tex", "tex"))
        makers = {"m": matlab_file, "tex": tex_file, "py": python_file}
        if kind == "py" and rng.random() < 0.5:
            text = with_intermediate(lambda new: python_file({quantity: new}, 5), answer, rng)
        else:
            text = makers[kind]({quantity: answer}, style)
        path = folder / f"answer.{kind}"
        path.write_text(text)
        try:
            report = grade(path, robot, **FILES_WITHOUT)
        except AnswerError as error:
            return f"unreadable: {error}", f"({kind}) {text}"
        text = f"({kind}) {text}"
    verdict = report.verdict.value
    return (f"{verdict}: {report.fault}" if verdict == "unreadable" else verdict), text


def drawn(rng):
    """An arm, a quantity and one of its entries."""
    name = rng.choice(ARMS)
    robot, answers = truths()[name]
    while True:
        quantity = rng.choice(QUANTITIES)
        if paths := entries(answers[quantity]):
            return name, robot, quantity, answers[quantity], rng.choice(paths)


def shortest(failures):
    """The failures that are quickest to read."""
    lines = [
        f"{name} {quantity} {what}: {verdict}\n    {text}"
        for name, quantity, what, verdict, text in failures
    ]
    return "\n" + "\n".join(sorted(lines, key=len)[:8])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def test_another_writing_is_never_refused(law, folder):
    rng, failures, used, asked = random.Random(1), [], Counter(), 0
    for _ in range(law.samples(SAMPLES)):
        name, robot, quantity, answer, path = drawn(rng)
        right = entry(answer, path)
        mine, steps = rewritten(right, rng, rng.randrange(1, 5))
        found = gap(quantity, mine, right)
        assert found is None or found < SAME, (steps, mine)
        used.update(steps)
        if found is None:
            continue
        verdict, text = judged(robot, quantity, changed(answer, path, mine), rng, folder)
        if "counted from 0" in verdict:
            # In C's notation with q[1] alone nothing tells that indices count from 0: dhkit must ask.
            assert "[0]" not in str(text), text
            asked += 1
            continue
        if verdict.split(":")[0] in ("wrong", "unreadable", "incomplete"):
            failures.append((name, quantity, "+".join(steps), verdict, text))
    assert not ACCEPTING or set(used) == {rule.__name__ for rule in REWRITINGS}
    law.holds("right answers that are refused", len(failures), 0, shortest(failures))
    law.holds("share of answers whose indices are asked about", asked / law.samples(SAMPLES), 0.01)


def test_a_slip_never_passes(law, folder):
    rng, failures, used = random.Random(2), [], Counter()
    for _ in range(law.samples(SAMPLES)):
        name, robot, quantity, answer, path = drawn(rng)
        right = entry(answer, path)
        if rng.random() < 0.3:
            right, _ = rewritten(right, rng, 1)
        mine, slip = slipped(right, rng)
        answer = changed(answer, path, mine)
        known = names_in(mine) <= set(robot_names(name))
        found = gap(quantity, mine, right, numbers_of(name, answer))
        if not known or found is None or found < DIFFERENT:
            continue
        used[slip] += 1
        verdict, text = judged(robot, quantity, answer, rng, folder)
        if verdict in ("correct", "correct within rounding", "undecided"):
            failures.append((name, quantity, slip, verdict, text))
    assert not ACCEPTING or set(used) == {rule.__name__ for rule in SLIPS}
    law.holds("slips that pass", len(failures), 0, shortest(failures))


@lru_cache(maxsize=32)
def robot_names(name):
    """Return what a student of this arm may write."""
    one = derive.library()[name]
    return [
        *one.values,
        *(f"{kind}{k + 1}" for kind in ("q", "qd", "qdd") for k in range(one.n)),
        "pi",
    ]


def numbers_of(name, answer):
    """Return the file's numbers of the parameters that an answer lacks: it is judged at these, and 1 may mean 1 kg."""
    used = set().union(*(names_in(entry(answer, path)) for path in entries(answer)))
    return tuple(
        (key, mpmath.mpf(str(value)))
        for key, value in ROBOT_VALUES[name].items()
        if key not in used
    )


ROBOT_VALUES = {name: robot.values for name, robot in derive.library().items()}
