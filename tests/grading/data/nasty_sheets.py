"""Right answers that look wrong, and wrong ones that look right."""

# ruff: noqa: E501  (a formula stands on one line)

from __future__ import annotations

from grading.data.checking import differing, tree, trees
from grading.data.layouts import toml_sheet
from grading.data.make_corpus import OWN, truth
from grading.data.trees import parse

PROVED = ("correct",)
ROUNDED = ("correct", "correct within rounding")
NUMERIC = ("correct", "correct within rounding", "undecided")
WRONG = ("wrong",)
G1, G2 = "(m1/2 + m2)*g*l1*cos(q1) + m2*g*l2*cos(q1 + q2)/2", "m2*g*l2*cos(q1 + q2)/2"
M11 = "m1*l1**2/3 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2))"
M12, M22 = "m2*(l2**2/3 + l1*l2*cos(q2)/2)", "m2*l2**2/3"
V = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"
K = "m1*l1**2*qd1**2/6 + m2*(l1**2*qd1**2 + l2**2/3*(qd1 + qd2)**2 + l1*l2*cos(q2)*qd1*(qd1 + qd2))/2"
H2 = "m2*l1*l2*sin(q2)*qd1**2/2"

RIGHT = {
    # name: (robot, answers, expected)
    "tan_times_cos": ("planar2r", {"g": [G1, "m2*g*l2/2*(cos(q1)*cos(q2) - tan(q1)*cos(q1)*sin(q2))"]}, PROVED),
    "root_of_square_of_length": ("planar2r", {"g": [G1, "m2*g*sqrt(l2**2)*cos(q1 + q2)/2"]}, NUMERIC),
    "root_of_perfect_square": ("planar2r", {"M": [[M11, M12], [M12, "m2*(sqrt(l2**4))/3"]]}, NUMERIC),
    "abs_of_mass": ("planar2r", {"M": [[M11, M12], [M12, "abs(m2)*l2**2/3"]]}, NUMERIC),
    "sum_of_halves": ("planar2r", {"g": [G1, "m2*g*l2*cos(q1 + q2)*(1/3 + 1/6)"]}, PROVED),
    "decimal_halves": ("planar2r", {"g": [G1, "m2*g*l2*cos(q1 + q2)*(0.25 + 0.25)"]}, PROVED),
    "cosine_of_negative": ("planar2r", {"g": [G1, "m2*g*l2*cos(-q1 - q2)/2"]}, PROVED),
    "sine_of_supplement": ("planar2r", {"g": [G1, "-m2*g*l2*cos(pi - q1 - q2)/2"]}, PROVED),
    "turn_added": ("planar2r", {"g": [G1, "m2*g*l2*cos(q1 + q2 + 2*pi)/2"]}, PROVED),
    "three_quarters": ("planar2r", {"g": [G1, "m2*g*l2*sin(q1 + q2 - 3*pi/2)/2"]}, PROVED),
    "one_added_and_taken": ("planar2r", {"K": f"{K} + sin(q2)**2 + cos(q2)**2 - 1"}, PROVED),
    "quotient_cancels": ("planar2r", {"M": [[M11, M12], [M12, "(m2**2*l2**2 + m1*m2*l2**2)/(3*(m1 + m2))"]]}, PROVED),
    "difference_of_squares": ("double_pendulum", {"M": [
        ["(m1 + m2)*l1**2 + m2*l2**2 + 2*m2*l1*l2*cos(q2)", "m2*((l2 + l1*cos(q2)/2)**2 - l1**2*cos(q2)**2/4)"],
        ["m2*((l2 + l1*cos(q2)/2)**2 - l1**2*cos(q2)**2/4)", "m2*l2**2"]]}, PROVED),
    "half_angle_square": ("pendulum1", {"g": ["2*m*g*lc*sin(q1/2)*cos(q1/2)"]}, NUMERIC),
    "triple_angle": ("pendulum1", {"g": ["m*g*lc*(sin(3*q1) + 4*sin(q1)**3)/3"]}, PROVED),
    "chebyshev": ("cart_pendulum", {"V": "-mp*g*l/2*(4*cos(q2)**3 - cos(3*q2))/3"}, PROVED),
    "secant": ("cart_pendulum", {"g": ["0", "mp*g*l/2*tan(q2)/sec(q2)"]}, NUMERIC),
    "huge_constant_in_V": ("planar2r", {"V": f"{V} + 1e6"}, PROVED),
    "constant_of_parameters_in_V": ("planar2r", {"V": f"{V} + m1*g*l1 - 17*m2*g*l2"}, PROVED),
    "third_in_five_digits": ("planar2r", {"M": [[M11, M12], [M12, "0.33333*m2*l2**2"]]}, ROUNDED),
    "twelfth_in_four_digits": ("planar2r", {"M": [[M11, M12], [M12, "m2*l2**2*(0.08333 + 0.25)"]]}, ROUNDED),
    "two_thirds_rounded_up": ("planar2r", {"M": [[M11, M12], [M12, "0.6667*m2*l2**2/2"]]}, ROUNDED),
    "inverse_hyperbola": ("gantry", {"tau": ["(m1 + m2)*qdd1", "m2*(qdd2**2 - g**2)/(qdd2 - g)"]}, PROVED),
    "double_fraction": ("polar_rp", {"h": ["2*m2*q2*qd1*qd2", "-m2*qd1**2/(1/q2)"]}, PROVED),
    "polar_square": ("polar_rp", {"K": "((m1*l1**2 + I1 + I2)*qd1**2 + m2*(qd2 + q2*qd1)**2 - 2*m2*q2*qd1*qd2)/2"}, PROVED),
}  # fmt: skip
TRICKS = {
    # name: (robot, answers with one wrong entry)
    "off_by_1e9": ("planar2r", {"M": [[M11, M12], [M12, "0.333333334333*m2*l2**2"]]}),
    "off_by_1e9_in_g": ("planar2r", {"g": [G1, "0.500000001*m2*g*l2*cos(q1 + q2)"]}),
    "off_by_1e12": ("planar2r", {"g": [G1, "0.500000000001*m2*g*l2*cos(q1 + q2)"]}),
    "phase_of_1e9": ("planar2r", {"g": [G1, "m2*g*l2*cos(q1 + q2 + 1e-9)/2"]}),
    "equal_where_l1_is_1": ("planar2r", {"M": [["m1*l1**3/3 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2))", M12], [M12, M22]]}),
    "equal_below_3": ("pendulum1", {"g": ["m*g*lc*sin(min(q1, 3))"]}),
    "equal_above_minus_3": ("pendulum1", {"g": ["m*g*lc*sin(max(q1, -3))"]}),
    "root_of_square_of_angle": ("pendulum1", {"g": ["m*g*lc*sin(sqrt(q1**2))"]}),
    "abs_of_sine": ("pendulum1", {"g": ["m*g*lc*abs(sin(q1))"]}),
    "root_of_one_less_square": ("pendulum1", {"g": ["m*g*lc*sqrt(1 - cos(q1)**2)"]}),
    "slide_by_root": ("polar_rp", {"h": ["2*m2*sqrt(q2**2)*qd1*qd2", "-m2*q2*qd1**2"]}),
    "allowance_by_cancelling": ("planar2r", {"M": [[M11, M12], [M12, "(1000e0*m2 - 1000e0*m2 + 0.9*m2)*l2**2/3"]]}),
    "allowance_by_difference": ("planar2r", {"g": [G1, "(5.000e3 - 4.999e3)*m2*g*l2*cos(q1 + q2)"]}),
    "allowance_of_zero": ("planar2r", {"g": [f"{G1} + 0.0001*m1", G2]}),
    "allowance_of_large_numbers": ("planar2r", {"g": [G1, "(1000.1 - 999.7)*m2*g*l2*cos(q1 + q2)"]}),
    "third_in_two_digits": ("planar2r", {"M": [[M11, M12], [M12, "0.33*m2*l2**2"]]}),
    "third_wrong_last_digit": ("planar2r", {"M": [[M11, M12], [M12, "0.33334*m2*l2**2"]]}),
    "small_angle": ("pendulum1", {"g": ["m*g*lc*(q1 - q1**3/6 + q1**5/120 - q1**7/5040)"]}),
    "tan_for_sin": ("pendulum1", {"g": ["m*g*lc*tan(q1)"]}),
    "wrong_M11_beside_right": ("planar2r", {"M": [["m1*l1**2/4 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2))", M12], [M12, M22]],
                                            "g": [G1, G2]}),
    "rate_in_V": ("planar2r", {"V": f"{V} + 1e-12*qd1"}),
    "tiny_square": ("planar2r", {"K": f"{K} + 1e-10*qd2**2"}),
    "gravity_981_for_g": ("planar2r", {"g": [G1, "m2*9.8*l2*cos(q1 + q2)/2"]}),
    "numbers_of_another_arm": ("planar2r", {"g": [G1, "1.5*9.81*0.5*cos(q1 + q2)/2"]}),
    "decimal_in_an_angle": ("planar2r", {"g": [G1, "m2*g*l2*cos(1.0001*q1 + q2)/2"]}),
    "decimal_in_an_exponent": ("planar2r", {"M": [[M11, M12], [M12, "m2*l2**2.0001/3"]]}),
    "quarter_turn_rounded": ("planar2r", {"g": [G1, "m2*g*l2*sin(q1 + q2 + 1.5708)/2"]}),
    "h_of_another_sign_at_zero": ("polar_rp", {"h": ["2*m2*q2*qd1*qd2", "m2*q2*qd1**2"]}),
}  # fmt: skip


