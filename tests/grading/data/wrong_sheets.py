"""Wrong answers with one mistake each: made in a derivation, or in writing it down."""

# ruff: noqa: E501  (a formula stands on one line)

from __future__ import annotations

import re
from dataclasses import replace

import sympy as sp

from grading.data import derive
from grading.data.checking import to_tree, trees
from grading.data.derive import Hooks, exact, q_, qd_
from grading.data.forms import applied
from grading.data.human import HUMAN
from grading.data.make_corpus import OWN, ROBOTS, truth
from grading.data.right_sheets import ABSOLUTE, INVERSE, TABLES, closes, inverse_sheet, table_sheet
from grading.data.trees import NOTATIONS, parse, summed, terms

NOTATION = ["python", "latex_short", "dq1", "matlab", "unicode", "short", "latex", "q1dot", "latex_bare", "matlab_dots",
            "theta", "latex_q", "numpy", "prime", "short_star", "latex_braces", "c", "matlab_names"]  # fmt: skip
DOCUMENTS = [
    "toml",
    "toml",
    "py",
    "toml",
    "m",
    "toml",
    "tex",
    "toml",
    "toml",
    "tex",
    "toml",
    "m",
    "toml",
    "py",
    "ipynb",
]
FORMS = ["as_is", "by_mass", "by_cosine", "as_is", "factored"]
SAME_AS_SCALE = {"parameter_doubled", "parameter_halved"}


ALSO = {
    # The library's own words for some of these mistakes.
    "disc_for_rod": {"disc_for_rod"},
    "point_mass_for_rod": {"point_mass_for_rod"},
    "sphere_for_rod": {"sphere_for_rod"},
    "cylinder_quarter": {"inertia_quarter_for_rod"},
    "rod_with_half_length": {"rod_with_half_length"},
    "rod_about_end": {"rod_about_end"},
    "table_of_other_convention": {"convention_in_dynamics"},
    "alpha_sign": {"twist_sign_in_dynamics"},
    "absolute_not_declared": {"absolute_for_relative"},
    "relative_declared_absolute": {"relative_for_absolute"},
    "relative_declared_absolute_h": {"relative_for_absolute"},
    "cosine_of_sum_by_sum": {"sum_of_angles_split"},
    "sine_of_sum_by_sum": {"sum_of_angles_split"},
    "cosine_of_sum_sign": {"sum_formula_sign", "angle_difference"},
    "cosine_of_difference": {"sum_formula_sign", "angle_difference"},
    "sine_of_sum_sign": {"sum_formula_sign", "angle_difference"},
    "cosine_of_sum_mixed": {"term_function"},
    "cosine_of_second": {"term_angle"},
    "jacobian_rows_exchanged": {"jacobian_halves_exchanged"},
    "no_chain_rule": {"chain_rule_forgotten"},
    "square_of_sum": {"square_of_sum"},
    "square_of_sum_by_squares": {"square_of_sum"},
    "principal_moments_exchanged": {"inertia_moments_exchanged"},
    "friction_without_gear": {"friction_gear"},
    "gear_forgotten": {"rotor_without_gear"},
    "gear_inverted": {"gear_inverted"},
    "gravity_gradient_sign": {"gravity_torque_sign"},
    "gravity_sign": {"gravity_torque_sign"},
    "term_index": {"term_rate"},
    "c11_wrong_rate": {"term_rate"},
    "offset_of_slide_forgotten": {"slide_forgotten"},
    # Where no cause has a name, the term that is wrong is one.
    "inertia_forgotten": {"term_missing"},
    "payload_forgotten": {"term_missing"},
    "length_forgotten": {"term_missing"},
    "half_of_rotation_forgotten": {"term_factor"},
    "half_of_rotor_forgotten": {"term_factor"},
    "mass_counted_twice": {"term_factor"},
    "payload_twice": {"term_factor"},
    "tilt_sign": {"term_sign"},
    "omega_of_own_joint": {"term_missing"},
}


class Writer:
    """Adds wrong sheets, in turn over notations, documents and forms."""

    def __init__(self, corpus):
        self.corpus = corpus

    def derived(self, mistake, robot, accept, quantities, changed=None, hooks=None, tag="", **how):
        """Derive with a changed robot or a changed step."""
        known = derive.derive(changed or ROBOTS[robot], hooks)
        known = {**known, "T": None}
        form = how.pop("form", None) or self.corpus.turn("wrongform", FORMS)
        if robot == "puma3":
            form = "as_is"
        answers = {q: applied(form, known[q]) for q in quantities}
        return self.texts(mistake, robot, accept, answers, tag or "_".join(quantities), **how)

    def texts(self, mistake, robot, accept, answers, tag="", notation=None, layout=None, **how):
        """Add answers as they are."""
        answers = {key: trees(value) for key, value in answers.items()}
        only = {"K", "V", "L"} & set(answers) or any(k[0] == "A" for k in answers)
        layout = layout or ("toml" if only or how else self.corpus.turn("wronglayout", DOCUMENTS))
        notation = notation or self.corpus.turn("wrongnotation", NOTATION)
        name = f"x_{mistake}_{robot}" + (f"_{tag}" if tag else "")
        accept = {accept} if isinstance(accept, str) else set(accept)
        accept |= ALSO.get(mistake, set())
        made = self.corpus.wrong(name, robot, answers, mistake, accept, notation, layout, **how)
        if not made:
            print("no difference:", name)
        return made

    def right_and(self, robot, *quantities):
        """Return right answers to go beside a wrong one."""
        return {q: applied("as_is", truth(robot)[q]) for q in quantities}


def scaled(robot, name, by):
    """Return a robot with a parameter replaced."""
    return substituted(robot, {name: by})


def substituted(robot, replaced):
    """Return a robot whose parameters are replaced in bodies, drives and table."""
    turn = {sp.Symbol(k): exact(v) for k, v in replaced.items()}

    def put(e):
        return e.subs(turn, simultaneous=True) if isinstance(e, sp.MatrixBase | sp.Expr) else e

    links = tuple(
        replace(
            one,
            **{
                k: put(getattr(one, k))
                for k in ("theta", "d", "a", "m", "com", "inertia", "gear", "rotor", "viscous")
            },
        )
        for one in robot.links
    )
    return replace(
        robot,
        links=links,
        base=put(robot.base),
        tool=put(robot.tool),
        payload=put(sp.sympify(robot.payload)),
    )


def origin(k, frames):
    """Return the origin of frame k."""
    return frames[k][:3, 3]


