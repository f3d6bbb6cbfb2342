"""What a test reads off a screenshot of the signal arm: counts and places of its colors, whatever the light."""

from __future__ import annotations

import numpy as np

MINIMUM = 400
"""Pixels of a color from which a solid counts as seen; the column alone covers some 10,000 of 630,000."""


def magenta(picture: np.ndarray) -> np.ndarray:
    """Return which pixels are the column's, shape (height, width)."""
    r, g, b = np.moveaxis(picture, -1, 0)
    return (r > 60) & (b > 60) & (g < 0.5 * np.minimum(r, b)) & (np.abs(r - b) < 40)


def green(picture: np.ndarray) -> np.ndarray:
    """Return which pixels are the ball's, shape (height, width)."""
    r, g, b = np.moveaxis(picture, -1, 0)
    return (g > 60) & (r < 0.45 * g) & (b < 0.45 * g)


def orange(picture: np.ndarray) -> np.ndarray:
    """Return which pixels are the trace's in the light scheme, shape (height, width)."""
    return np.abs(picture - (0xD9, 0x48, 0x0F)).max(axis=-1) < 12


def shows_the_arm(picture: np.ndarray) -> bool:
    """Whether column and ball are seen."""
    return bool(magenta(picture).sum() > MINIMUM and green(picture).sum() > MINIMUM)


def centre(mask: np.ndarray) -> np.ndarray:
    """Return the middle of the box around marked pixels, (x, y) in px: a highlight does not move it."""
    y, x = np.nonzero(mask)
    return np.array([x.min() + x.max() + 1, y.min() + y.max() + 1]) / 2
