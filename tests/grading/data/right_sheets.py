"""Right answers: by hand, by computer algebra, in every notation, in sheets and documents."""

# ruff: noqa: E501  (a formula stands on one line)

from __future__ import annotations

import sympy as sp

from grading.data.checking import trees
from grading.data.forms import applied, decimals
from grading.data.human import HUMAN
from grading.data.make_corpus import OWN, ROBOTS, truth
from grading.data.trees import Notation, parse

LINEAR = ["python", "dq1", "short", "matlab", "mathematica", "latex_short", "unicode", "prime", "maxima", "latex_roman",
          "maple", "q1dot", "latex_bare", "matlab_dots", "c", "latex", "short_star", "unicode_q", "numpy", "latex_braces",
          "theta", "matlab_names", "latex_q", "mathematica_star", "sympy"]  # fmt: skip
NO_SHORTHAND_FOR_SLIDES = {"polar_rp", "incline_rp", "telescope_mm", "gantry"}
DOCUMENTS = ["m", "py", "tex", "tex", "ipynb", "m", "tex", "py"]
PROVED = ("correct",)
UNDECIDED = ("correct", "correct within rounding", "undecided")


def by_hand(corpus):
    """Formulas written by hand, each in three notations and a document."""
    for robot, sheets in HUMAN.items():
        for k, answers in enumerate(sheets):
            for _ in range(3 if robot in ("planar2r", "double_pendulum", "polar_rp") else 2):
                notation = corpus.turn("hand", LINEAR)
                half = UNDECIDED if "q1/2" in str(answers) else PROVED
                corpus.right(
                    f"hand_{robot}_{k + 1}_{notation}", robot, answers, notation, expected=half
                )
            if not {"K", "A1", "L"} & set(answers):
                layout = corpus.turn("handdoc", DOCUMENTS)
                corpus.right(
                    f"hand_{robot}_{k + 1}_{layout}", robot, answers, layout=layout, expected=PROVED
                )


def by_algebra(corpus):
    """Truths rewritten by computer algebra."""
    plan = ["by_mass", "factored", "single_angles", "common_denominator", "by_cosine", "by_rate", "shifted", "squares",
            "doubles", "sines_shifted"]  # fmt: skip
    sets = [
        ("M", "g"),
        ("h",),
        ("tau",),
        ("K",),
        ("V", "g"),
        ("M",),
        ("h", "g"),
        ("C", "g"),
        ("L",),
        ("T",),
        ("J",),
    ]
    small = [
        r
        for r in ROBOTS
        if r not in ("puma3", "planar3r", "cobra600", "stanford3", "rpr", "cart_double")
    ]
    for robot in ROBOTS:
        for _ in range(6 if robot in small else 4):
            form, quantities = corpus.turn("form", plan), corpus.turn("set", sets)
            if robot == "puma3" and {"tau", "h", "C", "K", "L"} & set(quantities):
                quantities = ("g", "V")
            if form in ("squares", "doubles") and robot == "gantry":
                form = "factored"
            if form == "shifted" and quantities == ("C", "g"):
                form = "by_cosine"
            known = truth(robot)
            answers = {q: applied(form, known[q]) for q in quantities}
            if corpus.turn("algebradoc", range(4)) == 3 and not {"T", "J", "L", "K"} & set(
                quantities
            ):
                layout = corpus.turn("handdoc", DOCUMENTS)
                corpus.right(
                    f"{form}_{robot}_{'_'.join(quantities)}_{layout}", robot, answers, layout=layout
                )
            else:
                notation = corpus.turn("algebra", LINEAR)
                corpus.right(
                    f"{form}_{robot}_{'_'.join(quantities)}_{notation}", robot, answers, notation
                )
    for robot, quantity in (("planar2r", "g"), ("planar2r", "M"), ("cart_pendulum", "M"), ("double_pendulum", "h"),
                            ("pendulum1", "g"), ("craig2r", "g"), ("polar_rp", "V")):  # fmt: skip
        answers = {quantity: applied("half_angles", truth(robot)[quantity])}
        corpus.right(
            f"half_angles_{robot}_{quantity}",
            robot,
            answers,
            corpus.turn("algebra", LINEAR[:6]),
            expected=UNDECIDED,
        )