def derivation(w):
    """Mistakes of the derivation."""
    planar = ("planar2r", "double_pendulum", "craig2r", "payload2r", "geared2r", "planar3r")
    R = ROBOTS
    for robot, qs in (("planar2r", ("V", "g")), ("cart_double", ("g",)), ("rpr", ("g",)), ("payload2r", ("V",)),
                      ("incline_rp", ("g",)), ("stanford3", ("V", "g")), ("telescope_mm", ("tau",)),
                      ("pendulum1", ("tau",)), ("scara3", ("g",)), ("gantry", ("tau",))):  # fmt: skip
        down = replace(R[robot], gravity=tuple(-exact(c) for c in R[robot].gravity))
        w.derived(
            "gravity_sign",
            robot,
            {
                "gravity_sign",
                "potential_gradient_sign",
                "parameter_sign",
                "entry_sign",
                "length_sign",
            },
            qs,
            down,
        )
    for robot, i, qs in (("planar2r", 2, ("V", "g")), ("planar3r", 3, ("g",)), ("rpr", 3, ("V",)), ("payload2r", 1, ("g",)),
                         ("geared2r", 1, ("g",)), ("puma3", 3, ("g",))):  # fmt: skip
        hooks = Hooks(height=lambda k, p, F, i=i: origin(i - 1, F) if k == i else p)
        w.derived(
            "height_of_joint",
            robot,
            {"height_at_joint", "parameter_forgotten", "term_missing"},
            qs,
            hooks=hooks,
            tag=f"link{i}",
        )
    for robot, i, qs in (("planar2r", 1, ("g",)), ("geared2r", 2, ("V", "g")), ("payload2r", 2, ("g",)), ("rpr", 3, ("g",)),
                         ("craig2r", 2, ("V",))):  # fmt: skip
        end = (
            (lambda F, r=robot: (F[-1] * R[r].tool)[:3, 3])
            if robot == "craig2r"
            else (lambda F, i=i: origin(i, F))
        )
        hooks = Hooks(height=lambda k, p, F, i=i, end=end: end(F) if k == i else p)
        w.derived("height_of_end", robot,
                  {"height_at_end", "com_at_end", "parameter_for_another", "parameter_doubled"}, qs, hooks=hooks, tag=f"link{i}")  # fmt: skip
    for robot, i in (
        ("planar2r", 2),
        ("geared2r", 1),
        ("payload2r", 2),
        ("cart_pendulum", 2),
        ("rpr", 3),
        ("scara3", 2),
    ):
        moved = derive.with_link(R[robot], i, com=sp.zeros(3, 1))
        w.derived(
            "com_at_end",
            robot,
            {"com_at_end", "parameter_for_another", "velocity_at_end"},
            ("M", "g"),
            moved,
            tag=f"link{i}",
        )
    for robot, i in (
        ("planar2r", 2),
        ("planar3r", 2),
        ("payload2r", 2),
        ("cart_double", 3),
        ("scara3", 2),
        ("rpr", 3),
    ):
        hooks = Hooks(
            omega=lambda k, omega, i=i, robot=robot: _own_rate(omega, k, robot) if k == i else omega
        )
        if robot != "cart_double":
            # The file's link 2 carries the payload.
            split = {"parameter_forgotten"} if robot == "payload2r" else set()
            w.derived(
                "omega_of_own_joint",
                robot,
                {"omega_relative", "inertia_relative"} | split,
                ("K",) if robot == "rpr" else ("M",),
                hooks=hooks,
            )
    for robot, i in (("planar2r", 1), ("planar2r", 2), ("polar_rp", 1), ("payload2r", 2), ("craig2r", 1), ("stanford3", 3),
                     ("rpr", 2), ("telescope_mm", 2), ("pendulum1", 1)):  # fmt: skip
        w.derived("inertia_forgotten", robot, {"inertia_forgotten", "inertia_about_com_at_joint", "parameter_forgotten", "com_inertia_missing"},
                  ("M",), derive.with_link(R[robot], i, inertia=sp.zeros(3)), tag=f"link{i}")  # fmt: skip
    for robot, i, a in (
        ("planar2r", 2, "l2"),
        ("geared2r", 1, "l1"),
        ("cart_pendulum", 2, "l"),
        ("planar3r", 3, "l3"),
        ("scara3", 1, "l1"),
    ):
        length, mass = sp.Symbol(a), R[robot].links[i - 1].m
        for label, share, accept in (
            ("rod_about_end", sp.Rational(1, 3), {"inertia_about_joint"}),
            ("disc_for_rod", sp.Rational(1, 2), {"inertia_of_disc", "inertia_shape"}),
            (
                "point_mass_for_rod",
                sp.S(1),
                {"inertia_of_point", "inertia_shape", "inertia_of_point_mass"},
            ),
            ("cylinder_quarter", sp.Rational(1, 4), {"inertia_shape", "inertia_of_disc_diameter"}),
            ("sphere_for_rod", sp.Rational(2, 5), {"inertia_shape", "inertia_of_sphere"}),
            ("rod_with_half_length", sp.Rational(1, 48), {"inertia_half_length", "inertia_shape"}),
            ("rod_sixth", sp.Rational(1, 6), {"inertia_doubled"}),
        ):
            if robot in ("planar3r", "scara3") and label in (
                "sphere_for_rod",
                "cylinder_quarter",
                "rod_sixth",
            ):
                continue
            tensor = share * mass * length**2 * sp.diag(0, 1, 1)
            extra = (
                {"inertia_about_joint", "inertia_doubled"}
                if label in ("rod_about_end", "rod_sixth")
                else set()
            )
            w.derived(
                label,
                robot,
                accept | extra | {"inertia_shape"},
                ("M",),
                derive.with_link(R[robot], i, inertia=tensor),
                tag=f"link{i}",
            )
    for robot, i in (("planar2r", 1), ("cart_pendulum", 2)):
        length = sp.Symbol("l1" if i == 1 else "l")
        end = derive.with_link(R[robot], i, com=-sp.Matrix([length, 0, 0]))
        w.derived(
            "no_parallel_axis",
            robot,
            {"inertia_about_com_at_joint", "velocity_at_joint"},
            ("M",),
            end,
            tag=f"link{i}",
        )
    for robot, label, hook, accept in (
        ("planar2r", "half_forgotten", lambda k, t, r, o: 2 * (t + r + o), {"half_forgotten"}),
        (
            "double_pendulum",
            "half_forgotten",
            lambda k, t, r, o: 2 * (t + r + o),
            {"half_forgotten", "translation_half_forgotten"},
        ),
        (
            "polar_rp",
            "half_of_rotation_forgotten",
            lambda k, t, r, o: t + 2 * r + o,
            {"rotation_half_forgotten", "inertia_doubled"},
        ),
        (
            "payload2r",
            "half_of_rotation_forgotten",
            lambda k, t, r, o: t + 2 * r + o,
            {"rotation_half_forgotten", "inertia_doubled", "parameter_doubled"},
        ),
        (
            "craig2r",
            "half_of_translation_forgotten",
            lambda k, t, r, o: 2 * t + r + o,
            {"translation_half_forgotten"},
        ),
        (
            "telescope_mm",
            "half_of_translation_forgotten",
            lambda k, t, r, o: 2 * t + r + o,
            {"translation_half_forgotten"},
        ),
        (
            "geared2r",
            "half_of_rotor_forgotten",
            lambda k, t, r, o: t + r + 2 * o,
            {"rotor_doubled", "rotor_half_forgotten", "parameter_doubled"},
        ),
    ):
        w.derived(label, robot, accept, ("M",), hooks=Hooks(kinetic=hook))
        w.derived(label, robot, accept, ("K",), hooks=Hooks(kinetic=hook))
    for robot, qs in (("planar2r", ("M",)), ("craig2r", ("M", "h")), ("cart_double", ("M",))):
        hooks = Hooks(kinetic=lambda k, t, r, o: _no_cross(t) + r + o)
        w.derived(
            "square_of_sum_by_squares",
            robot,
            {"velocity_cross_term", "square_without_cross_term"},
            qs,
            hooks=hooks,
        )
    for robot in (
        "planar2r",
        "double_pendulum",
        "rpr",
        "polar_rp",
        "cart_pendulum",
        "scara3",
        "stanford3",
        "payload2r",
    ):
        qs = w.corpus.turn("ts", [("h",), ("tau",), ("h", "g")])
        w.derived(
            "kinetic_gradient_omitted",
            robot,
            {"kinetic_gradient_omitted", "christoffel_indices"},
            qs,
            hooks=Hooks(gradient=lambda i, e: sp.S(0)),
        )
    for robot in ("planar3r", "polar_rp", "craig2r", "cart_double"):
        w.derived("kinetic_gradient_sign", robot, {"kinetic_gradient_sign", "centrifugal_sign"}, w.corpus.turn("ts", [("h",), ("tau",)]),
                  hooks=Hooks(gradient=lambda i, e: -e))  # fmt: skip
    for robot in ("planar2r", "polar_rp", "rpr", "double_pendulum"):
        w.derived(
            "mass_rate_omitted",
            robot,
            {"mass_rate_omitted"},
            ("h",),
            hooks=Hooks(momentum_rate=lambda i, e: sp.S(0)),
        )
    for robot in ("planar2r", "polar_rp", "stanford3", "scara3", "double_pendulum"):
        w.derived("rate_of_cosine_sign", robot, {"mass_rate_sign", "rate_of_cosine_sign", "coriolis_sign"}, ("h",) if robot != "scara3" else ("tau",),
                  hooks=Hooks(momentum_rate=lambda i, e: -e))  # fmt: skip
    for robot in ("planar2r", "double_pendulum", "craig2r"):
        hooks = Hooks(momentum_rate=lambda i, e, n=R[robot].n: _without_chain(e, n))
        w.derived(
            "no_chain_rule",
            robot,
            {"mass_rate_without_rate", "chain_rule_forgotten", "mass_rate_no_chain_rule"},
            ("h",),
            hooks=hooks,
        )
    factors = {
        "coriolis_missing": (
            lambda i, e: _mixed(e, 0),
            {"coriolis_missing", "velocity_cross_term"},
        ),
        "coriolis_halved": (lambda i, e: _mixed(e, sp.Rational(1, 2)), {"coriolis_halved"}),
        "coriolis_doubled": (lambda i, e: _mixed(e, 2), {"coriolis_doubled"}),
        "coriolis_sign": (lambda i, e: _mixed(e, -1), {"coriolis_sign", "mass_rate_sign"}),
        "centrifugal_missing": (
            lambda i, e: _squares(e, 0),
            {"centrifugal_missing", "kinetic_gradient_omitted"},
        ),
        "centrifugal_sign": (
            lambda i, e: _squares(e, -1),
            {"centrifugal_sign", "kinetic_gradient_sign"},
        ),
        "centrifugal_halved": (
            lambda i, e: _squares(e, sp.Rational(1, 2)),
            {"centrifugal_halved", "kinetic_gradient_halved"},
        ),
        "centrifugal_doubled": (
            lambda i, e: _squares(e, 2),
            {"centrifugal_doubled", "kinetic_gradient_doubled"},
        ),
        "h_doubled": (
            lambda i, e: 2 * e,
            {"velocity_torques_doubled", "half_forgotten", "h_doubled"},
        ),
        "h_halved": (
            lambda i, e: e / 2,
            {"velocity_torques_halved", "h_halved", "half_squared", "mass_rate_halved"},
        ),
        "h_sign": (lambda i, e: -e, {"velocity_torques_sign", "parameter_sign"}),
    }
    homes = ["planar2r", "rpr", "craig2r", "polar_rp", "cart_double", "scara3", "payload2r", "double_pendulum", "telescope_mm",
             "stanford3", "geared2r", "pan_tilt", "cobra600", "incline_rp", "planar3r"]  # fmt: skip
    for label, (hook, accept) in factors.items():
        for _ in range(2):
            robot = w.corpus.turn("homes", homes)
            hooks = Hooks(bias=hook)
            scale = {"entry_doubled", "entry_halved", "entry_sign"} if label[0] == "h" else set()
            w.derived(
                label,
                robot,
                accept | scale,
                w.corpus.turn("ts2", [("h",), ("tau",), ("h", "g")]),
                hooks=hooks,
            )
    for robot in ("payload2r", "rpr", "planar2r", "double_pendulum"):
        w.derived("gravity_gradient_sign", robot, {"gravity_sign", "potential_gradient_sign", "parameter_sign", "entry_sign"}, ("V", "g"),
                  hooks=Hooks(gravity_gradient=lambda i, e: -e))  # fmt: skip
    del planar


