"""Inverse kinematics derived step by step, exactly: what is looked at, the equation, its solutions, and their proof."""

from dhkit.symbolic.inverse.derivation import InverseDerivation, inverse_derivation

__all__ = ["InverseDerivation", "inverse_derivation"]
