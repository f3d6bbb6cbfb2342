r"""Equations as papers typeset them: displays of amsmath and IEEEtran, matrices, elements, and macros."""

import pytest

from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade

PAPERS = {
    "equation_bmatrix": (
        "correct",
        "M",
        r"""
\begin{equation}\label{eq:M}
\mathbf{M}(\mathbf{q}) = \begin{bmatrix}
 \frac{1}{3}m_1 l_1^2 + m_2 l_1^2 + \frac{1}{3} m_2 l_2^2 + m_2 l_1 l_2 \cos q_2 & \frac{1}{3} m_2 l_2^2
  + \frac{1}{2} m_2 l_1 l_2 \cos q_2 \\
 \frac{1}{3} m_2 l_2^2 + \frac{1}{2} m_2 l_1 l_2 \cos q_2 & \frac{1}{3} m_2 l_2^2
\end{bmatrix}
\end{equation}
""",
    ),
    "align_continued": (
        "incomplete",
        "V g",
        r"""
\begin{align}
V &= \frac{m_1 g l_1}{2}\sin\theta_1 \nonumber\\
  &\quad + m_2 g\left(l_1 \sin\theta_1 + \frac{l_2}{2}\sin(\theta_1+\theta_2)\right), \label{eq:V}\\
g_2 &= \frac12 m_2 g l_2 \cos(\theta_1+\theta_2).
\end{align}
""",
    ),
    "split": (
        "correct",
        "V",
        r"""
\begin{equation}
\begin{split}
V = {} & \tfrac{1}{2} m_1 g l_1 s_1 \\
& + m_2 g \bigl( l_1 s_1 + \tfrac{1}{2} l_2 s_{12} \bigr)
\end{split}
\end{equation}
""",
    ),
    "multline": (
        "correct",
        "V",
        r"""
\begin{multline}
V = \frac{1}{2} m_1 g l_1 \sin q_1 \\
+ m_2 g \Big( l_1 \sin q_1 + \frac{1}{2} l_2 \sin (q_1+q_2) \Big)
\end{multline}
""",
    ),
    "ieee": (
        "correct",
        "V",
        r"""
\begin{IEEEeqnarray}{rCl}
V & = & \frac{1}{2} m_1 g l_1 \sin\theta_1 + m_2 g l_1 \sin\theta_1 \IEEEnonumber\\
&& +\: \frac{1}{2} m_2 g l_2 \sin(\theta_1+\theta_2)
\end{IEEEeqnarray}
""",
    ),
    "where": (
        "correct",
        "V",
        r"""
The potential energy is
\begin{equation}
U = m_1 g l_{c1} s_1 + m_2 g (l_1 s_1 + l_{c2} s_{12}),
\end{equation}
where $l_{c1} = l_1/2$, $l_{c2} = l_2/2$, $s_1 = \sin\theta_1$ and $s_{12} = \sin(\theta_1+\theta_2)$.
""",
    ),
    "elements": (
        "correct",
        "M",
        r"""
with the elements
\begin{align*}
M_{11} &= \tfrac13 m_1 l_1^2 + m_2\left(l_1^2 + \tfrac13 l_2^2 + l_1 l_2 c_2\right),\\
M_{12} &= M_{21} = m_2\left(\tfrac13 l_2^2 + \tfrac12 l_1 l_2 c_2\right),\\
M_{22} &= \tfrac13 m_2 l_2^2.
\end{align*}
""",
    ),
    "dots": (
        "correct",
        "C g",
        r"""
\begin{gather}
\boldsymbol{C}(\boldsymbol{q},\dot{\boldsymbol{q}}) = \begin{pmatrix} -\tfrac12 m_2 l_1 l_2 s_2 \dot{q}_2
  & -\tfrac12 m_2 l_1 l_2 s_2 (\dot q_1 + \dot q_2)\\ \tfrac12 m_2 l_1 l_2 s_2 \dot q_1 & 0\end{pmatrix}\\
\boldsymbol{g}(\boldsymbol q) = \begin{pmatrix} (\tfrac12 m_1 + m_2) g l_1 \cos q_1
  + \tfrac12 m_2 g l_2 \cos(q_1+q_2)\\ \tfrac12 m_2 g l_2 \cos(q_1+q_2)\end{pmatrix}
\end{gather}
""",
    ),
    "tau": (
        "correct",
        "tau",
        r"""
\begin{align}
\tau_1 ={}& \left[\frac{m_1 l_1^2}{3} + m_2 l_1^2 + \frac{m_2 l_2^2}{3}
  + m_2 l_1 l_2 \cos\theta_2\right]\ddot{\theta}_1
+ \left[\frac{m_2 l_2^2}{3} + \frac{m_2 l_1 l_2}{2} \cos\theta_2\right]\ddot{\theta}_2\notag\\
&- m_2 l_1 l_2 \sin\theta_2\,\dot{\theta}_1\dot{\theta}_2 - \frac{m_2 l_1 l_2}{2}\sin\theta_2\,\dot{\theta}_2^2\notag\\
&+ \left(\frac{m_1}{2}+m_2\right) g l_1\cos\theta_1 + \frac{m_2 g l_2}{2}\cos(\theta_1+\theta_2)\\
\tau_2 ={}& \left[\frac{m_2 l_2^2}{3} + \frac{m_2 l_1 l_2}{2}\cos\theta_2\right]\ddot{\theta}_1
  + \frac{m_2 l_2^2}{3}\ddot{\theta}_2
+ \frac{m_2 l_1 l_2}{2}\sin\theta_2\,\dot{\theta}_1^2 + \frac{m_2 g l_2}{2}\cos(\theta_1+\theta_2)
\end{align}
""",
    ),
    "aligned_array": (
        "correct",
        "K T",
        r"""
\[
\begin{aligned}
K &= \tfrac12 \left(\tfrac13 m_1 l_1^2 + m_2 l_1^2\right)\dot{\theta}_1^2
   + \tfrac16 m_2 l_2^2 (\dot{\theta}_1 + \dot{\theta}_2)^2 \\
  &\phantom{=}\; + \tfrac12 m_2 l_1 l_2 \cos(\theta_2)\, \dot{\theta}_1 (\dot{\theta}_1+\dot{\theta}_2)
\end{aligned}
\]
\[ T = \left[\begin{array}{cccc} c_{12} & -s_{12} & 0 & l_1 c_1 + l_2 c_{12}\\ s_{12} & c_{12} & 0
  & l_1 s_1 + l_2 s_{12} \\ 0&0&1&0\\ 0&0&0&1\end{array}\right] \]
""",
    ),
    "newcommand": (
        "unreadable",
        "V",
        r"""
\newcommand{\qa}{\theta_1}
\newcommand{\qb}{\theta_2}
\newcommand{\mass}[1]{m_{#1}}
\newcommand*{\half}{\frac{1}{2}}
\[ V = \half \mass{1} g l_1 \sin\qa + \mass{2} g ( l_1 \sin\qa + \half l_2 \sin(\qa+\qb) ) \]
""",
    ),
    "def_mathrm": (
        "unreadable",
        "V",
        r"""
\def\th#1{\vartheta_{#1}}
\begin{eqnarray}
V &=& \textstyle\frac{1}{2} m_1 \, g \, l_1 \, \mathrm{sin}(\th{1}) \nonumber \\
&& \mbox{} + m_2 g \left\{ l_1 \sin(\th{1}) + \textstyle\frac{1}{2} l_2 \sin(\th{1} + \th{2}) \right\}
\end{eqnarray}
""",
    ),
}
"""Displays of a paper about planar2r, with the verdict and the quantities that they give."""
DOCUMENT = (
    r"\documentclass{article}\usepackage{amsmath}\begin{document}Let $x = 3$.%s\end{document}"
)


@pytest.mark.parametrize("name", PAPERS)
def test_equations_of_papers(name, tmp_path):
    verdict, quantities, display = PAPERS[name]
    path = tmp_path / "paper.tex"
    path.write_text(DOCUMENT % display)
    if verdict == "unreadable":
        with pytest.raises(
            AnswerError,
            match=r"the macro .*is not read; write it out in one formula, or on a sheet$",
        ):
            grade(path, library_robot("planar2r"))
        return
    report = grade(path, library_robot("planar2r"), explain=False)
    assert (report.verdict.value, report.quantities) == (verdict, tuple(quantities.split())), report
    assert not report.left_out


@pytest.mark.parametrize(
    "name", [name for name, (verdict, *_) in PAPERS.items() if verdict == "correct"]
)
def test_a_changed_sign_is_found(name, tmp_path):
    display = PAPERS[name][2]
    changed = display.replace("+", "-", 1) if "+" in display else display.replace("-", "", 1)
    path = tmp_path / "paper.tex"
    path.write_text(DOCUMENT % changed)
    assert grade(path, library_robot("planar2r"), explain=False).verdict.value == "wrong"
