"""A robot's report: its sections in order, within the course's number of pages, and its files."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from dhkit.control import SimulationResult
from dhkit.description import Description, takes_robot, write_atomically
from dhkit.display import repr_line
from dhkit.errors import DescriptionError
from dhkit.report.document import (
    Block,
    Code,
    Document,
    Heading,
    Paragraph,
    Prompt,
    References,
    html_text,
    latex_text,
    pdf,
)
from dhkit.report.document.pdf import require_typst
from dhkit.report.sections.control import (
    Motion,
    control_section,
    default_motion,
    motion_section,
    verification_section,
)
from dhkit.report.sections.dynamics import dynamics_section
from dhkit.report.sections.inverse import inverse_section
from dhkit.report.sections.kinematics import kinematics_section
from dhkit.report.sections.robot import robot_section
from dhkit.report.sections.velocities import velocities_section
from dhkit.report.words import PROGRAMS, Attachments, name_of, source_of
from dhkit.trajectories import Trajectory, read_motion

log = logging.getLogger(__name__)
FORMATS = ("pdf", "html", "tex")
MOST_PAGES = 30
"""Largest number of pages (Cao 2011, step 7)."""
_LISTED_LINES = (240, 120, 60, 0)
"""Lines of programs in the appendix: the first number that leaves the report within its pages is taken, or the last."""
_LISTED_WIDTH = 100
"""Columns of a line of a program in the appendix."""
_REFERENCES = (
    "M. W. Spong, S. Hutchinson, M. Vidyasagar, Robot Modeling and Control, John Wiley & Sons, 2006.",
    "B. Siciliano, L. Sciavicco, L. Villani, G. Oriolo, Robotics: Modelling, Planning and Control, Springer, 2009.",
    "J. Denavit, R. S. Hartenberg, A kinematic notation for lower-pair mechanisms based on matrices, Journal of "
    "Applied Mechanics 22, 1955, pp. 215-221.",
    "M. Gautier, W. Khalil, Direct calculation of minimum set of inertial parameters of serial robots, IEEE "
    "Transactions on Robotics and Automation 6(3), 1990, pp. 368-373.",
    "Y. Cao, Learning robotics through developing a virtual robot simulator in Matlab, ASEE Annual Conference, "
    "AC 2011-609, 2011.",
)


@dataclass(frozen=True)
class Report:
    """A written report.

    Attributes
    ----------
    path
        The report.
    files
        All files, the report first: figures of LaTeX, and programs beside it.
    pages
        Number of pages of a PDF; None for the other formats.
    """

    path: Path
    files: tuple[Path, ...]
    pages: int | None

    def __repr__(self) -> str:
        pages = "" if self.pages is None else f"{self.pages} pages, "
        return repr_line("Report", str(self.path), f"{pages}{len(self.files)} files")


@dataclass(frozen=True, eq=False)
class Article:
    """The content of a report.

    Attributes
    ----------
    document
        The document, with all programs in its appendix.
    programs
        Texts of the files beside it, by name.
    """

    document: Document
    programs: Mapping[str, str]


@takes_robot
def article(
    description: Description,
    motion: Trajectory | None = None,
    run: SimulationResult | None = None,
) -> Article:
    """Return the content of a robot's report.

    Parameters
    ----------
    description
        The robot.
    motion
        The motion that it shows; a quintic between two configurations if not given.
    run
        A simulation that it shows besides the comparison of controllers; one of an arm with locked joints stands for
        the simplified model on which control is tried.

    Returns
    -------
    Article
        Title, sections, figures and programs, before they are printed.

    Raises
    ------
    DescriptionError
        The motion is one of another robot.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> content = article(library_robot("planar2r"))
    >>> sorted(content.programs)
    ['equations.py', 'kinematics.py', 'planar2r_ik.py']
    """
    if motion is not None:
        motion.require(description)
    files = Attachments()
    chosen = (
        default_motion(description) if motion is None else Motion(motion, "the one that was given")
    )
    blocks = list(_blocks(description, chosen, run, files))
    name = name_of(description)
    document = Document(
        f"{name}: kinematics, dynamics and control of a robot arm",
        tuple(blocks),
        "Author, student number, course and date",
    )
    return Article(document, files.texts)


def _blocks(
    description: Description, motion: Motion, run: SimulationResult | None, files: Attachments
) -> Iterator[Block]:
    yield Heading("Abstract", is_numbered=False)
    yield Prompt("Say in five sentences what was built, by which methods, and what came out.")
    yield Heading("Introduction")
    yield Prompt(
        "State the task, why this robot was chosen, what others have done, and how this report is organized."
    )
    yield from robot_section(description)
    yield from kinematics_section(description, files)
    yield from inverse_section(description, files)
    yield from velocities_section(description)
    yield from dynamics_section(description, files)
    yield from verification_section(description)
    yield from motion_section(description, motion)
    yield from control_section(description, motion, run, files)
    yield Heading("Conclusions")
    yield Prompt("Say what was learned, what does not work yet, and what you would do next.")
    yield Heading("References", is_numbered=False)
    source = source_of(description)
    yield References(
        (*_REFERENCES, *([f"Source of the robot's data: {source}."] if source else []))
    )


def _with_appendix(content: Article, lines: int) -> Document:
    """Return the document with an appendix of programs, at most so many lines of each."""
    blocks: list[Block] = [
        *content.document.blocks,
        Heading("Appendix: programs", is_numbered=False),
    ]
    names = ", ".join(content.programs)
    blocks.append(Paragraph(f"Files beside this report, in the folder {PROGRAMS}: {names}."))
    blocks.append(Prompt("Attach the programs of your simulator."))
    left = lines
    for name, text in content.programs.items():
        listing = text.rstrip("\n").split("\n")
        if not name.endswith((".py", ".m", ".c")) or len(listing) > left:
            continue
        left -= len(listing)
        blocks.append(Code("\n".join(_short_lines(listing)), name))
    return replace(content.document, blocks=tuple(blocks))


def _short_lines(lines: list[str]) -> Iterator[str]:
    """Yield lines of a program in pieces that fit the page, broken at spaces where there are any."""
    for line in lines:
        rest = line
        while len(rest) > _LISTED_WIDTH:
            end = rest.rfind(" ", len(rest) - len(rest.lstrip()) + 1, _LISTED_WIDTH)
            end = _LISTED_WIDTH if end < 0 else end
            yield rest[:end]
            rest = f"        {rest[end:].lstrip()}"
        yield rest


@takes_robot
def write_report(
    description: Description,
    folder: str | Path,
    motion: Trajectory | str | Path | None = None,
    run: SimulationResult | str | Path | None = None,
    format: str = "pdf",
) -> Report:
    """Write a robot's report into a folder, with its programs beside it.

    Parameters
    ----------
    description
        The robot.
    folder
        The folder, which is made if there is none; ``report.pdf`` (``.html``, ``.tex``) of an earlier run is replaced.
    motion
        A motion, or its file; see :func:`article`.
    run
        A simulation, or its file.
    format
        ``"pdf"``, ``"html"`` or ``"tex"``.

    Returns
    -------
    Report
        The files written.

    Raises
    ------
    ValueError
        Another format.
    DescriptionError
        The folder is a file, or a motion or simulation cannot be read.
    MissingPackageError
        A PDF without the package typst, or no package that draws.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> write_report(library_robot("planar2r"), "out/planar2r", format="html")  # doctest: +SKIP
    <Report of out/planar2r/report.html: 4 files>
    """
    if format not in FORMATS:
        raise ValueError(f"format is {format!r}; expected {', '.join(FORMATS)}")
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise DescriptionError(f"{place} is a file; expected a folder")
    if format == "pdf":
        require_typst()
    if isinstance(motion, str | Path):
        motion = read_motion(motion, description)
    if isinstance(run, str | Path):
        run = SimulationResult.load(run)
    content = article(description, motion, run)
    files: dict[str, str | bytes] = {}
    pages = None
    if format == "pdf":
        for lines in _LISTED_LINES:
            printed = pdf(_with_appendix(content, lines))
            if printed.pages <= MOST_PAGES:
                break
        else:
            log.warning(
                "%s: %d pages, more than %d, even without programs in the appendix",
                place / "report.pdf",
                printed.pages,
                MOST_PAGES,
            )
        files["report.pdf"] = printed.content
        pages = printed.pages
    elif format == "html":
        files["report.html"] = html_text(_with_appendix(content, _LISTED_LINES[0]))
    else:
        text, figures = latex_text(_with_appendix(content, _LISTED_LINES[1]), "figures")
        files["report.tex"] = text
        files |= figures
    files |= {f"{PROGRAMS}/{name}": text for name, text in content.programs.items()}
    for name, data in files.items():
        write_atomically(place / name, data)
    return Report(place / f"report.{format}", tuple(place / name for name in files), pages)
