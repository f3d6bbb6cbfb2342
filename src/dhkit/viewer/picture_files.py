"""Files of pictures: PNG of an arm, GIF and series of PNG of its motions."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Description, write_atomically
from dhkit.viewer.motion import Motion, interpolate, played_motion
from dhkit.viewer.pictures import Ghost, pictures
from dhkit.viewer.scene import node_transforms

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

    from dhkit.planning.obstacles import Scene

_GIF_COLORS = 128
_MAX_PICTURES = 900
"""Most pictures of one GIF, or of one series of files."""


def write_png(image: Picture, path: str | Path) -> Path:
    """Write a picture as PNG, whole or not at all, and return the path."""
    content = io.BytesIO()
    image.save(content, format="PNG", optimize=True)
    write_atomically(Path(path), content.getvalue())
    return Path(path)


def _write_gif(images: Iterable[Picture], path: str | Path, rate: float) -> Path:
    """Write pictures, ``rate`` of them a second, as a GIF that repeats, and return the path."""
    # All pictures share one palette, so that still parts do not flicker.
    from PIL import Image

    first, *others = images
    palette = first.quantize(_GIF_COLORS, dither=Image.Dither.NONE)
    frames = [
        palette,
        *(
            image.quantize(_GIF_COLORS, palette=palette, dither=Image.Dither.NONE)
            for image in others
        ),
    ]
    # Times of a GIF are whole hundredths of a second: rounded one by one, they would add up to another duration.
    durations = 10 * np.diff(np.rint(100 / rate * np.arange(len(frames) + 1))).astype(int)
    content = io.BytesIO()
    palette.save(
        content,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=durations.tolist(),
        loop=0,
        disposal=1,
    )
    write_atomically(Path(path), content.getvalue())
    return Path(path)


def write_motion_gif(
    description: Description,
    motion: Motion,
    path: str | Path,
    *,
    rate: float = 15.0,
    size: tuple[int, int] = (480, 360),
    frames: bool = False,
    ghosts: Sequence[Ghost] = (),
    obstacles: Scene = (),
    progress: Callable[[int, int], None] = lambda done, whole: None,
) -> Path:
    """Write a motion as a GIF in real time, with the tool's path, and a ghost at the reference of a simulation.

    Parameters
    ----------
    description
        The arm.
    motion
        The motion, as :meth:`dhkit.viewer.View.play` takes it.
    path
        The file.
    rate
        Pictures per second, Hz.
    size, frames, ghosts, obstacles
        As for :func:`dhkit.viewer.pictures.picture`.
    progress
        Called with the number of pictures that are drawn, and of all.

    Raises
    ------
    ValueError
        The rate is not from 1 to 50 Hz, or the motion needs more than 900 pictures.
    """
    if not 1 <= rate <= 50:
        raise ValueError(f"rate is {rate:g}; expected 1 to 50 pictures a second")
    duration = float(played_motion(description, motion).times[-1])
    count = max(2, round(duration * rate) + 1)
    if count > _MAX_PICTURES:
        raise ValueError(
            f"{duration:g} s at {rate:g} pictures a second are {count} pictures; expected at most {_MAX_PICTURES}: "
            "a lower rate, or a shorter motion"
        )

    def images() -> Iterator[Picture]:
        for k, image in enumerate(
            _motion_pictures(description, motion, count, size, frames, ghosts, obstacles), start=1
        ):
            yield image
            progress(k, count)

    return _write_gif(images(), path, rate)


def write_motion_pngs(
    description: Description,
    motion: Motion,
    path: str | Path,
    *,
    count: int = 6,
    size: tuple[int, int] = (960, 720),
    frames: bool = False,
    ghosts: Sequence[Ghost] = (),
    obstacles: Scene = (),
) -> list[Path]:
    """Write ``count`` pictures of a motion at equal steps of time; each file is ``path`` with a number in its name."""
    path = Path(path)
    digits = len(str(count))
    images = _motion_pictures(description, motion, count, size, frames, ghosts, obstacles)
    return [
        write_png(image, path.with_name(f"{path.stem}-{k:0{digits}}{path.suffix}"))
        for k, image in enumerate(images, 1)
    ]


def _motion_pictures(
    description: Description,
    motion: Motion,
    count: int,
    size: tuple[int, int],
    frames: bool,
    ghosts: Sequence[Ghost],
    obstacles: Scene,
) -> Iterable[Picture]:
    if not 2 <= count <= _MAX_PICTURES:
        raise ValueError(f"{count} pictures; expected 2 to {_MAX_PICTURES}")
    times, q, reference_q = played_motion(description, motion)
    path = node_transforms(description, q)[:, -1, :3, 3]
    grid = np.linspace(0.0, times[-1], count)
    references = None if reference_q is None else interpolate(times, reference_q, grid)
    shown_q = interpolate(times, q, grid)
    return pictures(
        description,
        shown_q,
        size=size,
        frames=frames,
        ghosts=ghosts,
        path=path,
        obstacles=obstacles,
        references=references,
    )
