"""Certificates: the limits of a motion checked on a dense grid, and its distances between the states of that grid."""

from dhkit.planning.certificate.checker import Certificate, Checker, certify
from dhkit.planning.certificate.collision_avoidance import (
    NO_AVOIDANCE,
    CollisionAvoidance,
    motion_constraints,
)

__all__ = [
    "NO_AVOIDANCE",
    "Certificate",
    "Checker",
    "CollisionAvoidance",
    "certify",
    "motion_constraints",
]