def _own_rate(omega, k, robot):
    keep = {qd_(j): 0 for j in range(1, ROBOTS[robot].n + 1) if j != k}
    return omega.subs(keep)


def _no_cross(translation):
    """(a + b)^2 as a^2 + b^2 in the rates: no products of two lengths."""
    kept = []
    for term in sp.Add.make_args(sp.expand(translation)):
        if not any(f.func in (sp.sin, sp.cos) for f in term.atoms(sp.Function)):
            kept.append(term)
    return sp.Add(*kept)


def _rates(term):
    powers = term.as_powers_dict()
    return {s: p for s, p in powers.items() if s.is_Symbol and re.fullmatch(r"qd\d", s.name)}


def _by_term(e, kind, factor):
    return sp.Add(
        *(term * (factor if kind(_rates(term)) else 1) for term in sp.Add.make_args(sp.expand(e)))
    )


def _mixed(e, factor):
    return _by_term(e, lambda rates: len(rates) == 2, factor)


def _squares(e, factor):
    return _by_term(e, lambda rates: list(rates.values()) == [2], factor)


def _without_chain(rate, n):
    """d/dt cos q without the rate of q: the derivative's rate is lost."""
    total = sp.S(0)
    for j in range(1, n + 1):
        total += sp.expand(rate).coeff(qd_(j)) * 0
    for term in sp.Add.make_args(sp.expand(rate)):
        rates = _rates(term)
        inner = [s for f in term.atoms(sp.sin, sp.cos) for s in f.args[0].free_symbols]
        drop = next((qd_(int(s.name[1:])) for s in inner if qd_(int(s.name[1:])) in rates), None)
        total += term / drop if drop is not None else term
    return total


