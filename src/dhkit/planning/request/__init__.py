"""Requests: the places to pass, the routes through them, options, and reasons why there can be no motion."""

from dhkit.planning.request.feasibility import (
    CONSTRAINT_ROUNDING,
    require_holdable,
    require_inside_limits,
    require_place,
    require_possible,
)
from dhkit.planning.request.options import PathKeywords, PathOptions, PlanKeywords, PlanOptions
from dhkit.planning.request.places import Route, find_routes, parse_places
from dhkit.planning.request.request import (
    PlanRequest,
    checked_constraints,
    checked_limits,
    end_velocity,
    smoothed,
)

__all__ = [
    "CONSTRAINT_ROUNDING",
    "PathKeywords",
    "PathOptions",
    "PlanKeywords",
    "PlanOptions",
    "PlanRequest",
    "Route",
    "checked_constraints",
    "checked_limits",
    "end_velocity",
    "find_routes",
    "parse_places",
    "require_holdable",
    "require_inside_limits",
    "require_place",
    "require_possible",
    "smoothed",
]
