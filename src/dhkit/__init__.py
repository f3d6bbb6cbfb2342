"""Robot arms from their Denavit-Hartenberg table: URDF, Pinocchio model, kinematics, and a view in the browser."""

from lazy_loader import attach_stub

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
