"""Equations of motion in the exact ring: derived, proved, grouped into base parameters, and written short."""
