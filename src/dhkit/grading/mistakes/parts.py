"""Torques and the Lagrangian taken apart: terms with accelerations, with products of rates, and with neither."""

from __future__ import annotations

from dhkit.grading.judging.truth import Truth
from dhkit.grading.mistakes.diagnosis import Differences, Index
from dhkit.symbolic.ring import Element


def split_in_parts(truth: Truth, name: str, differences: Differences) -> dict[str, Differences]:
    """Split by what the terms are multiplied by; torques of accelerations give M's entries."""
    ring = next(iter(differences.values())).ring
    n = ring.n
    accelerations = [ring.place("acceleration", i) for i in range(n)]
    rates = [ring.place("rate", i) for i in range(n)]
    parts: dict[str, dict[Index, Element]] = {"M": {}, "h": {}, "g": {}} if name == "tau" else {"K": {}, "V": {}}
    for index, element in differences.items():
        moving = {m: c for m, c in element.terms.items() if any(m[k] for k in rates)}
        resting = {m: c for m, c in element.terms.items() if not any(m[k] for k in (*rates, *accelerations))}
        if name == "L":
            parts["K"][index], parts["V"][index] = ring.from_terms(moving), -ring.from_terms(resting)
            continue
        parts["h"][index], parts["g"][index] = ring.from_terms(moving), ring.from_terms(resting)
        by_joint = [_coefficient(element, k) for k in accelerations]
        for j in range(n):
            parts["M"][*index, j] = ring.sum(by_joint[k] * int(truth.coordinates.B[k, j]) for k in range(n))
    return parts  # type: ignore[return-value]


def _coefficient(element: Element, place: int) -> Element:
    """Return what an acceleration is multiplied by."""
    terms = {(*m[:place], 0, *m[place + 1 :]): c for m, c in element.terms.items() if m[place] == 1}
    return element.ring.from_terms(terms)
