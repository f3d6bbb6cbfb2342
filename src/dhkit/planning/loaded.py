"""An arm with its payload, told apart from the arm alone by type."""

from __future__ import annotations

from typing import NewType

from dhkit.description import Description, Payload

LoadedArm = NewType("LoadedArm", Description)
"""An arm whose last link includes the payload, if there is one."""


def loaded(description: Description, payload: Payload | None = None) -> LoadedArm:
    """Return an arm with its payload."""
    return LoadedArm(description if payload is None else payload.carried(description))