def programs(corpus):
    """Documents in which something is rebound, continued, left out or hidden."""

    def raw(name, robot, suffix, text, expected, label=None):
        corpus.raw("nasty_" + name, robot, suffix, text, expected, label, suffix[1:])

    g = f"g = [{G1}, {G2}]"
    raw("unused_wrong_line", "planar2r", ".py", f"# M11 = 3\nold = 'V = 3'\nV = {V}\n", PROVED)
    raw(
        "intermediates",
        "planar2r",
        ".py",
        "import numpy as np\nc2 = np.cos(q2)\ns2 = np.sin(q2)\na = m1*l1**2/3 + m2*l1**2\nb = m2*l2**2/3\nd = m2*l1*l2/2\n"
        "M = np.array([[a + b + 2*d*c2, b + d*c2], [b + d*c2, b]])\nh = np.array([-d*s2*(2*dq1*dq2 + dq2**2), d*s2*dq1**2])\n",
        PROVED,
    )
    raw(
        "intermediates_wrong",
        "planar2r",
        ".py",
        "import numpy as np\nc2 = np.cos(q2)\na = m1*l1**2/3 + m2*l1**2\nb = m2*l2**2/3\nd = m2*l1*l2/3\n"
        "M = np.array([[a + b + 2*d*c2, b + d*c2], [b + d*c2, b]])\n",
        WRONG,
    )
    raw(
        "rebound_shorthand",
        "planar2r",
        ".py",
        "c12 = cos(q1 - q2)\ng = [(m1/2 + m2)*g*l1*cos(q1) + m2*g*l2*c12/2, m2*g*l2*c12/2]\n",
        WRONG,
    )
    raw("rebound_mass", "planar2r", ".py", f"m2 = m1\nV = {V}\n", (*WRONG, "unreadable"))
    raw("rebound_after", "planar2r", ".py", f"V = {V}\nV = 2*V\n", (*WRONG, "unreadable"))
    raw(
        "added_after",
        "planar2r",
        ".m",
        f"V = {V.replace('**', '^')};\nV = V + m1*g*sin(q1);\n",
        (*WRONG, "unreadable"),
    )
    raw(
        "entry_overwritten",
        "planar2r",
        ".m",
        f"g = [{G1}; {G2}];\ng(2) = 0;\n",
        (*WRONG, "unreadable"),
    )
    raw(
        "right_after_wrong",
        "planar2r",
        ".tex",
        r"\begin{align*} V &= m_1 g \frac{l_1}{2} \sin\theta_1 + m_2 g (l_1 \sin\theta_1"
        r" + \frac{l_2}{2}\sin(\theta_1+\theta_2)) \\ &= m_1 g l_1 \sin\theta_1 + m_2 g (l_1 \sin\theta_1 + \frac{l_2}{2}\sin(\theta_1+\theta_2))"
        r" \end{align*}",
        (*WRONG, "unreadable"),
    )
    raw(
        "chain_of_right",
        "planar2r",
        ".tex",
        r"\begin{align*} g_2 &= \frac{\partial V}{\partial \theta_2} \\ &= \frac{1}{2} m_2 g l_2 \cos(\theta_1+\theta_2) \\"
        r" g_1 &= \left(\frac{m_1}{2} + m_2\right) g l_1 \cos\theta_1 \\ &\quad + \frac12 m_2 g l_2 \cos(\theta_1+\theta_2) \end{align*}",
        (*PROVED, "unreadable"),
    )
    raw(
        "continued_minus",
        "planar2r",
        ".tex",
        r"\begin{align*} \tau_2 &= \frac13 m_2 l_2^2 (\ddot\theta_1 + \ddot\theta_2) + \frac12 m_2 l_1 l_2 \cos\theta_2\, \ddot\theta_1 \\"
        r" &\phantom{=} + \frac12 m_2 l_1 l_2 \sin\theta_2\, \dot\theta_1^2 \nonumber \\ &\phantom{=} + \frac12 m_2 g l_2 \cos(\theta_1+\theta_2) \end{align*}",
        (*NUMERIC, "incomplete"),
    )
    raw(
        "continued_wrong",
        "planar2r",
        ".tex",
        r"\begin{align*} g_1 &= \left(\frac{m_1}{2} + m_2\right) g l_1 \cos\theta_1 \\"
        r" &\quad - \frac12 m_2 g l_2 \cos(\theta_1+\theta_2) \\ g_2 &= \frac12 m_2 g l_2 \cos(\theta_1+\theta_2) \end{align*}",
        WRONG,
    )
    raw(
        "split_environment",
        "double_pendulum",
        ".tex",
        r"\begin{equation}\begin{split} V = & -(m_1+m_2) g l_1 \cos\theta_1 \\ & - m_2 g l_2 \cos(\theta_1+\theta_2) \end{split}\end{equation}",
        PROVED,
    )
    raw(
        "multline",
        "double_pendulum",
        ".tex",
        r"\begin{multline} V = -(m_1+m_2) g l_1 \cos\theta_1 \\ - m_2 g l_2 \cos(\theta_1+\theta_2) \end{multline}",
        PROVED,
    )
    raw("only_one_entry_py", "planar2r", ".py", f"g1 = {G1}\n", ("incomplete",))
    raw(
        "only_one_entry_toml",
        "planar2r",
        ".tex",
        r"\[ g_1 = \left(\frac{m_1}{2} + m_2\right) g l_1 \cos\theta_1 + \frac12 m_2 g l_2 \cos(\theta_1+\theta_2) \]",
        ("incomplete",),
    )
    raw(
        "M11_M12_only",
        "planar2r",
        ".m",
        f"M(1,1) = {M11.replace('**', '^')};\nM(1,2) = {M12.replace('**', '^')};\n",
        ("incomplete",),
    )
    raw("one_wrong_of_one", "planar2r", ".py", "g1 = (m1/2 + m2)*g*l1*cos(q1)\n", WRONG)
    raw(
        "numpy_function",
        "double_pendulum",
        ".py",
        'import numpy as np\n\ndef M(q):\n    """Mass matrix."""\n    c2 = np.cos(q[1])\n    a = (m1 + m2)*l1**2\n    b = m2*l2**2\n    d = m2*l1*l2*c2\n'
        "    return np.array([[a + b + 2*d, b + d], [b + d, b]])\n",
        (*PROVED, "unreadable"),
    )
    raw(
        "wrong_M_beside_right_g",
        "planar2r",
        ".py",
        f"M11 = m1*l1**2/4 + m2*(l1**2 + l2**2/3 + l1*l2*cos(q2))\nM12 = {M12}\nM21 = M12\nM22 = {M22}\n{g}\n",
        WRONG,
    )
    raw(
        "symmetric_by_reference",
        "planar2r",
        ".py",
        f"M11 = {M11}\nM12 = {M12}\nM21 = M12\nM22 = {M22}\n",
        PROVED,
    )
    raw(
        "comment_signs",
        "planar2r",
        ".m",
        f"g = [{G1}; ... % first, N m\n     {G2}]; % second\n%{{\ng = [0; 0];\n%}}\n",
        PROVED,
    )
    raw("ans_display", "planar2r", ".m", f"V = {V.replace('**', '^')}\n", PROVED)
    raw(
        "conditional",
        "pendulum1",
        ".py",
        "if q1 > 0:\n    V = -m*g*lc*cos(q1)\nelse:\n    V = 0\n",
        (*WRONG, "unreadable"),
    )