def parameters(w):
    """Parameters forgotten, exchanged, misread."""
    R = ROBOTS
    swaps = [
        ("payload2r", {"l1": "lc2", "lc2": "l1"}, ("M", "g"), "lengths_exchanged"),
        ("payload2r", {"m1": "m2", "m2": "m1"}, ("M", "g"), "masses_exchanged"),
        ("payload2r", {"m2": "mp", "mp": "m2"}, ("M",), "masses_exchanged"),
        ("cart_pendulum", {"mc": "mp", "mp": "mc"}, ("M", "g"), "masses_exchanged"),
        ("cart_pendulum", {"mc": "mp", "mp": "mc"}, ("tau",), "masses_exchanged"),
        ("craig2r", {"l1": "r2", "r2": "l1"}, ("M", "h"), "lengths_exchanged"),
        ("craig2r", {"r1": "r2", "r2": "r1"}, ("M", "g"), "lengths_exchanged"),
        ("craig2r", {"J1": "J2", "J2": "J1"}, ("M",), "inertias_exchanged"),
        ("rpr", {"I1": "I3", "I3": "I1"}, ("M",), "inertias_exchanged"),
        ("rpr", {"m2": "m3", "m3": "m2"}, ("M", "g"), "masses_exchanged"),
        ("stanford3", {"I2": "J2", "J2": "I2"}, ("M",), "principal_moments_exchanged"),
        ("stanford3", {"d2": "lc3", "lc3": "d2"}, ("M",), "lengths_exchanged"),
        ("puma3", {"r2": "r3", "r3": "r2"}, ("g",), "lengths_exchanged"),
        ("double_pendulum", {"l1": "l2", "l2": "l1"}, ("M", "h", "g"), "lengths_exchanged"),
        ("gantry", {"m1": "m2", "m2": "m1"}, ("M", "g"), "masses_exchanged"),
        ("geared2r", {"N1": "N2", "N2": "N1", "J1": "J2", "J2": "J1"}, ("M",), "drives_exchanged"),
        ("geared2r", {"N1": "N2", "N2": "N1"}, ("M",), "gears_exchanged"),
        ("scara3", {"m2": "m3", "m3": "m2"}, ("M",), "masses_exchanged"),
        ("cart_double", {"m0": "m1", "m1": "m0"}, ("M", "g"), "masses_exchanged"),
        ("pendulum1", {"lc": "l"}, ("M", "g"), "l_for_lc"),
        ("payload2r", {"lc1": "l1/2"}, ("M", "g"), "half_length_for_lc"),
        ("payload2r", {"lc2": "l2/2"}, ("g", "V"), "half_length_for_lc"),
        ("rpr", {"lc3": "l3"}, ("M",), "l_for_lc"),
        ("stanford3", {"lc3": 0}, ("M", "g"), "lc_forgotten"),
        ("payload2r", {"mp": 0}, ("M", "g"), "payload_forgotten"),
        ("payload2r", {"mp": 0}, ("h",), "payload_forgotten"),
        ("payload2r", {"mp": "2*mp"}, ("g",), "payload_twice"),
        ("craig2r", {"r2": "l1"}, ("g",), "l_for_lc"),
        ("puma3", {"d3": 0}, ("M",), "offset_forgotten"),
        ("puma3", {"a3": 0}, ("g",), "length_forgotten"),
        ("stanford3", {"d2": 0}, ("M",), "offset_forgotten"),
        ("geared2r", {"J1": 0, "J2": 0}, ("M",), "rotors_forgotten"),
        ("geared2r", {"N1": 1, "N2": 1}, ("M",), "gear_forgotten"),
        ("geared2r", {"N1": "1/N1", "N2": "1/N2"}, ("M",), "gear_inverted"),
        ("geared2r", {"N1": "sqrt(N1)", "N2": "sqrt(N2)"}, ("M",), "gear_not_squared"),
        ("planar2r", {"m2": "m1"}, ("g",), "mass_of_other_link"),
        ("scara3", {"l2": "l1"}, ("M", "h"), "length_of_other_link"),
        ("double_pendulum", {"m1": "m1 + m2"}, ("M", "g"), "mass_counted_twice"),
        ("rpr", {"m3": 0}, ("M", "g"), "mass_forgotten"),
        ("planar3r", {"m3": 0}, ("g",), "mass_forgotten"),
        ("incline_rp", {"m1": 0}, ("g", "V"), "mass_forgotten"),
        ("cart_double", {"m1": 0}, ("M",), "mass_forgotten"),
    ]
    accept = {
        "lengths_exchanged": {"parameters_exchanged", "links_exchanged"},
        "masses_exchanged": {"parameters_exchanged", "links_exchanged"},
        "inertias_exchanged": {"parameters_exchanged"},
        "principal_moments_exchanged": {
            "parameters_exchanged",
            "inertia_axes",
            "inertia_axes_exchanged",
        },
        "drives_exchanged": {"drives_exchanged", "links_exchanged"},
        "gears_exchanged": {"parameters_exchanged", "drives_exchanged"},
        "l_for_lc": {"parameter_for_another", "com_at_end"},
        "half_length_for_lc": {"parameter_for_another", "com_at_half", "com_at_middle"},
        "lc_forgotten": {"parameter_forgotten", "com_at_end"},
        "payload_forgotten": {"parameter_forgotten", "payload_forgotten"},
        "payload_twice": {"parameter_doubled", "payload_twice"},
        "offset_forgotten": {"parameter_forgotten", "d_forgotten"},
        "length_forgotten": {"parameter_forgotten", "a_forgotten"},
        "rotors_forgotten": {"rotor_forgotten", "parameter_forgotten"},
        "gear_forgotten": {"rotor_gear", "rotor_without_gear", "rotor_gear_forgotten"},
        "gear_inverted": {"rotor_gear_inverted", "rotor_gear_inverse"},
        "gear_not_squared": {"rotor_gear"},
        "mass_of_other_link": {"parameter_for_another"},
        "length_of_other_link": {"parameter_for_another"},
        "mass_counted_twice": {"mass_counted_twice", "parameter_for_another"},
        "mass_forgotten": {"parameter_forgotten", "mass_forgotten"},
    }
    for robot, change, quantities, label in swaps:
        w.derived(
            label,
            robot,
            accept[label],
            quantities,
            substituted(R[robot], change),
            tag="_".join([*quantities, *change]),
        )
    half_way = replace(R["payload2r"], payload=0)
    half_way = derive.with_link(half_way, 2, m="m2 + mp")
    w.derived(
        "payload_at_centre",
        "payload2r",
        {"payload_at_com", "payload_at_centre", "parameter_for_another"},
        ("M", "g"),
        half_way,
    )
    w.texts("payload_in_gravity_only", "payload2r", {"parameter_forgotten", "payload_forgotten"},
            {"M": applied("as_is", derive.derive(substituted(R["payload2r"], {"mp": 0}))["M"]),
             "g": applied("as_is", truth("payload2r")["g"])})  # fmt: skip
    for robot, changes in (
        ("polar_rp", (("m2*q2**2", "m2*q2"), ("m1*l1**2", "m1*l1"))),
        ("planar2r", (("l2**2", "l2"),)),
    ):
        for old, new in changes:
            M = [[str(e) for e in row] for row in truth(robot)["M"]]
            wrong = [[e.replace(old, new) if old in e else e for e in row] for row in M]
            if robot == "polar_rp":
                wrong = [
                    [
                        e.replace("l1**2*m1", new) if "m1" in old else e.replace("m2*q2**2", new)
                        for e in row
                    ]
                    for row in M
                ]
            w.texts(
                "exponent_dropped",
                robot,
                {"exponent_dropped", "radius_not_squared", "exponent", "square_forgotten"},
                {"M": wrong},
                tag=new.replace("*", ""),
            )
    vertical = {
        "scara3": ["g*(m1*l1/2 + m2*l1)*cos(q1)", "0", "-m3*g"],
        "stanford3": ["m2*g*d2*cos(q1)", "-m3*g*(q3 - lc3)*sin(q2)", "m3*g*cos(q2)"],
    }
    for robot, g in vertical.items():
        w.texts(
            "weight_on_vertical_axis",
            robot,
            {
                "weight_on_vertical_axis",
                "gravity_on_vertical_axis",
                "gravity_axis",
                "gravity_axis_back",
            },
            {"g": g},
        )
    level = {
        "scara3": (0, "-g", 0),
        "stanford3": ("-g", 0, 0),
        "planar2r": ("-g", 0, 0),
        "double_pendulum": (0, "-g", 0),
        "gantry": (0, "-g", 0),
    }
    for robot, gravity in level.items():
        w.derived("gravity_along_other_axis", robot, {"gravity_axis", "gravity_axis_back", "zero_shifted", "zero_shifted_back", "gravity_sign",
                  "weight_on_vertical_axis"}, ("V",) if robot == "gantry" else ("g",), replace(R[robot], gravity=gravity))  # fmt: skip
    flat = {"beta": 0}
    tilted = replace(
        R["incline_rp"],
        gravity=tuple(sp.sympify(c).subs({sp.Symbol("beta"): 0}) for c in R["incline_rp"].gravity),
    )
    w.derived("tilt_forgotten", "incline_rp", {"parameter_forgotten"}, ("g",), tilted)
    back = replace(
        R["incline_rp"],
        gravity=tuple(
            sp.sympify(c).subs({sp.Symbol("beta"): -sp.Symbol("beta")})
            for c in R["incline_rp"].gravity
        ),
    )
    w.derived("tilt_sign", "incline_rp", {"parameter_sign"}, ("g", "V"), back)
    swapped = replace(
        R["incline_rp"],
        gravity=(
            sp.Symbol("g") * sp.cos(sp.Symbol("beta")),
            -sp.Symbol("g") * sp.sin(sp.Symbol("beta")),
            0,
        ),
    )
    w.derived(
        "tilt_sin_cos",
        "incline_rp",
        {"gravity_sin_cos", "parameter_sin_cos", "zero_shifted", "zero_shifted_back"},
        ("g",),
        swapped,
    )
    del flat


