"""What a view shows at one moment, as a page or as pictures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dhkit.description import Array, Description
from dhkit.viewer import protocol
from dhkit.viewer.interactive import interactive_data
from dhkit.viewer.motion import Motion
from dhkit.viewer.page import offline_page
from dhkit.viewer.picture_files import write_motion_gif
from dhkit.viewer.pictures import Ghost, picture
from dhkit.viewer.session import Slot

if TYPE_CHECKING:
    from PIL.Image import Image

DRAWN_BESIDE = (
    (Slot.POINTS, "points of the workspace", "#7f8794"),
    (Slot.ELLIPSOIDS, "ellipsoid: how fast the tool can move", "var(--accent)"),
    (Slot.OBSTACLES, "obstacles", "var(--obstacle)"),
)
"""What a page says of things drawn beside the arm, and in which color of its style."""


EMPTY = 20
"""Bytes of a message about nothing: its header and a count."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """An arm in a state, and what is drawn beside it."""

    description: Description
    messages: Mapping[Slot, bytes]
    """The latest of each slot."""
    q: Array
    """Joint values, shape (n,), rad and m."""
    motion: Motion | None
    """What plays."""
    ghost_names: tuple[tuple[str, str], ...]
    """Names and colors (``#rrggbb``) of the ghosts."""

    def page(
        self,
        interactive: bool,
        motions: Mapping[str, Motion] | None,
        title: str | None,
        caption: str,
        links: Mapping[str, str],
    ) -> str:
        """Return a page without a server: see :meth:`dhkit.viewer.View.html`."""
        title, caption = _text("title", title or f"{self.description.name} · dhkit"), _text("caption", caption)
        if not interactive:
            return offline_page([self.messages[slot] for slot in sorted(self.messages)], title)
        if motions is None:
            motions = {} if self.motion is None else {"motion": self.motion}
        data = interactive_data(
            self.description,
            self.q,
            motions,
            caption=caption,
            links={_text("links", text): _address(address) for text, address in links.items()},
            ghosts=[(_text("names", text), color) for text, color in self.ghost_names],
            overlays=[(text, color) for slot, text, color in DRAWN_BESIDE if len(self.messages.get(slot, b"")) > EMPTY],
        )
        # The page works out poses and motions itself.
        return offline_page([self.messages[slot] for slot in sorted(self.messages) if slot != Slot.MOTION], title, data)

    def picture(self, size: tuple[int, int]) -> Image:
        """Return a picture, with ghosts, path and frames."""
        path = protocol.decode_trace(self.messages[Slot.TRACE]) if Slot.TRACE in self.messages else None
        return picture(self.description, self.q, size=size, frames=self._frames, ghosts=self._ghosts, path=path)

    def write_gif(self, path: str | Path, size: tuple[int, int], rate: float) -> Path:
        """Write the motion as a GIF."""
        if self.motion is None:
            raise ValueError("no motion is on show; expected view.play(motion) before")
        return write_motion_gif(
            self.description, self.motion, path, rate=rate, size=size, frames=self._frames, ghosts=self._ghosts
        )

    @property
    def _frames(self) -> bool:
        return protocol.decode_frames(self.messages[Slot.FRAMES])

    @property
    def _ghosts(self) -> list[Ghost]:
        if Slot.GHOSTS not in self.messages:
            return []
        ghosts = protocol.decode_ghosts(self.messages[Slot.GHOSTS])
        colors = [(int(r), int(g), int(b)) for r, g, b in ghosts.tints]
        return [Ghost(T, color) for T, color in zip(ghosts.transforms, colors, strict=True)]


def _text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name} is {type(value).__name__}; expected a text")
    return value.encode("utf-8", "replace").decode()  # lone surrogates are no text


def _address(value: object) -> str:
    """Return an address that a page may lead to."""
    address = _text("links", value)
    plain = "".join(address.split())  # browsers pass over white space in a scheme
    if not re.match(r"(https?://|mailto:|[^:]*$|[^:/?#]*[/?#])", plain) or not address.isprintable():
        raise ValueError(f"links: found {address[:60]!r}; expected a relative address, or one of http, https or mailto")
    return address
