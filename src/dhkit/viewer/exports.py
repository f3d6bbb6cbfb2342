"""A view as one offline page, as a picture or as a GIF of its motion."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dhkit.description import Array, Description
from dhkit.description.files import write_atomically
from dhkit.viewer.interactive import interactive_data
from dhkit.viewer.motion import Motion
from dhkit.viewer.page import offline_page
from dhkit.viewer.picture_files import write_motion_gif, write_png
from dhkit.viewer.pictures import Ghost, picture
from dhkit.viewer.session import Slot

if TYPE_CHECKING:
    from PIL.Image import Image

    from dhkit.planning.obstacles import Scene

_OVERLAYS = (
    (Slot.POINTS, "points of the workspace", "#7f8794"),
    (Slot.ELLIPSOIDS, "ellipsoid: how fast the tool can move", "var(--accent)"),
    (Slot.OBSTACLES, "obstacles", "var(--obstacle)"),
)
"""The name and the color, in the page's style, of each overlay that is drawn beside the arm."""
_EMPTY_LENGTH = 20
"""Bytes of a message of an overlay without content: its header and a count."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """An arm in a state, and the drawings beside it.

    Attributes
    ----------
    description
        The arm.
    messages
        The latest message of each slot.
    q
        Joint values, shape (n,), rad and m.
    motion
        The motion that plays, if one does.
    frames
        Whether the DH frames are drawn.
    ghosts
        Translucent copies of the arm.
    ghost_names
        Names and colors (``#rrggbb``) of those ghosts that have names.
    trace
        Points that a line is drawn through, shape (N, 3), m, world; None for no line.
    obstacles
        Obstacles around the arm.
    """

    description: Description
    messages: Mapping[Slot, bytes]
    q: Array
    motion: Motion | None
    frames: bool
    ghosts: tuple[Ghost, ...]
    ghost_names: tuple[tuple[str, str], ...]
    trace: Array | None
    obstacles: Scene


class Exportable(ABC):
    """A view that can be written to files."""

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """Return the present contents of the view."""

    def html(
        self,
        *,
        interactive: bool = False,
        motions: Mapping[str, Motion] | None = None,
        title: str | None = None,
        caption: str = "",
        links: Mapping[str, str] | None = None,
    ) -> str:
        """Return the present state as one HTML page that needs no server and no network.

        Parameters
        ----------
        interactive
            Whether the page has panels: sliders of the joints, the tool's pose, a table that can be edited, and the
            motions.
        motions
            Motions of an interactive page, by name, as :meth:`dhkit.viewer.View.play` takes them; the motion on show if
            not given.
        title
            The page's title; the arm's name if not given.
        caption
            What an interactive page says about itself: paragraphs, one a line.
        links
            Addresses of further pages, relative to this one, by the text that leads there.

        Raises
        ------
        ValueError, TypeError, DescriptionError
            A motion that cannot be played: see :meth:`dhkit.viewer.View.play`.
        """
        shown = self.snapshot()
        title = _text("title", title or f"{shown.description.name} · dhkit")
        caption = _text("caption", caption)
        messages = {slot: shown.messages[slot] for slot in sorted(shown.messages)}
        if not interactive:
            return offline_page([*messages.values()], title)
        if motions is None:
            motions = {} if shown.motion is None else {"motion": shown.motion}
        data = interactive_data(
            shown.description,
            shown.q,
            motions,
            caption=caption,
            links={
                _text("links", text): _address(address) for text, address in (links or {}).items()
            },
            ghosts=[(_text("names", text), color) for text, color in shown.ghost_names],
            overlays=[
                (text, color)
                for slot, text, color in _OVERLAYS
                if len(messages.get(slot, b"")) > _EMPTY_LENGTH
            ],
        )
        messages.pop(Slot.MOTION, None)  # the page works out poses and motions itself
        return offline_page([*messages.values()], title, data)

    def save_html(
        self,
        path: str | Path,
        *,
        interactive: bool = False,
        motions: Mapping[str, Motion] | None = None,
        title: str | None = None,
        caption: str = "",
        links: Mapping[str, str] | None = None,
    ) -> Path:
        """Write :meth:`html` to a file and return its path.

        Examples
        --------
        >>> import tempfile
        >>> from dhkit.description.library import library_robot
        >>> from dhkit.viewer import View
        >>> view = View(library_robot("planar2r"))
        >>> motions = {"up": ([0.0, 1.0], [[0.0, 0.0], [1.0, 1.0]])}
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = view.save_html(f"{folder}/arm.html", interactive=True, motions=motions)
        ...     print(page.name)
        arm.html
        """
        text = self.html(
            interactive=interactive, motions=motions, title=title, caption=caption, links=links
        )
        write_atomically(path, text)
        return Path(path)

    def picture(self, size: tuple[int, int] = (960, 720)) -> Image:
        """Return the present state as a picture, with ghosts, path and frames, drawn without a browser.

        Parameters
        ----------
        size
            Width and height, px.
        """
        shown = self.snapshot()
        return picture(
            shown.description,
            shown.q,
            size=size,
            frames=shown.frames,
            ghosts=shown.ghosts,
            path=shown.trace,
            obstacles=shown.obstacles,
        )

    def save_png(self, path: str | Path, size: tuple[int, int] = (960, 720)) -> Path:
        """Write :meth:`picture` as PNG and return the path."""
        return write_png(self.picture(size), path)

    def save_gif(
        self, path: str | Path, size: tuple[int, int] = (480, 360), rate: float = 15.0
    ) -> Path:
        """Write the motion that plays as a GIF of ``rate`` pictures a second; return the path.

        Raises
        ------
        ValueError
            No motion is on show, or one of more than 900 pictures.
        """
        shown = self.snapshot()
        if shown.motion is None:
            raise ValueError("no motion is on show; expected view.play(motion) before")
        return write_motion_gif(
            shown.description,
            shown.motion,
            path,
            rate=rate,
            size=size,
            frames=shown.frames,
            ghosts=shown.ghosts,
            obstacles=shown.obstacles,
        )


def _text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name} is {type(value).__name__}; expected a text")
    return value.encode("utf-8", "replace").decode()  # UTF-8 has no lone surrogates


def _address(value: object) -> str:
    """Return an address that a page may lead to."""
    address = _text("links", value)
    plain = "".join(address.split())  # browsers pass over white space in a scheme
    if (
        not re.match(r"(https?://|mailto:|[^:]*$|[^:/?#]*[/?#])", plain)
        or not address.isprintable()
    ):
        raise ValueError(
            f"links: found {address[:60]!r}; expected a relative address, or one of http, https or mailto"
        )
    return address
