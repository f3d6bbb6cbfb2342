"""The two paths from a table, our own mechanics and Pinocchio's, held against each other."""

from dhkit.verification.comparison import verify
from dhkit.verification.foreign import verify_urdf
from dhkit.verification.report import Agreement, VerificationReport
from dhkit.verification.states import Motion, random_motions, random_states

__all__ = ["Agreement", "Motion", "VerificationReport", "random_motions", "random_states", "verify", "verify_urdf"]
