"""Bounds on the search for mistakes of students: combinations that are tried, and terms that are compared."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes of a search; beyond them a mistake may stay without a name, and the verdict is the same."""

    derived_pairs: int = 150
    """Pairs of mistakes at one link that are derived for a quantity; their changes do not add up."""
    pair_terms: int = 600
    """Differing terms for which pairs of mistakes are tried: with more the search takes too long."""
    subset_links: int = 4
    """Links of which all subsets are tried."""
    half_length_joints: int = 3
    """Joints of an arm for which half of a length may stand for another length; larger ones have too many pairs."""
    compared_terms: int = 150
    """Differing terms of an entry in which a slip is looked for."""
    described_terms: int = 600
    """Terms of an entry that is described term by term."""
    changed_terms: int = 16
    """Terms by which an answer and the truth differ in which a slip is looked for."""
    slip_terms: int = 4
    """Terms that one slip changes: m2*(l1^2 + l2^2) may be multiplied out."""


BOUNDS = Bounds()
