"""Extraction of a Denavit-Hartenberg table with bodies, limits and shapes from a chain of a URDF."""

from dhkit.model.extraction.extraction import Extraction, extract_dh, extracted
from dhkit.model.extraction.residual import Original, Residual

__all__ = ["Extraction", "Original", "Residual", "extract_dh", "extracted"]