def conventions(w):
    """Tables of the other convention, angles of the other kind, units, axes of the table."""
    R = ROBOTS
    for robot in ("craig2r", "stanford3", "scara3", "payload2r"):
        other = replace(R[robot], modified=not R[robot].modified)
        w.derived("table_of_other_convention", robot, {"convention_exchanged", "other_convention", "dynamics_other_convention"},
                  ("M", "g") if robot != "stanford3" else ("g",), other)  # fmt: skip
    for robot, i, quantities in (
        ("stanford3", 2, ("g",)),
        ("puma3", 3, ("g",)),
        ("rpr", 2, ("g",)),
    ):
        one = R[robot].links[i - 1]
        w.derived(
            "alpha_sign",
            robot,
            {"alpha_sign", "gravity_sign", "parameter_sign"},
            quantities,
            derive.with_link(R[robot], i, alpha=-one.alpha),
            tag=f"link{i}",
        )
    for robot, known in ABSOLUTE.items():
        answers = {q: known[q] for q in ("M", "g")}
        w.texts(
            "absolute_not_declared",
            robot,
            {
                "absolute_angles",
                "angles_absolute",
                "height_relative_angle",
                "angles_declared_relative",
            },
            answers,
        )
        relative = {q: applied("by_mass", truth(robot)[q]) for q in ("M", "g")}
        from grading.data.right_sheets import absolute_truth

        w.texts("relative_declared_absolute", robot, {"relative_angles", "angles_relative", "angles_declared_absolute"}, relative,
                reference=absolute_truth(robot), names={"angles": "absolute"})  # fmt: skip
        w.texts("relative_declared_absolute_h", robot, {"relative_angles", "angles_relative", "angles_declared_absolute"},
                {"h": applied("as_is", truth(robot)["h"])}, reference=absolute_truth(robot), names={"angles": "absolute"})  # fmt: skip
    mm = {"M": [["4*200**2 + 0.06 + 0.015 + 2*(q2 + 100)**2", "0"], ["0", "2"]]}
    w.texts("millimetres", "telescope_mm", {"millimetres_for_metres"}, mm)
    w.texts(
        "millimetres",
        "telescope_mm",
        {"millimetres_for_metres"},
        {"g": ["9.81*(4*200 + 2*(q2 + 100))*cos(q1)", "2*9.81*sin(q1)"]},
        tag="g",
    )
    w.texts(
        "millimetres",
        "pan_tilt",
        {"millimetres_for_metres"},
        {"g": ["0", "0.25*9.81*25*cos(q2)"]},
        tag="g",
    )
    w.texts("offset_of_slide_forgotten", "telescope_mm", {"d_forgotten", "offset_forgotten", "parameter_forgotten", "length_forgotten"},
            {"M": [["4*0.2**2 + 0.06 + 0.015 + 2*(q2 - 0.05)**2", "0"], ["0", "2"]]})  # fmt: skip
    w.texts("com_of_slide_forgotten", "telescope_mm", {"com_at_end", "com_forgotten"},
            {"M": [["4*0.2**2 + 0.06 + 0.015 + 2*(q2 + 0.15)**2", "0"], ["0", "2"]], "g": ["9.81*(4*0.2 + 2*(q2 + 0.15))*cos(q1)", "2*9.81*sin(q1)"]})  # fmt: skip
    for robot in ("planar2r", "double_pendulum", "pendulum1"):
        g = [
            re.sub(r"(sin|cos)\(([^()]*)\)", r"\1((\2)*pi/180)", str(e)) for e in truth(robot)["g"]
        ]
        w.texts("degrees", robot, {"degrees_for_radians"}, {"g": g})
    friction = {"planar2r": 1, "geared2r": 1, "pendulum1": 1, "polar_rp": 1}
    for robot in friction:
        known = truth(robot)
        right = [sp.expand(a + b) for a, b in zip(known["tau"], known["friction"], strict=True)]
        minus = [sp.expand(a - b) for a, b in zip(known["tau"], known["friction"], strict=True)]
        reference = {"tau": right}
        how = {"reference": reference, "task": {"friction": True}}
        w.texts("friction_sign", robot, {"friction_sign", "parameter_sign"}, {"tau": minus}, **how)
        w.texts(
            "friction_missing",
            robot,
            {"friction_forgotten", "parameter_forgotten"},
            {"tau": known["tau"]},
            **how,
        )
        w.corpus.right(f"friction_{robot}", robot, {"tau": right}, w.corpus.turn("wrongnotation", NOTATION), reference=reference,
                       task={"friction": True})  # fmt: skip
    known = truth("geared2r")
    N1, N2, b1, b2 = sp.symbols("N1 N2 b1 b2")
    motor_side = [
        sp.expand(t + b * qd)
        for t, b, qd in zip(known["tau"], (b1, b2), (qd_(1), qd_(2)), strict=True)
    ]
    right = [sp.expand(a + b) for a, b in zip(known["tau"], known["friction"], strict=True)]
    w.texts("friction_without_gear", "geared2r", {"friction_without_gear", "friction_gear"}, {"tau": motor_side},
            reference={"tau": right}, task={"friction": True})  # fmt: skip
    single = [
        sp.expand(t + N * b * qd)
        for t, N, b, qd in zip(known["tau"], (N1, N2), (b1, b2), (qd_(1), qd_(2)), strict=True)
    ]
    w.texts(
        "friction_gear_not_squared",
        "geared2r",
        {"friction_gear"},
        {"tau": single},
        reference={"tau": right},
        task={"friction": True},
    )


def writing(w):
    """Slips of the pen: one term, one sign, one index, one formula of trigonometry."""
    for robot, quantity, row, k, change in (
        ("planar2r", "h", 0, 0, "missing"), ("planar3r", "g", 0, 2, "missing"), ("planar3r", "M", (0, 0), 4, "missing"),
        ("rpr", "h", 0, 2, "missing"), ("scara3", "M", (0, 0), 5, "missing"), ("payload2r", "M", (0, 1), 1, "missing"),
        ("stanford3", "g", 1, 1, "missing"), ("craig2r", "M", (1, 1), 0, "missing"), ("cart_double", "h", 0, 3, "missing"),
        ("puma3", "g", 1, 1, "missing"), ("polar_rp", "tau", 0, 2, "missing"), ("cart_pendulum", "M", (0, 0), 1, "missing"),
        ("planar2r", "M", (0, 0), 2, "sign"), ("rpr", "M", (0, 1), 0, "sign"), ("cart_double", "h", 0, 1, "sign"),
        ("planar3r", "h", 1, 2, "sign"), ("payload2r", "g", 0, 3, "sign"), ("double_pendulum", "M", (0, 1), 0, "sign"),
        ("stanford3", "h", 0, 4, "sign"), ("puma3", "g", 1, 4, "sign"), ("scara3", "h", 0, 1, "sign"), ("polar_rp", "g", 0, 1, "sign"),
        ("planar2r", "M", (0, 0), 2, "double"), ("planar3r", "M", (0, 0), 4, "half"), ("rpr", "M", (0, 0), 5, "half"),
        ("cart_double", "M", (1, 1), 2, "half"), ("craig2r", "M", (0, 0), 3, "half"), ("payload2r", "h", 0, 0, "half"),
        ("scara3", "M", (0, 1), 2, "half"), ("stanford3", "M", (1, 1), 3, "half"), ("double_pendulum", "h", 0, 0, "half"),
        ("geared2r", "M", (0, 0), 3, "double"), ("incline_rp", "h", 0, 0, "half"), ("puma3", "M", (1, 1), 4, "half"),
        ("planar2r", "tau", 0, 4, "double"), ("cart_pendulum", "tau", 1, 0, "double"), ("gantry", "tau", 0, 1, "sign"),
        ("planar2r", "g", 0, 2, "sine"), ("rpr", "g", 1, 0, "cosine"), ("payload2r", "M", (0, 0), 4, "sine"),
        ("cart_double", "g", 1, 1, "cosine"), ("craig2r", "h", 1, 0, "cosine"), ("scara3", "h", 0, 0, "cosine"),
        ("planar2r", "h", 0, 1, "index"), ("double_pendulum", "h", 1, 0, "index"), ("rpr", "h", 1, 2, "index"),
        ("planar3r", "h", 0, 4, "index"), ("polar_rp", "h", 1, 0, "index"), ("cart_double", "h", 1, 1, "index"),
        ("stanford3", "h", 2, 0, "index"), ("craig2r", "h", 0, 1, "index"),
        ("planar2r", "g", 0, 1, "mass"), ("planar3r", "g", 0, 4, "mass"), ("scara3", "M", (0, 0), 3, "mass"), ("rpr", "M", (0, 0), 5, "mass"),
        ("double_pendulum", "g", 0, 1, "mass"), ("payload2r", "M", (0, 0), 5, "mass"),
        ("planar2r", "M", (0, 0), 1, "length"), ("scara3", "M", (0, 1), 3, "length"), ("planar3r", "M", (1, 1), 1, "length"),
        ("double_pendulum", "g", 0, 2, "length"),
    ):  # fmt: skip
        value = [list(r) if isinstance(r, list) else r for r in truth(robot)[quantity]]
        at = row if isinstance(row, tuple) else (row,)
        entry = value[at[0]][at[1]] if len(at) == 2 else value[at[0]]
        parts = terms(to_tree(entry))
        if k >= len(parts):
            print("no such term", robot, quantity, at, k)
            continue
        slipped = _slip(parts, k, change)
        new = summed(slipped)
        value = trees(value)
        if len(at) == 2:
            value[at[0]][at[1]] = new
            if at[0] != at[1] and quantity == "M":
                value[at[1]][at[0]] = new
        else:
            value[at[0]] = new
        index = "".join(str(i + 1) for i in at)
        w.texts(
            f"term_{change}", robot, SLIPS[change], {quantity: value}, tag=f"{quantity}{index}_{k}"
        )
    trigonometry(w)
    rates_and_sums(w)


