"""Readable equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dhkit.symbolic.ring import Element

__all__ = ["plain_text"]


def plain_text(element: Element) -> str:
    """Return an element as text, term by term."""
    parts = []
    for monomial, c in element.terms.items():
        names = [
            g.text if e == 1 else f"{g.text}^{e}"
            for g, e in sorted(
                zip(element.ring.generators, monomial, strict=True), key=lambda p: -element.ring.generators.index(p[0])
            )
            if e
        ]
        number = [str(abs(c))] if abs(c) != 1 or not names else []
        parts.append(("-" if c < 0 else "+") + "*".join(number + names))
    return " ".join(parts).removeprefix("+") or "0"
