"""An arm's mechanics as expressions: CasADi frames and Jacobians, straight-line programs, and their source text."""

from lazy_loader import attach_stub

from dhkit.formats import register_formats

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)

register_formats("dhkit.symbolic.equations.text", "plain_text", "equations_text")
register_formats("dhkit.symbolic.equations.latex", "latex_text", "equations_latex")
register_formats("dhkit.symbolic.equations.sympy_objects", "equations_sympy")
register_formats("dhkit.symbolic.equations.python_code", "equations_python", "inverse_python")
register_formats("dhkit.symbolic.equations.c_code", "equations_c", "inverse_c")
register_formats("dhkit.symbolic.equations.matlab_code", "equations_matlab", "inverse_matlab")
register_formats(
    "dhkit.symbolic.equations.quantities", "readable", "quantities", "kinematic_quantities"
)
register_formats(
    "dhkit.symbolic.equations.inverse_text", "inverse_text", "inverse_latex", "inverse_table"
)
register_formats("dhkit.symbolic.equations.inverse_page", "inverse_page")
register_formats("dhkit.symbolic.equations.inverse_sympy", "inverse_sympy")
