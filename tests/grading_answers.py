"""Answers made of exact elements: what a student would write down."""

from pathlib import Path

import numpy as np

from dhkit.description import library_robot, read_robot
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.exact.compact import shortened
from dhkit.symbolic.ring import element_array

SHEETS = Path(__file__).parent / "grading" / "sheets"
ROBOTS = ("planar2r", "planar3r", "polar_rp", "cart_pendulum", "pan_tilt", "cobra600", "puma3")


def corpus_robot(name):
    return read_robot(SHEETS / "puma3" / "puma3.toml") if name == "puma3" else library_robot(name)


def written(elements, arm=None):
    """Return an element as text, an array as nested lists of text, in the arm's shortest angles if one is given."""
    array = element_array(elements)
    array = shortened(arm, array) if arm is not None else array
    return _texts(array.tolist() if array.ndim else array.item())


def _texts(value):
    return [_texts(entry) for entry in value] if isinstance(value, list) else plain_text(value)


def is_zero(elements):
    return all(element.is_zero for element in element_array(elements).flat)


def named(report):
    """Return the mistakes that a report names, and those that give the same answers, each with its place as well."""
    names = set()
    for one in report.diagnosis:
        names |= {one.mistake, f"{one.mistake} ({one.where.partition(', ')[2]})", *one.equivalent}
        names |= {other.partition(" ")[0] for other in one.equivalent}
    return names - {None}


def constants_dropped(element):
    """Return what of an energy depends on the state."""
    constant = np.array([g.kind == "constant" for g in element.ring.generators])
    terms = {m: c for m, c in element.terms.items() if any(np.array(m)[~constant])}
    return element.ring.from_terms(terms)
