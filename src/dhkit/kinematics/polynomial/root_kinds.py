"""What programs of eliminations tell of the roots of a trigonometric polynomial of degree 8, as numbers."""

DEGREE = 8
ROOTS = 2 * DEGREE
SAMPLES = 20
"""Number of values. 17 would do; the other coefficients then tell how exactly the values are a polynomial's."""

# Kinds of roots. Their sum over a pose's roots is the number of its solutions, with a fraction if some are near.
NONE = 0.0
"""It is not real: there is no solution. Outputs of skipped items are 0, so that this has to be 0."""
SOLUTION = 1.0
"""There is one solution, and it is not singular."""
NEAR_SOLUTION = 1.0 + 1.0 / 64
"""There is one solution, and it is not singular; that of a near root may be the same."""
DOUBTFUL = 1024.0
"""It may be real, has several solutions or one that does not close, or nearly coincides with another root."""

# What is known of a root, as bits of a number.
IS_TRIED = 1
"""It is nearly real."""
IS_REAL = 2
"""It is real up to its error, or may be."""
IS_BESIDE = 4
"""Another root is near or at the same angle: their solutions may be the same one, or singular."""
IS_DELICATE = 8
"""The solution may be singular, or that of another root."""