SLIPS = {
    "missing": {
        "term_missing",
        "parameter_forgotten",
        "mass_forgotten",
        "velocity_cross_term",
        "inertia_forgotten",
        "coriolis_missing",
        "centrifugal_missing",
        "kinetic_gradient_omitted",
        "gravity_forgotten",
        "height_forgotten",
        "height_at_joint",
    },
    "sign": {
        "parameter_sign",
        "term_sign",
        "entry_sign",
        "coriolis_sign",
        "centrifugal_sign",
        "gravity_sign",
        "length_sign",
    },
    "double": {
        "term_doubled",
        "term_factor",
        "parameter_doubled",
        "coriolis_doubled",
        "entry_doubled",
        "term_twice",
    },
    "half": {"term_halved", "term_factor", "parameter_halved", "coriolis_halved", "entry_halved"},
    "sine": {
        "term_function",
        "sine_for_cosine",
        "term_sin_cos",
        "zero_shifted",
        "zero_shifted_back",
        "sin_cos_exchanged",
        "gravity_axis",
        "gravity_axis_back",
    },
    "cosine": {
        "gravity_axis",
        "gravity_axis_back",
        "term_function",
        "sine_for_cosine",
        "term_sin_cos",
        "zero_shifted",
        "zero_shifted_back",
        "sin_cos_exchanged",
    },
    "index": {"term_index", "centrifugal_index", "rate_of_another_joint"},
    "mass": {"term_index", "parameter_for_another", "term_parameter"},
    "length": {"term_index", "parameter_for_another", "term_parameter"},
}


def _slip(parts, k, change):
    sign, one = parts[k]
    if change == "missing":
        return parts[:k] + parts[k + 1 :]
    if change == "sign":
        return [*parts[:k], (-sign, one), *parts[k + 1 :]]
    if change == "double":
        return [*parts[:k], (sign, ("*", ("n", "2"), one)), *parts[k + 1 :]]
    if change == "half":
        return [*parts[:k], (sign, ("/", one, ("n", "2"))), *parts[k + 1 :]]
    text = repr(one)
    if change in ("sine", "cosine"):
        old, new = ("cos", "sin") if change == "sine" else ("sin", "cos")
        assert f"'{old}'" in text, text
        return [*parts[:k], (sign, eval(text.replace(f"'{old}'", f"'{new}'"))), *parts[k + 1 :]]
    swap = {"index": ("qd1", "qd2"), "mass": ("m1", "m2"), "length": ("l1", "l2")}[change]
    turn = {swap[0]: swap[1], swap[1]: swap[0]}
    if not any(f"'{one}'" in text for one in swap):
        turn = {"index": {"qd3": "qd2"}, "mass": {"m3": "m2", "mp": "m2"}, "length": {"l3": "l2"}}[
            change
        ]
    new = re.sub(r"'(\w+)'", lambda m: f"'{turn.get(m[1], m[1])}'", text)
    assert new != text, text
    return [*parts[:k], (sign, eval(new)), *parts[k + 1 :]]


def trigonometry(w):
    """Wrong formulas for sums of angles."""
    sums = {
        "cosine_of_sum_by_sum": (
            "(cos(q1) + cos(q2))",
            {"cosine_of_sum", "sum_of_cosines", "addition_linear", "cosine_of_sum_linear"},
        ),
        "cosine_of_sum_sign": (
            "(cos(q1)*cos(q2) + sin(q1)*sin(q2))",
            {"addition_sign", "cosine_of_sum_sign", "cosine_of_difference", "parameter_sign"},
        ),
        "cosine_of_sum_mixed": (
            "(sin(q1)*cos(q2) + cos(q1)*sin(q2))",
            {
                "sine_for_cosine",
                "sin_cos_exchanged",
                "zero_shifted",
                "zero_shifted_back",
                "addition_formula",
            },
        ),
        "cosine_of_difference": (
            "cos(q1 - q2)",
            {"addition_sign", "cosine_of_difference", "angle_difference", "cosine_of_sum_sign"},
        ),
        "cosine_of_second": ("cos(q2)", {"height_relative_angle", "gravity_torque_relative_angle"}),
    }
    for robot in ("planar2r", "payload2r", "craig2r", "geared2r"):
        for label, (new, accept) in sums.items():
            if robot == "geared2r" and label != "cosine_of_sum_sign":
                continue
            g = [str(e).replace("cos(q1 + q2)", new) for e in truth(robot)["g"]]
            w.texts(label, robot, accept, {"g": g})
    for robot in ("double_pendulum",):
        g = [
            str(e).replace("sin(q1 + q2)", "(sin(q1)*cos(q2) - cos(q1)*sin(q2))")
            for e in truth(robot)["g"]
        ]
        w.texts(
            "sine_of_sum_sign",
            robot,
            {"addition_sign", "sine_of_sum_sign", "sine_of_difference"},
            {"g": g},
        )
        g = [str(e).replace("sin(q1 + q2)", "(sin(q1) + sin(q2))") for e in truth(robot)["g"]]
        w.texts(
            "sine_of_sum_by_sum",
            robot,
            {"sine_of_sum", "sum_of_sines", "addition_linear"},
            {"g": g},
        )