def from_sympy(corpus):
    """What sympy prints of expressions in functions of time."""
    from sympy.physics.vector.printing import vlatex, vsstrrepr

    t = sp.Symbol("t")

    def timed(expression, letter):
        names = {}
        for s in expression.free_symbols:
            for prefix, order in (("qdd", 2), ("qd", 1), ("q", 0)):
                if s.name.startswith(prefix) and s.name[len(prefix) :].isdigit():
                    f = sp.Function(f"{letter}{s.name[len(prefix) :]}")(t)
                    names[s] = sp.Derivative(f, (t, order)) if order else f
                    break
        return expression.xreplace(names)

    printers = {
        "str": lambda e: str(timed(e, "q")),
        "latex": lambda e: sp.latex(timed(e, "theta_")),
        "vlatex": lambda e: vlatex(timed(e, "q_")),
        "vsstr": lambda e: vsstrrepr(timed(e, "q")),
        "mathematica": lambda e: sp.mathematica_code(e),
        "octave": lambda e: sp.octave_code(e),
        "maple": lambda e: sp.maple_code(e),
        "ccode": lambda e: sp.ccode(e),
        "pycode": lambda e: sp.pycode(e),
        "plain_latex": lambda e: sp.latex(e, mul_symbol="dot"),
        "srepr_free": lambda e: sp.sstr(e, order="grlex"),
        "fcode": lambda e: sp.sstr(e, full_prec=False),
    }
    from grading.data.layouts import toml_sheet

    jobs = [("planar2r", ("M", "g")), ("double_pendulum", ("tau",)), ("rpr", ("g", "h")), ("cart_pendulum", ("h", "M")),
            ("craig2r", ("M", "h", "g")), ("scara3", ("M", "g"))]  # fmt: skip
    for k, (name, render) in enumerate(printers.items()):
        robot, quantities = jobs[k % len(jobs)]

        def text(value, render=render):
            return (
                [text(one) for one in value]
                if isinstance(value, list)
                else render(sp.sympify(value))
            )

        place = f"{robot}.toml" if robot in OWN else robot
        sheet = toml_sheet(place, {q: text(truth(robot)[q]) for q in quantities})
        corpus.raw(f"sympy_{name}_{robot}", robot, ".toml", sheet, PROVED, None, "sympy_" + name)
    for robot, quantity in (("planar2r", "M"), ("double_pendulum", "M"), ("polar_rp", "M")):
        place = f"{robot}.toml" if robot in OWN else robot
        M = sp.Matrix(truth(robot)[quantity])
        for name, text in (("Matrix", str(M)), ("latexMatrix", sp.latex(M)), ("maplecode", sp.maple_code(M)),
                           ("octave", sp.octave_code(M)), ("mathematica", sp.mathematica_code(M.tolist()))):  # fmt: skip
            corpus.raw(f"sympy_whole_{name}_{robot}", robot, ".toml", toml_sheet(place, {quantity: text}), PROVED, None,
                       "sympy_" + name)  # fmt: skip
    pretty = {"double_pendulum": "g", "gantry": "g"}
    for robot, quantity in pretty.items():
        texts = {
            quantity: [sp.pretty(sp.sympify(e), use_unicode=True) for e in truth(robot)[quantity]]
        }
        corpus.raw(
            f"sympy_pretty_{robot}",
            robot,
            ".toml",
            toml_sheet(f"{robot}.toml", texts),
            PROVED,
            None,
            "sympy_pretty",
        )