def write(corpus):
    """Add them all; what is stated here of a formula is checked in numbers."""
    for k, (name, (robot, answers, expected)) in enumerate(RIGHT.items()):
        tolerance = 1e-3 if expected is ROUNDED else None
        notation = ("python", "latex", "dq1", "latex_q", "matlab")[k % 5]
        if (
            "abs" in str(answers)
            or "root" in name
            or "sec(" in str(answers)
            or name == "huge_constant_in_V"
        ):
            notation = "python"
        corpus.right(
            "nasty_" + name, robot, answers, notation, expected=expected, tolerance=tolerance
        )
    for name, (robot, answers) in TRICKS.items():
        wrong = {key: trees(value) for key, value in answers.items()}
        spoiled = [
            e for key, value in wrong.items() for e in differing(key, value, truth(robot)[key])
        ]
        if name == "equal_below_3" or name == "equal_above_minus_3":
            at = {"m": 1, "g": 1, "lc": 1, "q1": 3.1 if "below" in name else -3.1}
            from grading.data.trees import evaluate

            assert (
                abs(evaluate(wrong["g"][0], at) - evaluate(tree(truth(robot)["g"][0]), at)) > 1e-3
            )
        else:
            assert spoiled, name
        place = f"{robot}.toml" if robot in OWN else robot
        corpus.raw(
            "nasty_" + name, robot, ".toml", toml_sheet(place, answers), WRONG, None, "python"
        )
    programs(corpus)


__all__ = ["H2", "parse", "write"]