def rates_and_sums(w):
    """Squares of sums, C with the wrong rate, rows transposed, symmetry lost."""
    K = HUMAN["planar2r"][3]["K"].replace("(qd1 + qd2)**2", "(qd1**2 + qd2**2)")
    accept = {"velocity_cross_term", "square_without_cross_term", "sum_squared", "square_of_sum"}
    w.texts("square_of_sum", "planar2r", accept, {"K": K})
    K = "1/2*(m1*r1**2 + J1)*qd1**2 + 1/2*m2*(l1**2*qd1**2 + r2**2*(qd1**2 + qd2**2) + 2*l1*r2*cos(q2)*qd1*(qd1 + qd2)) + 1/2*J2*(qd1 + qd2)**2"
    w.texts("square_of_sum", "craig2r", accept, {"K": K})
    K = "1/2*m0*qd1**2 + 1/2*m1*(qd1**2 + l1**2*qd2**2) + 1/2*m2*((qd1 + l1*qd2*c2 + l2*(qd2 + qd3)*c23)**2 + (l1*qd2*s2 + l2*(qd2 + qd3)*s23)**2)"
    w.texts("square_of_sum", "cart_double", accept, {"K": K})
    C = {
        ("planar2r", "c11_wrong_rate"): [
            ["-1/2*m2*l1*l2*s2*qd1", "-1/2*m2*l1*l2*s2*(qd1 + qd2)"],
            ["1/2*m2*l1*l2*s2*qd1", "0"],
        ],
        ("polar_rp", "c11_wrong_rate"): [["m2*q2*qd1", "m2*q2*qd1"], ["-m2*q2*qd1", "0"]],
        ("craig2r", "c12_lacks_rate"): [
            ["-m2*l1*r2*s2*qd2", "-m2*l1*r2*s2*qd2"],
            ["m2*l1*r2*s2*qd1", "0"],
        ],
        ("double_pendulum", "c_transposed"): [
            ["-m2*l1*l2*s2*qd2", "m2*l1*l2*s2*qd1"],
            ["-m2*l1*l2*s2*(qd1 + qd2)", "0"],
        ],
        ("payload2r", "c21_sign"): [
            ["-l1*(m2*lc2 + mp*l2)*s2*qd2", "-l1*(m2*lc2 + mp*l2)*s2*(qd1 + qd2)"],
            ["-l1*(m2*lc2 + mp*l2)*s2*qd1", "0"],
        ],
        ("polar_rp", "c_half"): [["0", "m2*q2*qd1"], ["-m2*q2*qd1", "0"]],
    }
    accept = {
        "c11_wrong_rate": {"rate_of_another_joint", "term_index", "centrifugal_index", "term_rate"},
        "c12_lacks_rate": {"coriolis_halved", "term_missing"},
        "c_transposed": {"coriolis_transposed"},
        "c21_sign": {"centrifugal_sign", "kinetic_gradient_sign", "entry_sign", "term_sign"},
        "c_half": {"coriolis_halved", "term_missing"},
    }
    for (robot, label), value in C.items():
        w.texts(label, robot, accept[label], {"C": value})
    for robot in ("planar2r", "rpr"):
        M = [list(row) for row in truth(robot)["M"]]
        M[1][0] = 0
        w.texts(
            "mirror_entry_zero",
            robot,
            {"mass_matrix_not_symmetric", "term_missing"},
            {"M": M},
            layout="toml",
        )
    for robot in ("payload2r", "craig2r"):
        h = list(truth(robot)["h"])
        w.texts("rows_exchanged", robot, {"equations_exchanged"}, {"h": h[::-1]})
        w.texts(
            "rows_exchanged",
            robot,
            {"equations_exchanged"},
            {"tau": truth(robot)["tau"][::-1]},
            tag="tau",
        )
    for robot in ("double_pendulum", "rpr"):
        w.texts(
            "lagrangian_sum",
            robot,
            {"lagrangian_sum"},
            {"L": sp.expand(truth(robot)["K"] + truth(robot)["V"])},
        )
    for robot in ("pendulum1", "gantry"):
        w.texts(
            "inertia_over",
            robot,
            {"half_forgotten", "translation_half_forgotten", "entry_doubled"},
            {"K": 2 * truth(robot)["K"]},
        )


def kinematic(w):
    """Tables, transforms, Jacobians."""
    slips = [
        (
            "polar_rp",
            0,
            0,
            "q1",
            "theta_offset_missing",
            {"theta_offset_forgotten", "theta_quarter_less", "wrong_theta"},
        ),
        ("polar_rp", 0, 0, "q1 - pi/2", "theta_offset_sign", {"theta_offset_sign", "wrong_theta"}),
        ("rpr", 2, 0, "q3 + pi/2", "theta_offset_sign", {"theta_offset_sign", "wrong_theta"}),
        ("rpr", 1, 3, "pi/2", "alpha_sign", {"alpha_sign", "wrong_twist"}),
        ("stanford3", 0, 3, "pi/2", "alpha_sign", {"alpha_sign", "wrong_twist"}),
        ("stanford3", 1, 1, "-d2", "d_sign", {"length_sign"}),
        ("stanford3", 1, 1, "0", "d_forgotten", {"d_forgotten"}),
        ("puma3", 2, 1, "-d3", "d_sign", {"length_sign"}),
        ("puma3", 1, 3, "pi/2", "alpha_wrong", {"wrong_twist"}),
        ("puma3", 2, 3, "0", "alpha_forgotten", {"alpha_forgotten", "wrong_twist"}),
        ("scara3", 1, 3, "0", "alpha_forgotten", {"alpha_forgotten", "wrong_twist"}),
        ("scara3", 1, 0, "q1", "variable_of_another", {"variable_of_another_joint"}),
        (
            "telescope_mm",
            1,
            1,
            "q2 + 150",
            "millimetres",
            {"millimetres_for_metres", "wrong_length"},
        ),
        ("pan_tilt", 0, 1, "80", "millimetres", {"millimetres_for_metres", "wrong_length"}),
        ("pan_tilt", 0, 3, "90", "degrees", {"degrees_for_radians", "wrong_twist"}),
        ("polar_rp", 0, 3, "90", "degrees", {"degrees_for_radians", "wrong_twist"}),
        ("planar2r", 1, 0, "-q2", "theta_sign", {"theta_sign"}),
    ]
    for robot, i, j, new, label, accept in slips:
        convention, rows = TABLES[robot]
        rows = [list(row) for row in rows]
        rows[i][j] = new
        _table(w, label, robot, convention, rows, accept)
    for robot, i in (("scara3", 0), ("craig2r", 1), ("stanford3", 0), ("puma3", 1)):
        convention, rows = TABLES[robot]
        rows = [list(row) for row in rows]
        rows[i][1], rows[i][2] = rows[i][2], rows[i][1]
        _table(w, "a_d_exchanged", robot, convention, rows, {"a_d_exchanged", "wrong_length"})
    for robot in ("craig2r", "stanford3", "polar_rp"):
        convention, rows = TABLES[robot]
        other = {"standard": "modified", "modified": "standard"}[convention]
        _table(
            w,
            "other_convention_declared",
            robot,
            other,
            rows,
            {"other_convention", "convention_exchanged"},
        )
    jacobians(w)
    for robot in ("scara3", "stanford3", "rpr"):
        A = derive.row_transforms(ROBOTS[robot])
        T = sp.eye(4)
        for one in A:
            T = one * T
        T = T.applyfunc(derive.fourier).tolist()
        w.texts("product_reversed", robot, {"product_reversed"}, {"T": T}, layout="toml")
        inverted = _inverse(truth(robot)["T"])
        w.texts("pose_inverted", robot, {"pose_inverted"}, {"T": inverted}, layout="toml")
    for robot in ("cart_double", "gantry"):
        bare = derive.kinematics(replace(ROBOTS[robot], base=sp.eye(4)))["T"]
        w.texts("base_forgotten", robot, {"base_forgotten"}, {"T": bare}, layout="toml")
    bare = derive.kinematics(replace(ROBOTS["craig2r"], tool=sp.eye(4)))["T"]
    w.texts("tool_forgotten", "craig2r", {"tool_forgotten"}, {"T": bare}, layout="toml")
    other = derive.kinematics(replace(ROBOTS["stanford3"], modified=True))
    w.texts("formula_of_other_convention", "stanford3", {"convention_exchanged", "rotations_first", "translations_first"},
            {"A1": other["A1"], "A2": other["A2"]})  # fmt: skip


def _table(w, label, robot, convention, rows, accept):
    known = TABLES[robot]
    spoiled = [i for i, row in enumerate(rows) if convention != known[0] or row != known[1][i]]
    assert _frames_differ(robot, convention, rows), (label, robot)
    name = f"x_dh_{label}_{robot}"
    if name in {one["name"] for one in w.corpus.sheets}:
        name += "_2"
    w.corpus.raw(name, robot, ".toml", table_sheet(robot, convention, rows), ("wrong",),
                 {"mistake": label, "accept": sorted({label, *accept}), "entries": [f"dh{i + 1}" for i in spoiled], "quantities": ["dh"]},
                 "table")  # fmt: skip