def from_systems(corpus):
    """What MATLAB's latex(), Mathematica's TeXForm and Maxima's tex() print."""
    letters = [name for robot in ROBOTS.values() for name in robot.values]
    matlab = Notation(
        "latex",
        q="q_{{{}}}",
        qd=r"{{\mathrm{{dq}}}}_{{{}}}",
        qdd=r"{{\mathrm{{ddq}}}}_{{{}}}",
        times=r"\,",
        options=frozenset({"left"}),
        names={name: f"{name[0]}_{{{name[1:]}}}" for name in letters if name[1:].isdigit()},
    )
    mathematica = Notation(
        "latex",
        q=r"\text{{q{}}}(t)",
        qd=r"\text{{q{}}}'(t)",
        qdd=r"\text{{q{}}}''(t)",
        times=" ",
        names={name: rf"\text{{{name}}}" for name in letters if len(name) > 1 and name != "beta"},
    )
    maxima = Notation(
        "latex",
        q=r"{{\it q_{}}}",
        qd=r"\left({{{{d}}\over{{d\,t}}}}\,{{\it q_{}}}\right)",
        qdd=r"\left({{{{d^2}}\over{{d\,t^2}}}}\,{{\it q_{}}}\right)",
        times=r"\,",
        options=frozenset({"left"}),
        names={name: rf"{{\it {name[0]}_{name[1:]}}}" for name in letters if name[1:].isdigit()},
    )
    for robot in ("planar2r", "double_pendulum", "craig2r", "scara3", "geared2r"):
        for label, notation in (
            ("matlab", matlab),
            ("mathematica", mathematica),
            ("maxima", maxima),
        ):
            quantities = corpus.turn("systems", [("M", "g"), ("h",), ("g", "V"), ("tau",)])
            answers = {q: applied("as_is", truth(robot)[q]) for q in quantities}
            name = f"tex_of_{label}_{robot}_{'_'.join(quantities)}"
            corpus.right(name, robot, answers, notation, expected=PROVED)
            corpus.sheets[-1]["notation"] = f"tex_of_{label}"


def own_names(corpus):
    """Names of joint variables and parameters of one's own, and absolute angles."""
    ab = Notation(
        names={
            "q1": "alpha",
            "q2": "beta",
            "qd1": "alphad",
            "qd2": "betad",
            "qdd1": "alphadd",
            "qdd2": "betadd",
        }
    )
    ab_names = {"q": ["alpha", "beta"], "qd": ["alphad", "betad"], "qdd": ["alphadd", "betadd"]}
    w = Notation(
        power="^",
        names={"qd1": "w1", "qd2": "w2", "qdd1": "al1", "qdd2": "al2", "q1": "th1", "q2": "th2"},
    )
    w_names = {"q": ["th1", "th2"], "qd": ["w1", "w2"], "qdd": ["al1", "al2"]}
    phi = Notation(
        "latex", q=r"\varphi_{}", times=" ", names={"qd1": r"\omega_1", "qd2": r"\omega_2"}
    )
    phi_names = {"q": [r"\varphi_1", r"\varphi_2"], "qd": [r"\omega_1", r"\omega_2"]}
    rho = Notation(
        names={
            "q1": "phi",
            "q2": "r",
            "qd1": "phidot",
            "qd2": "rdot",
            "qdd1": "phiddot",
            "qdd2": "rddot",
        }
    )
    rho_names = {"q": ["phi", "r"]}
    x = Notation(
        names={
            "q1": "x",
            "q2": "theta",
            "qd1": "xdot",
            "qd2": "thetadot",
            "qdd1": "xddot",
            "qdd2": "thetaddot",
        }
    )
    x_names = {"q": ["x", "theta"]}
    for robot in ("planar2r", "double_pendulum", "payload2r", "geared2r"):
        for label, notation, names in (
            ("ab", ab, ab_names),
            ("w", w, w_names),
            ("phi", phi, phi_names),
        ):
            quantities = corpus.turn("names", [("M", "h"), ("K",), ("h", "g"), ("tau",)])
            if label == "phi":
                quantities = corpus.turn("namesphi", [("h",), ("M", "h", "g"), ("K", "V")])
            answers = {q: applied("by_mass", truth(robot)[q]) for q in quantities}
            corpus.right(
                f"names_{label}_{robot}_{'_'.join(quantities)}",
                robot,
                answers,
                notation,
                names=names,
            )
    for robot in ("polar_rp", "incline_rp"):
        answers = {q: applied("factored", truth(robot)[q]) for q in ("M", "h", "g", "tau")}
        corpus.right(f"names_rho_{robot}", robot, answers, rho, names=rho_names)
    answers = {q: applied("as_is", truth("cart_pendulum")[q]) for q in ("M", "h", "g", "tau")}
    corpus.right("names_x_cart", "cart_pendulum", answers, x, names=x_names)
    half = {"lc1": "l1/2", "lc2": "l2/2", "I1": "m1*l1^2/12", "I2": "m2*l2^2/12"}
    text = {
        "M": [
            [
                "m1*lc1**2 + I1 + m2*(l1**2 + lc2**2 + 2*l1*lc2*cos(q2)) + I2",
                "m2*(lc2**2 + l1*lc2*cos(q2)) + I2",
            ],
            ["m2*(lc2**2 + l1*lc2*cos(q2)) + I2", "m2*lc2**2 + I2"],
        ],
        "g": ["(m1*lc1 + m2*l1)*g*cos(q1) + m2*lc2*g*cos(q1 + q2)", "m2*lc2*g*cos(q1 + q2)"],
    }
    replace = {"lc1": "(l1/2)", "lc2": "(l2/2)", "I1": "(m1*l1**2/12)", "I2": "(m2*l2**2/12)"}
    reference = {}
    for key, value in text.items():
        reference[key] = [
            [put(e, replace) for e in row] if isinstance(row, list) else put(row, replace)
            for row in value
        ]
    corpus.right("names_lc_check_planar2r", "planar2r", reference, "python")
    for notation in ("python", "latex", "matlab", "mathematica", "latex_braces", "short"):
        answers = {k: trees(v) for k, v in text.items()}
        corpus.add(f"names_lc_planar2r_{notation}", "planar2r", answers, notation, "toml", PROVED, None,
                   names={"parameters": half})  # fmt: skip
    abbreviations = {"a": "m1*l1^2/3 + m2*l1^2 + m2*l2^2/3", "b": "m2*l1*l2/2", "d": "m2*l2^2/3"}
    for notation in ("python", "latex", "matlab"):
        spong = {"M": [["a + 2*b*cos(q2)", "d + b*cos(q2)"], ["d + b*cos(q2)", "d"]],
                 "h": ["-b*sin(q2)*(2*qd1*qd2 + qd2**2)", "b*sin(q2)*qd1**2"]}  # fmt: skip
        corpus.add(f"names_spong_{notation}", "planar2r", {k: trees(v) for k, v in spong.items()}, notation, "toml",
                   PROVED, None, names={"parameters": abbreviations})  # fmt: skip
    absolute(corpus)


