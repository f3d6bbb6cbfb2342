"""Obstacles: scenes, capsules around links, exact distances, and smooth distances for an optimizer."""

from dhkit.planning.obstacles.capsules import LinkCapsule, link_capsules, world_axes
from dhkit.planning.obstacles.clearance import Distances, deficits, distance
from dhkit.planning.obstacles.pairs import CheckedPairs, checked_pairs
from dhkit.planning.obstacles.scene import Floor, Obstacle, Scene, check_obstacles
from dhkit.planning.obstacles.slots import SceneSlots
from dhkit.planning.obstacles.smooth import clearances

__all__ = [
    "CheckedPairs",
    "Distances",
    "Floor",
    "LinkCapsule",
    "Obstacle",
    "Scene",
    "SceneSlots",
    "check_obstacles",
    "checked_pairs",
    "clearances",
    "deficits",
    "distance",
    "link_capsules",
    "world_axes",
]
