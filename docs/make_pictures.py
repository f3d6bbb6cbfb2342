"""Run the scripts of docs/gallery, and write their pictures and the gallery's page into docs/_generated."""

from __future__ import annotations

import os
import runpy
import sys
import tempfile
import time
from contextlib import chdir
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
SCRIPTS = sorted((HERE / "gallery").glob("*.py"))
ORDER = (
    "least_time_film",
    "puma_frames",
    "eight_branches",
    "library",
    "rotating_box",
    "ellipsoid",
    "workspace",
    "straight_line",
    "quintic",
    "least_time",
    "around_a_post",
    "simulation",
    "controllers",
)
"""Order of the pictures on the page; scripts that are not named here follow."""


def run(script: Path, folder: Path) -> Path:
    """Run a script, and write what it calls ``picture`` or ``film``; return the file."""
    with tempfile.TemporaryDirectory() as scratch, chdir(scratch):
        found = runpy.run_path(str(script))
        if "film" in found:
            return joined(
                [Path(scratch) / part for part in found["film"]], folder / f"{script.stem}.webp"
            )
        value = found["picture"]
    if isinstance(value, Image.Image):
        path = folder / f"{script.stem}.webp"
        value.save(path, quality=88)
        return path
    path = folder / f"{script.stem}.png"
    value.savefig(path, dpi=110, facecolor="white")
    return path


def joined(films: list[Path], path: Path) -> Path:
    """Write films one after the other, as an animated WebP that repeats."""
    frames: list[Image.Image] = []
    durations: list[int] = []
    for film in films:
        with Image.open(film) as source:
            for k in range(source.n_frames):  # type: ignore[attr-defined]
                source.seek(k)
                frames.append(source.convert("RGB"))
                durations.append(source.info.get("duration", 66))
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=durations, loop=0, quality=70
    )
    return path


def caption(script: Path) -> str:
    """Return the docstring of a script."""
    return script.read_text("utf-8").split('"""')[1].strip()


def is_fresh(picture: Path, script: Path) -> bool:
    """Return whether a picture is newer than its script and than dhkit's sources."""
    import dhkit

    if not picture.exists():
        return False
    sources = [script, Path(__file__), *Path(dhkit.__file__).parent.rglob("*.py")]
    return all(path.stat().st_mtime <= picture.stat().st_mtime for path in sources)


def main() -> None:
    """Write the pictures that are not fresh, and the page."""
    folder = HERE / "_generated" / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    order = {name: k for k, name in enumerate(ORDER)}
    blocks = []
    cards = []
    for script in sorted(SCRIPTS, key=lambda path: order.get(path.stem, len(order))):
        picture = next(iter(folder.glob(f"{script.stem}.*")), folder / "none")
        if not is_fresh(picture, script):
            start = time.perf_counter()
            for stale in folder.glob(f"{script.stem}.*"):
                stale.unlink()
            picture = run(script, folder)
            sys.stdout.write(f"{picture.name}: {time.perf_counter() - start:.1f} s\n")
        name = script.stem.replace("_", " ").capitalize()
        file = f"/_generated/gallery/{picture.name}"
        cards.append(
            f":::{{grid-item-card}}\n:img-top: {file}\n:link: {script.stem}\n:link-type: ref\n{name}\n:::\n"
        )
        blocks.append(
            f"({script.stem})=\n## {name}\n{caption(script)}\n\n![{caption(script)}]({file})\n\n"
            f"```{{literalinclude}} /gallery/{script.name}\n:language: python\n:start-at: import\n```\n"
        )
    blocks.insert(0, "::::{grid} 2 2 3 4\n:gutter: 2\n\n" + "\n".join(cards) + "::::\n")
    (HERE / "_generated" / "gallery.md").write_text("\n".join(blocks), "utf-8")


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