def put(text, replace):
    """Replace names in a text."""
    import re

    return re.sub(r"[A-Za-z]\w*", lambda m: replace.get(m[0], m[0]), text)


ABSOLUTE = {
    "planar2r": {
        "M": [
            ["(m1/3 + m2)*l1**2", "m2*l1*l2/2*cos(q2 - q1)"],
            ["m2*l1*l2/2*cos(q1 - q2)", "m2*l2**2/3"],
        ],
        "h": ["-m2*l1*l2/2*sin(q2 - q1)*qd2**2", "m2*l1*l2/2*sin(q2 - q1)*qd1**2"],
        "g": ["(m1/2 + m2)*g*l1*cos(q1)", "m2*g*l2/2*cos(q2)"],
        "V": "(m1/2 + m2)*g*l1*sin(q1) + m2*g*l2/2*sin(q2)",
        "K": "m1*l1**2*qd1**2/6 + m2/2*(l1**2*qd1**2 + l2**2*qd2**2/3 + l1*l2*cos(q1 - q2)*qd1*qd2)",
    },
    "double_pendulum": {
        "M": [["(m1 + m2)*l1**2", "m2*l1*l2*cos(q1 - q2)"], ["m2*l1*l2*cos(q1 - q2)", "m2*l2**2"]],
        "h": ["m2*l1*l2*sin(q1 - q2)*qd2**2", "-m2*l1*l2*sin(q1 - q2)*qd1**2"],
        "g": ["(m1 + m2)*g*l1*sin(q1)", "m2*g*l2*sin(q2)"],
        "L": "(m1 + m2)/2*l1**2*qd1**2 + m2/2*l2**2*qd2**2 + m2*l1*l2*qd1*qd2*cos(q1 - q2)"
        " + (m1 + m2)*g*l1*cos(q1) + m2*g*l2*cos(q2)",
    },
}


def absolute_truth(robot):
    """Return energies and equations in absolute angles, derived from the energies anew."""
    from grading.data import derive

    q1, q2, qd1, qd2 = sp.symbols("q1 q2 qd1 qd2")
    known = truth(robot)
    turn = {q2: q2 - q1, qd2: qd2 - qd1}
    K, V = (derive.fourier(known[e].subs(turn, simultaneous=True)) for e in ("K", "V"))
    return derive.equations(ROBOTS[robot], K, V)


