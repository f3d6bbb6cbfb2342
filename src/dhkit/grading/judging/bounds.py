"""Bounds on the work of judging one answer, counted and not timed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Largest sizes of answers and largest work; an answer beyond them is not judged, or a mistake in it not named."""

    # Exact reading (quotients of ring elements).
    reading_work: int = 300_000
    """Pairs of terms in the products of one entry, weighted by the size of their coefficients. A PUMA's longest
    entry takes 60,000; the bound is about a second on sympy's rings."""
    exponent: int = 64
    """Exponent, and multiple of a joint variable in an angle, that is multiplied out."""
    product_terms: int = 60_000
    """Terms of a product."""
    coefficient_bits: int = 8_192
    """Size of a coefficient in bits. Doubles need 1,100; products of 8,192 bits still take microseconds."""
    divisors: int = 16
    """Divisors that are kept, to say where an entry is undefined."""
    written_terms: int = 400
    """Terms of a difference that is written in the angles which make it shortest."""

    # Rounded coefficients.
    rounding_products: int = 200_000
    """Products of two terms in multiplying an answer out: about a second."""
    rounded_coefficients: int = 2_000
    """Coefficients with an allowance: a PUMA's longest entry in numbers has 300."""

    # Answers outside the ring, tried at random states.
    sampled_nodes: int = 20_000
    """Nodes of an answer."""
    states: int = 1_000
    """Random states for one entry, unless it is long."""
    fewest_states: int = 15
    """Smallest number of states: an answer too long for them cannot be judged."""
    evaluations: int = 300_000
    """Product of nodes and states."""
    sampling_work: int = 60 * evaluations
    """Product of nodes and digits, over all states."""
    enclosure_work: int = 1_000_000
    """Product of a tree's parts and digits, beyond the first precision: about a second's work."""
    argument_bits: int = 2_000
    """Integer part of a function's argument or an exponent, in bits."""
    power_bits: int = 100_000
    """Size of a power in bits."""

    # Inverse kinematics.
    formula_nodes: int = 5_000
    """Nodes of a formula; a PUMA's longest has 200."""
    hypotheses: int = 100
    """Ways to take earlier joints without a right solution that are followed at once."""
    edits: int = 4_000
    """Changes of one formula in search of a mistake; a PUMA's longest, of 200 nodes, has 2,500."""
    offset_lengths: int = 12
    """Lengths of the robot that are tried as a missing offset."""
    law_terms: int = 8
    """Terms of a law of cosines of which pairs of signs are tried."""
    edited_nodes: int = 1_000
    """Parts of a formula in which mistakes are looked for; a PUMA's longest has 200."""
    edit_poses: int = 100
    """Poses that fail, and poses that are reached, at which mistakes are looked for."""
    edit_work: int = 4_000_000
    """Changes for one answer, each times the parts of its formula: a few seconds' work."""

    # Tables.
    table_entry: float = 1e6
    """Entry of a table, m or rad: no arm has larger ones, and comparing axes would lose digits."""
    angle_multiple: int = 8
    """Multiple of a joint variable in an angle that is compared exactly."""


BOUNDS = Bounds()
