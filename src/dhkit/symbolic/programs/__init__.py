"""Straight-line programs: read from expressions, counted, and printed as Python and C."""
