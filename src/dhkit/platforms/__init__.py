"""Tasks for teaching platforms: what to upload to Gradescope, PrairieLearn, Otter, nbgrader, Moodle and Canvas.

A task file is packed with its robot into the layout that a platform expects (:func:`pack`). What runs there afterwards
is :mod:`dhkit.platforms.running`.
"""

from dhkit.platforms.packing import PLATFORMS, pack

__all__ = ["PLATFORMS", "pack"]
