"""Comparison of our mechanics with Pinocchio's, and of URDFs of other sources with a table."""

from dhkit.verification.comparison import verify
from dhkit.verification.foreign import verify_urdf
from dhkit.verification.states import JointStates, random_motions, random_states
from dhkit.verification.verification_report import Agreement, VerificationReport

__all__ = [
    "Agreement",
    "JointStates",
    "VerificationReport",
    "random_motions",
    "random_states",
    "verify",
    "verify_urdf",
]
