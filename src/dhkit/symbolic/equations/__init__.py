"""Readable equations: one collected form, printed as text, LaTeX, sympy objects, Python, C and MATLAB."""

from dhkit.symbolic.equations.c_code import equations_c
from dhkit.symbolic.equations.html import equation_mathml, html_page
from dhkit.symbolic.equations.latex import (
    constant_latex,
    displays,
    equations_latex,
    latex_lines,
    latex_text,
)
from dhkit.symbolic.equations.latex_document import latex_document
from dhkit.symbolic.equations.matlab_code import equations_matlab, matlab_files
from dhkit.symbolic.equations.python_code import equations_python
from dhkit.symbolic.equations.quantities import (
    KINEMATIC_QUANTITIES,
    Quantity,
    is_kinematic,
    kinematic_quantities,
    quantities,
    readable,
    rounded,
)
from dhkit.symbolic.equations.sympy_objects import equations_sympy, sympy_object
from dhkit.symbolic.equations.text import equations_text, plain_text
from dhkit.symbolic.exact.lagrangian import QUANTITIES
from dhkit.symbolic.ring.notation import constants_of, generators_of, renamings, symbols_of

__all__ = [
    "KINEMATIC_QUANTITIES",
    "QUANTITIES",
    "Quantity",
    "constant_latex",
    "constants_of",
    "displays",
    "equation_mathml",
    "equations_c",
    "equations_latex",
    "equations_matlab",
    "equations_python",
    "equations_sympy",
    "equations_text",
    "generators_of",
    "html_page",
    "is_kinematic",
    "kinematic_quantities",
    "latex_document",
    "latex_lines",
    "latex_text",
    "matlab_files",
    "plain_text",
    "quantities",
    "readable",
    "renamings",
    "rounded",
    "symbols_of",
    "sympy_object",
]
