"""A second check of a motion, which shares nothing with the first: dense samples, Pinocchio, and coal on drawn shapes.

The first check (:mod:`dhkit.planning.certificate`) bounds the motion between its states, measures capsules around the
links, and computes torques and poses by dhkit's own programs. This one proves nothing; it refutes a certificate that is
wrong. It

- evaluates the polynomials of the motion and their derivatives itself, in states between which no joint turns by more
  than 0.02 rad, and closer around the largest value of each quantity (``instants``, ``joints``);
- computes torques by ``pinocchio.rnea`` of the model that Pinocchio reads from the URDF (``joints``);
- measures each two solids that are drawn, a mesh as its convex hull, by coal at poses of Pinocchio's frames, and halves
  the time between two states while a collision fits between them (``distances``).
"""

from dhkit.planning.second_check.recheck import recheck
from dhkit.planning.second_check.result import Claim, Recheck, Refutation

__all__ = ["Claim", "Recheck", "Refutation", "recheck"]
