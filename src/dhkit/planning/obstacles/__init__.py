"""Obstacles: scenes, capsules around links, exact distances, and separating planes."""

from dhkit.planning.obstacles.capsules import (
    LinkBody,
    LinkCapsule,
    link_capsules,
    link_name,
    world_axes,
)
from dhkit.planning.obstacles.clearance import (
    Distances,
    distance,
    not_checked,
    pair_distances,
    smallest_distances,
)
from dhkit.planning.obstacles.nearest import (
    NearestLinks,
    NearestObstacle,
    may_touch,
    nearest_links,
    nearest_obstacle,
)
from dhkit.planning.obstacles.pairs import (
    CheckedPairs,
    LinkPairs,
    Pair,
    checked_pairs,
    link_pairs,
    standing,
)
from dhkit.planning.obstacles.scene import Floor, Obstacle, Scene, check_obstacles
from dhkit.planning.obstacles.separation import Gaps, PlaneRow, Separation
from dhkit.planning.obstacles.solids import shape_distances

__all__ = [
    "CheckedPairs",
    "Distances",
    "Floor",
    "Gaps",
    "LinkBody",
    "LinkCapsule",
    "LinkPairs",
    "NearestLinks",
    "NearestObstacle",
    "Obstacle",
    "Pair",
    "PlaneRow",
    "Scene",
    "Separation",
    "check_obstacles",
    "checked_pairs",
    "distance",
    "link_capsules",
    "link_name",
    "link_pairs",
    "may_touch",
    "nearest_links",
    "nearest_obstacle",
    "not_checked",
    "pair_distances",
    "shape_distances",
    "smallest_distances",
    "standing",
    "world_axes",
]
