"""The two paths from a table, our own mechanics and Pinocchio's, held against each other."""

from dhkit.verification.kinematics import random_states, verify
from dhkit.verification.report import Agreement, VerificationReport

__all__ = ["Agreement", "VerificationReport", "random_states", "verify"]