def absolute(corpus):
    """Equations of absolute angles."""
    for robot, known in ABSOLUTE.items():
        reference = absolute_truth(robot)
        for notation, quantities in (("python", ("M", "g")), ("latex", ("M", "h", "g")), ("theta", ("h",)),
                                     ("unicode", ("V" if robot == "planar2r" else "L",))):  # fmt: skip
            answers = {q: known[q] for q in quantities}
            corpus.right(f"absolute_{robot}_{notation}", robot, answers, notation, reference=reference,
                         names={"angles": "absolute"}, expected=PROVED)  # fmt: skip


def in_numbers(corpus):
    """Decimals: of truths with numbers instead of parameters, and of coefficients."""
    rounded = ("correct within rounding", "correct")
    for robot, quantities in (
        ("pan_tilt", ("M", "h", "g")),
        ("cobra600", ("M", "g")),
        ("telescope_mm", ("M", "h", "g")),
    ):
        for digits in (5, 6, 17):
            answers = {q: decimals(applied("as_is", truth(robot)[q]), digits) for q in quantities}
            notation = corpus.turn("numbers", ["python", "latex", "matlab", "mathematica"])
            known = {q: truth(robot)[q] for q in quantities}
            corpus.right(f"numbers_{robot}_{digits}", robot, answers, notation, expected=rounded, reference=known,
                         tolerance=10 ** (2 - digits) if digits < 17 else 1e-15)  # fmt: skip
    for robot in ("planar2r", "scara3", "geared2r"):
        for digits in (4, 5, 6, 17):
            answers = {q: decimals(applied("as_is", truth(robot)[q]), digits) for q in ("M", "h")}
            notation = corpus.turn(
                "numbers", ["latex_short", "matlab_dots", "unicode", "short", "maple", "python"]
            )
            corpus.right(f"thirds_{robot}_{digits}", robot, answers, notation, expected=rounded,
                         tolerance=10 ** (2 - digits) if digits < 17 else 1e-15)  # fmt: skip
    for robot in ("planar2r", "double_pendulum", "polar_rp", "cart_pendulum"):
        values = {sp.Symbol(k): sp.Rational(str(v)) for k, v in ROBOTS[robot].values.items()}
        numbers = {q: sp.sympify(truth(robot)[q]).subs(values) if q == "V" else
                   [sp.sympify(e).subs(values) for e in truth(robot)[q]] for q in ("g", "V")}  # fmt: skip
        answers = {q: decimals(applied("as_is", v), 12) for q, v in numbers.items()}
        corpus.right(f"values_{robot}", robot, answers, "python", values=ROBOTS[robot].values,
                     expected=("correct", "correct within rounding"), tolerance=1e-9)  # fmt: skip


PLANAR_C2 = "(px**2 + py**2 - l1**2 - l2**2)/(2*l1*l2)"
INVERSE = {
    "planar2r": [
        ["atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))", f"acos({PLANAR_C2})"],
        [
            "atan2(py, px) - acos((px**2 + py**2 + l1**2 - l2**2)/(2*l1*sqrt(px**2 + py**2)))",
            "pi - acos((l1**2 + l2**2 - px**2 - py**2)/(2*l1*l2))",
        ],
        [
            "atan2((l1 + l2*cos(q2))*py - l2*sin(q2)*px, (l1 + l2*cos(q2))*px + l2*sin(q2)*py)",
            f"atan2(-sqrt(1 - ({PLANAR_C2})**2), {PLANAR_C2})",
        ],
        [
            "atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))",
            "2*atan(sqrt(((l1 + l2)**2 - px**2 - py**2)/(px**2 + py**2 - (l1 - l2)**2)))",
        ],
    ],
    "polar_rp": [
        ["atan2(py, px)", "sqrt(px**2 + py**2)"],
        ["atan2(-py, -px)", "-sqrt(px**2 + py**2)"],
        ["atan2(py, px)", "px*cos(q1) + py*sin(q1)"],
    ],
    "planar3r": [
        [
            "atan2(py - l3*r21, px - l3*r11) - atan2(l2*sin(q2), l1 + l2*cos(q2))",
            "acos(((px - l3*r11)**2 + (py - l3*r21)**2 - l1**2 - l2**2)/(2*l1*l2))",
            "atan2(r21, r11) - q1 - q2",
        ]
    ],
    "scara3": [
        ["atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))", f"-acos({PLANAR_C2})", "h - pz"]
    ],
    "gantry": [["py", "pz"]],
    "stanford3": [
        [
            "atan2(py, px) - atan2(d2, sqrt(px**2 + py**2 - d2**2))",
            "atan2(px*cos(q1) + py*sin(q1), pz - d1)",
            "sqrt(px**2 + py**2 - d2**2 + (pz - d1)**2)",
        ]
    ],
    "telescope_mm": [["atan2(py, px)", "sqrt(px**2 + py**2) - 0.15"]],
    "craig2r": [["atan2(py, px) - atan2(l2*sin(q2), l1 + l2*cos(q2))", f"acos({PLANAR_C2})"]],
    "pan_tilt": [["atan2(py, px)", "atan2(pz - 0.08, px*cos(q1) + py*sin(q1))"]],
    "rpr": [
        [
            "atan2(py - l3*r21, px - l3*r11)",
            "sqrt((px - l3*r11)**2 + (py - l3*r21)**2)",
            "atan2(r21, r11) - q1",
        ]
    ],
}


