"""Judging of single quantities: exactly in the ring, numerically outside it, or by forward kinematics."""
