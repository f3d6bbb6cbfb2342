"""Robot arms from a Denavit-Hartenberg table: URDF, Pinocchio, kinematics, dynamics, grading, planning, viewer."""

from pkgutil import iter_modules

from lazy_loader import attach_stub

__version__ = "0.2.0"

__getattr__, _, _names = attach_stub(__name__, __file__)

# A star import leaves out the packages, whose names (model, control) are those of users' variables.
__all__ = ["__version__", *sorted({*_names} - {module.name for module in iter_modules(__path__)})]


def __dir__() -> list[str]:
    return sorted({*__all__, *_names})
