"""Variants of a task: each student has an arm of their own, and the instructor keeps the key.

``ranges`` has the numbers that may be drawn, ``conventions`` changes an arm's table, ``variants`` reads the task's
table ``[variants]`` and draws, ``students`` reads a list of students, ``key`` is what grading needs.
"""

from dhkit.grading.variants.key import VariantKey
from dhkit.grading.variants.variants import Variant, Variants

__all__ = ["Variant", "VariantKey", "Variants"]