def _frames_differ(robot, convention, rows):
    """Return whether a table leads to another pose of the last frame."""
    known, links = ROBOTS[robot], []
    for one, row in zip(known.links, rows, strict=True):
        turn = {f"q{i + 1}": sp.Symbol(f"q{i + 1}") for i in range(known.n)}
        theta, d, a, alpha = (sp.sympify(e, locals=turn) for e in row)
        links.append(replace(one, kind="fixed", theta=theta, d=d, a=a, alpha=alpha))
    changed = derive.row_transforms(
        replace(known, links=tuple(links), modified=convention == "modified")
    )
    right = derive.row_transforms(known)
    state = {
        s: sp.Rational(3 * k + 7, 10)
        for k, s in enumerate(
            sorted({s for A in [*changed, *right] for s in A.free_symbols}, key=str)
        )
    }
    poses = []
    for product in (changed, right):
        T = sp.eye(4)
        for A in product:
            T = T * A.subs(state).evalf(30)
        poses.append(T)
    return max(abs(e) for e in poses[0] - poses[1]) > 1e-6


def _inverse(T):
    T = sp.Matrix(T)
    R, p = T[:3, :3], T[:3, 3]
    X = sp.eye(4)
    X[:3, :3] = R.T
    X[:3, 3] = (-R.T * p).applyfunc(derive.fourier)
    return X.tolist()


def jacobians(w):
    """Columns of the Jacobian."""
    for robot in ("rpr", "scara3", "stanford3", "planar3r", "puma3", "polar_rp"):
        J, n = sp.Matrix(truth(robot)["J"]), ROBOTS[robot].n
        F = derive.frames(ROBOTS[robot])
        p = F[-1][:3, 3]
        kinds = [one.kind for one in ROBOTS[robot].links]
        lever = [F[k][:3, 2].cross(p) if kinds[k] == "R" else F[k][:3, 2] for k in range(n)]
        whole = _columns(lever, [J[3:, k] for k in range(n)])
        crossed = _columns(
            [-J[:3, k] if kinds[k] == "R" else J[:3, k] for k in range(n)],
            [J[3:, k] for k in range(n)],
        )
        neighbour = _columns([F[k + 1][:3, 2].cross(p - F[k][:3, 3]) if kinds[k] == "R" else F[k + 1][:3, 2] for k in range(n)],
                             [F[k + 1][:3, 2] if kinds[k] == "R" else sp.zeros(3, 1) for k in range(n)])  # fmt: skip
        angular = _columns([J[:3, k] for k in range(n)], [F[k][:3, 2] for k in range(n)])
        choices = {
            "lever_from_base": (whole, {"lever_not_subtracted"}),
            "cross_product_order": (crossed, {"cross_product_order"}),
            "axis_of_own_frame": (neighbour, {"axis_neighbour"}),
            "slide_turns": (angular, {"prismatic_angular"}),
            "rows_exchanged": (sp.Matrix.vstack(J[3:, :], J[:3, :]), {"rows_exchanged"}),
        }
        for _ in range(2):
            label = w.corpus.turn("jac", list(choices))
            value, accept = choices[label]
            value = value.applyfunc(derive.fourier).tolist()
            w.texts("jacobian_" + label, robot, accept, {"J": value}, layout="toml")


def _columns(upper, lower):
    return sp.Matrix.hstack(*(sp.Matrix.vstack(a, b) for a, b in zip(upper, lower, strict=True)))


INVERSE_SLIPS = [
    ("planar2r", 1, "pi - acos((px**2 + py**2 - l1**2 - l2**2)/(2*l1*l2))", "inner_angle", {"supplement"}),
    ("planar2r", 1, "acos((l1**2 + l2**2 - px**2 - py**2)/(2*l1*l2))", "inner_angle_2", {"supplement"}),
    ("planar2r", 1, "acos((px**2 + py**2 - l1**2 - l2**2)/(l1*l2))", "law_of_cosines_without_2", {"law_of_cosines_without_2", "law_of_cosines", "cosine_law_factor"}),
    ("planar2r", 1, "acos((px**2 + py**2 - l1 - l2)/(2*l1*l2))", "lengths_not_squared", {"lengths_not_squared", "law_of_cosines", "cosine_law_squares"}),
    ("planar2r", 1, "acos((px**2 + py**2 + l1**2 + l2**2)/(2*l1*l2))", "law_of_cosines_sign", {"cosine_law_sign", "law_of_cosines"}),
    ("planar2r", 1, "acos((sqrt(px**2 + py**2) - l1**2 - l2**2)/(2*l1*l2))", "distance_not_squared", {"lengths_not_squared", "law_of_cosines", "cosine_law_squares"}),
    ("scara3", 1, "pi + acos((px**2 + py**2 - l1**2 - l2**2)/(2*l1*l2))", "supplement", {"supplement", "missing_offset"}),
    ("scara3", 2, "pz - h", "slide_sign", {"joint_sign"}),
    ("scara3", 2, "-pz", "offset_missing", {"missing_offset"}),
    ("planar3r", 2, "atan2(r12, r11) - q1 - q2", "rotation_transposed", {"rotation_transposed", "rotation_matrix_transposed"}),
    ("rpr", 2, "atan2(r12, r11) - q1", "rotation_transposed", {"rotation_transposed", "rotation_matrix_transposed"}),
    ("rpr", 2, "atan2(r11, r21) - q1", "atan2_swapped", {"atan2_arguments"}),
    ("rpr", 2, "atan2(r21, r11)", "angle_before_not_subtracted", {"angle_not_subtracted", "earlier_joints_forgotten"}),
    ("polar_rp", 0, "atan2(px, py)", "atan2_swapped", {"atan2_arguments"}),
    ("polar_rp", 1, "px**2 + py**2", "root_forgotten", {"root_forgotten", "lengths_not_squared"}),
    ("polar_rp", 0, "atan(py/px)", "quadrant", {"quadrant"}),
    ("polar_rp", 0, "180/pi*atan2(py, px)", "degrees", {"degrees_for_radians"}),
    ("stanford3", 1, "atan2(pz - d1, px*cos(q1) + py*sin(q1))", "atan2_swapped", {"atan2_arguments"}),
    ("telescope_mm", 1, "sqrt(px**2 + py**2) - 150", "millimetres", {"millimetres_for_metres", "missing_offset"}),
    ("telescope_mm", 1, "sqrt(px**2 + py**2)", "offset_missing", {"missing_offset"}),
    ("telescope_mm", 1, "sqrt(px**2 + py**2) + 0.15", "offset_sign", {"missing_offset", "offset_sign"}),
    ("pan_tilt", 1, "atan2(pz, px*cos(q1) + py*sin(q1))", "height_of_base_forgotten", {"missing_offset", "base_height_forgotten", "offset_forgotten"}),
    ("craig2r", 1, "-acos((px**2 + py**2 - l1**2 - l2**2)/(2*l1*l2))", "elbow_of_other_branch", {"elbow_sign"}),
    ("gantry", 0, "px", "axis_wrong", {"axis_exchanged"}),
]  # fmt: skip


def inverse(w):
    """Inverse kinematics."""
    for robot, j, formula, label, accept in INVERSE_SLIPS:
        branch = list(INVERSE[robot][0])
        branch[j] = formula
        assert not closes(robot, branch), (robot, label)
        kind = w.corpus.turn("xik", ["python", "latex", "matlab"])
        w.corpus.raw(f"x_ik_{label}_{robot}", robot, ".toml", inverse_sheet(robot, [branch], kind), ("wrong",),
                     {"mistake": label, "accept": sorted({label, *accept}), "entries": ["ik1"], "quantities": ["ik"]}, "ik_" + kind)  # fmt: skip


def write(corpus):
    """Add them all."""
    w = Writer(corpus)
    derivation(w)
    parameters(w)
    conventions(w)
    writing(w)
    kinematic(w)
    inverse(w)


__all__ = ["NOTATIONS", "OWN", "parse", "q_", "write"]