INVERSE = {
    robot: [
        [first.replace("q2", f"({rest[0]})") if rest else first, *rest] for first, *rest in branches
    ]
    for robot, branches in INVERSE.items()
}


def ik_notation(kind):
    """Return a notation for poses: LaTeX writes p_x and r_{21}."""
    pose = {f"p{a}": f"p_{a}" for a in "xyz"} | {
        f"r{i}{j}": f"r_{{{i}{j}}}" for i in (1, 2, 3) for j in (1, 2, 3)
    }
    if kind == "latex":
        return Notation("latex", q="q_{}", times=" ", names=pose)
    return Notation() if kind == "python" else Notation(power="^", times="*")


def inverse_sheet(robot, branches, kind="python"):
    """Return a sheet of inverse kinematics."""
    from grading.data.layouts import toml_sheet, toml_value
    from grading.data.trees import written

    notation = ik_notation(kind)
    place = f"{robot}.toml" if robot in OWN else robot
    rows = [[written(parse(f), notation) for f in branch] for branch in branches]
    body = "\n".join(f"    {toml_value(row)}," for row in rows)
    return toml_sheet(place, {}, tables=f"\n[answer.ik]\nbranches = [\n{body}\n]\n")


def closes(robot, branch, poses=6):
    """Return whether a branch gives joint values that lead back to the pose: positions and rotations that are asked for."""
    import mpmath

    from grading.data.checking import states
    from grading.data.trees import evaluate

    known, n = truth(robot), ROBOTS[robot].n
    T = [[parse(str(e), ("g",)) for e in row] for row in known["T"]]
    good = 0
    with mpmath.workdps(50):
        for state in states({f"q{i + 1}" for i in range(n)}, 3, poses, ROBOTS[robot].values):
            for i, link in enumerate(ROBOTS[robot].links):
                if link.kind == "P":
                    state[f"q{i + 1}"] = abs(state[f"q{i + 1}"])
            if robot == "stanford3":
                state["q2"] = abs(state["q2"])
            pose = {**{f"r{i + 1}{j + 1}": evaluate(T[i][j], state) for i in range(3) for j in range(3)},
                    **{f"p{a}": evaluate(T[i][3], state) for i, a in enumerate("xyz")}}  # fmt: skip
            found = {**ROBOTS[robot].values, **pose}
            found = {
                k: mpmath.mpf(str(v)) if isinstance(v, float | int) else v for k, v in found.items()
            }
            try:
                for i, formula in enumerate(branch):
                    found[f"q{i + 1}"] = evaluate(parse(formula), found)
                gap = max(
                    abs(evaluate(T[i][3], found) - pose[f"p{a}"]) for i, a in enumerate("xyz")
                )
                if n == 3 and robot in ("planar3r", "rpr"):
                    gap = max(
                        gap, *(abs(evaluate(T[i][0], found) - pose[f"r{i + 1}1"]) for i in range(2))
                    )
            except (ValueError, ZeroDivisionError, TypeError):
                gap = mpmath.mpf(1)
            good += bool(abs(gap) < mpmath.mpf("1e-30"))
    return good == poses


