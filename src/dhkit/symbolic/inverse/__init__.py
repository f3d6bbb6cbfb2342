"""Inverse kinematics derived step by step, exactly.

Each step has the point or direction that is considered, its equation, the solutions and their proof.
"""

from dhkit.symbolic.inverse.derivation import InverseDerivation, inverse_derivation

__all__ = ["InverseDerivation", "inverse_derivation"]
