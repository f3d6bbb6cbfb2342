"""Packages of a task for the platforms that are known."""

from __future__ import annotations

from pathlib import Path

from dhkit.errors import AnswerError
from dhkit.grading.variants import VariantKey
from dhkit.platforms.containers import (
    gradescope_key_package,
    gradescope_package,
    prairielearn_package,
)
from dhkit.platforms.contents import Installation, Package, Task
from dhkit.platforms.notebooks import nbgrader_package, otter_package
from dhkit.platforms.quizzes import canvas_package, moodle_package, questions

PLATFORMS = ("gradescope", "prairielearn", "otter", "nbgrader", "moodle", "canvas")
IMAGE = "dhkit-grader"
"""Name of PrairieLearn's image unless another is given."""


def pack(
    platform: str,
    task: str | Path,
    *,
    wheel: str | Path | None = None,
    image: str = IMAGE,
    count: int = 20,
    seed: int = 0,
) -> Package:
    r"""Return what is uploaded to a platform for a task.

    Parameters
    ----------
    platform
        One of :data:`PLATFORMS`.
    task
        The task's file, with robot, ``[task]`` and ``[rubric]``; for Gradescope also the key of a task's variants.
    wheel
        Wheel of dhkit to be installed on the platform; by default this version from the package index.
    image
        Name of PrairieLearn's image.
    count
        Number of variants of each question of a quiz (Moodle, Canvas).
    seed
        Seed of their states.

    Returns
    -------
    Package
        Files by name; ``write`` makes a zip file or a folder of them.

    Raises
    ------
    AnswerError
        No such platform; the file is no task, or asks for nothing that the platform can judge.
    DescriptionError
        The robot's file describes no robot.

    Examples
    --------
    >>> from pathlib import Path
    >>> size = Path("task.toml").write_text('robot = "planar2r"\n[task]\nasked = ["M", "g"]')
    >>> sorted(pack("gradescope", "task.toml").files)
    ['run_autograder', 'setup.sh', 'task.toml']
    """
    if platform not in PLATFORMS:
        raise AnswerError(f"platform: found {platform!r}; expected {', '.join(PLATFORMS)}")
    path = Path(task)
    if path.is_dir() or path.suffix == ".json":
        if platform != "gradescope":
            raise AnswerError(f"{path}: a key of variants: only Gradescope says who hands in")
        return gradescope_key_package(VariantKey.read(path), _installation(wheel))
    read = Task.read(path)
    if platform in ("moodle", "canvas"):
        drawn = questions(read, count, seed)
        return moodle_package(read, drawn) if platform == "moodle" else canvas_package(read, drawn)
    installation = _installation(wheel)
    if platform == "gradescope":
        return gradescope_package(read, installation)
    if platform == "prairielearn":
        return prairielearn_package(read, installation, image)
    return (
        otter_package(read, installation)
        if platform == "otter"
        else nbgrader_package(read, installation)
    )


def _installation(wheel: str | Path | None) -> Installation:
    return Installation.of(None if wheel is None else Path(wheel))