def inverse(corpus):
    """Inverse kinematics in several closed forms."""
    for robot, branches in INVERSE.items():
        for k, branch in enumerate(branches):
            assert closes(robot, branch), (robot, k)
            kind = corpus.turn("ik", ["python", "latex", "matlab"])
            corpus.raw(f"ik_{robot}_{k + 1}", robot, ".toml", inverse_sheet(robot, [branch], kind),
                       ("correct", "correct within rounding", "undecided"), None, "ik_" + kind)  # fmt: skip


TABLES = {
    "planar2r": ("standard", [["q1", "0", "l1", "0"], ["q2", "0", "l2", "0"]]),
    "polar_rp": ("standard", [["q1 + pi/2", "0", "0", "pi/2"], ["0", "q2", "0", "0"]]),
    "scara3": (
        "standard",
        [["q1", "h", "l1", "0"], ["q2", "0", "l2", "pi"], ["0", "q3", "0", "0"]],
    ),
    "stanford3": (
        "standard",
        [["q1", "d1", "0", "-pi/2"], ["q2", "d2", "0", "pi/2"], ["0", "q3", "0", "0"]],
    ),
    "craig2r": ("modified", [["q1", "0", "0", "0"], ["q2", "0", "l1", "0"]]),
    "puma3": (
        "standard",
        [["q1", "0", "0", "pi/2"], ["q2", "0", "a2", "0"], ["q3", "d3", "a3", "-pi/2"]],
    ),
    "rpr": (
        "standard",
        [["q1 + pi/2", "0", "0", "pi/2"], ["0", "q2", "0", "-pi/2"], ["q3 - pi/2", "0", "l3", "0"]],
    ),
    "telescope_mm": ("standard", [["q1 + pi/2", "0", "0", "pi/2"], ["0", "q2 + 0.15", "0", "0"]]),
    "pan_tilt": ("standard", [["q1", "0.08", "0", "pi/2"], ["q2", "0", "0.05", "0"]]),
}


def table_sheet(robot, convention, rows):
    """Return a sheet with a table."""
    from grading.data.layouts import toml_sheet, toml_value

    place = f"{robot}.toml" if robot in OWN else robot
    body = "\n".join(f"    {toml_value(row)}," for row in rows)
    return toml_sheet(
        place, {}, tables=f'\n[answer.dh]\nconvention = "{convention}"\nrows = [\n{body}\n]\n'
    )


def tables(corpus):
    """Tables, by Python's names and by LaTeX."""
    for robot, (convention, rows) in TABLES.items():
        corpus.raw(
            f"dh_{robot}",
            robot,
            ".toml",
            table_sheet(robot, convention, rows),
            PROVED,
            None,
            "table",
        )
        latex = {"pi/2": r"\frac{\pi}{2}", "-pi/2": r"-\frac{\pi}{2}", "pi": r"\pi", "q1 + pi/2": r"\theta_1 + \pi/2",
                 "q1": r"\theta_1", "q2": "d_2" if robot in ("polar_rp", "rpr") else r"\theta_2"}  # fmt: skip
        if robot in ("planar2r", "polar_rp", "scara3", "stanford3", "rpr"):
            written = [[latex.get(e, e) for e in row] for row in rows]
            corpus.raw(
                f"dh_{robot}_latex",
                robot,
                ".toml",
                table_sheet(robot, convention, written),
                PROVED,
                None,
                "table",
            )


def transforms(corpus):
    """Link transforms, poses and Jacobians."""
    for robot in (
        "rpr",
        "scara3",
        "puma3",
        "polar_rp",
        "stanford3",
        "planar3r",
        "cart_double",
        "pan_tilt",
    ):
        quantities = corpus.turn("kin", [("A1", "A2", "T"), ("T", "J"), ("J",), ("T",)])
        form = corpus.turn("kinform", ["as_is", "single_angles", "factored"])
        answers = {q: applied(form, truth(robot)[q]) for q in quantities}
        notation = corpus.turn(
            "kinnotation", ["python", "latex_short", "matlab", "latex", "mathematica", "maxima"]
        )
        corpus.right(
            f"kin_{robot}_{'_'.join(quantities)}_{notation}",
            robot,
            answers,
            notation,
            expected=PROVED,
        )


def write(corpus):
    """Add them all."""
    by_hand(corpus)
    by_algebra(corpus)
    from_sympy(corpus)
    from_systems(corpus)
    own_names(corpus)
    in_numbers(corpus)
    inverse(corpus)
    tables(corpus)
    transforms(corpus)
