"""Write the tables of docs/_generated from results of benchmarks and laws, and llms.txt from the pages."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import dhkit
from dhkit import Arm
from dhkit.bench.benchmark_report import duration

HERE = Path(__file__).parent
RESULTS = HERE.parent / "benchmarks" / "results"
QUANTITIES = {
    "fk": "forward kinematics",
    "ik": "inverse kinematics",
    "ik_numeric": "numeric inverse kinematics",
    "jacobian": "Jacobian",
    "inverse_dynamics": "inverse dynamics",
    "mass_matrix": "mass matrix",
    "forward_dynamics": "forward dynamics",
    "inverse_dynamics_derivatives": "derivatives of inverse dynamics",
    "regressor": "regressor",
}
ACCURACY = {
    "kinematics": (
        "closure of every branch",
        "closure at a singularity",
        "distance of the sets of solutions to EAIK's",
        "closure",
    ),
    "model": ("Jacobian (world) against Pinocchio", "frame positions against Pinocchio"),
    "dynamics": (
        "M compiled against Pinocchio",
        "C compiled against Pinocchio",
        "g compiled against Pinocchio",
        "tau compiled against Pinocchio",
        "qdd compiled against Pinocchio",
        "Mdot - 2 C, skew",
        "dE/dt against qd . tau",
    ),
    "symbolic": ("exact M", "exact h", "exact g", "exact tau"),
    "kernels": ("sine and cosine, ulp", "arc tangent, ulp"),
    "planning": (
        "velocity above its limit",
        "torque above its limit",
        "duration over toppra's",
        "bang-bang: 2 sqrt(d / a)",
        "effort: 12 d^2 / T^3",
    ),
    "grading": (
        "slips that pass",
        "right answers that are refused",
        "false verdicts",
        "share of mistakes that are not named",
    ),
}
"""Quantities of laws that the page on accuracy lists, by the folder of their tests."""


GIVEN = "redundancy given"
"""What a contender's name says that solves at a given redundancy."""
SETTING = re.compile(r'\b\w+="\w+"')
"""An argument with its value, as a contender's name states it."""


def read(name: str) -> dict[str, Any]:
    """Return a results file."""
    found: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))
    return found


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    titles = list(head)
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def rounded(value: float, digits: int = 0) -> str:
    """Return an error with a power of ten, after so many digits; 0 is 0."""
    return f"{value:.{digits}e}" if value else "0"


def ratio_text(ratio: float) -> str:
    """Return a ratio with two digits and without a power of ten."""
    return f"{ratio:.2g}" if ratio < 99.5 else f"{float(f'{ratio:.2g}'):,.0f}"


def contender(row: dict[str, Any]) -> str:
    """Return the name of a contender, with settings as code."""
    return SETTING.sub(r"`\g<0>`", row["contender"])


def machine(found: dict[str, Any]) -> str:
    """Return a line on the machine and the versions of a run."""
    about = found["machine"]
    versions = ", ".join(f"{name} {value}" for name, value in about["packages"].items())
    return f"{about['processor']}, {about['cores']} cores; {about['python']}; {versions}."


def speed_rows(found: dict[str, Any], mode: str) -> Iterator[list[str]]:
    """Yield a row for each contender of a mode, the fastest of each quantity in bold."""
    for quantity, name in QUANTITIES.items():
        rows = [row for row in found["rows"] if row["quantity"] == quantity and row["mode"] == mode]
        rows = [row for row in rows if "out=" not in row["contender"] or GIVEN in row["contender"]]
        own = next((row["seconds"] for row in rows if row["own"]), None)
        for k, row in enumerate(sorted(rows, key=lambda row: row["seconds"])):
            is_fastest = row["seconds"] == min(other["seconds"] for other in rows)
            time = duration(row["seconds"])
            ratio = "" if own is None else ratio_text(row["seconds"] / own)
            error = rounded(row["error"])
            agrees = error if row["agrees"] else f"**{error}**"
            solutions = "" if row["solutions"] is None else f"{row['solutions']:.2f}"
            yield [
                name if k == 0 else "",
                contender(row),
                f"**{time}**" if is_fastest else time,
                ratio,
                solutions,
                agrees,
            ]


SPEED_HEAD = ("quantity", "contender", "time an item", "× dhkit", "solutions", "error")


def speed_table(mode: str) -> str:
    """Return the table of kinematics and dynamics of one mode."""
    rows = [row for name in ("kinematics", "dynamics") for row in speed_rows(read(name), mode)]
    return table(SPEED_HEAD, rows)


def inverse_kinematics(name: str) -> str:
    """Return the tables of an arm's inverse kinematics, one pose a call and in batches."""
    found = read(f"kinematics_{name}")
    found["rows"] = [row for row in found["rows"] if row["quantity"] in ("ik", "ik_numeric")]
    single = table(SPEED_HEAD, speed_rows(found, "single"))
    batch = table(SPEED_HEAD, speed_rows(found, "batch"))
    return f"{single}\nIn batches:\n\n{batch}\n{machine(found)}\n"


def planning_table() -> str:
    """Return the table of motions in least time."""
    rows = [
        [
            f"{row['speed']:g}",
            contender(row),
            f"{100 * (row['mean'] - 1):.2f} %",
            rounded(row["excess"]),
            duration(row["seconds"]),
        ]
        for row in read("planning")["rows"]
    ]
    head = ("limits of speed ×", "contender", "longer than the best", "largest excess", "time")
    return table(head, rows)


def simulation_table() -> str:
    """Return the table of simulated motions."""
    rows = [
        [
            row["problem"],
            contender(row),
            duration(row["timing"]["seconds"]),
            rounded(row["joint_error"]) if row["joint_error"] else "reference",
        ]
        for row in read("control")["integration"]
    ]
    batches = [
        [
            f"{row['arms']:,} arms, 1 s of computed torque: time a step and arm",
            contender(row),
            duration(row["each"]["seconds"]),
            "" if row["difference"] is None else rounded(row["difference"]),
        ]
        for row in read("control")["batch"]
    ]
    return table(("problem", "contender", "time", "largest joint error [rad]"), rows + batches)


def derivation_table() -> str:
    """Return the table of symbolic derivations."""
    rows = [
        [row["robot"], row["what"], duration(row["seconds"])]
        for row in read("dynamics")["derivations"]
    ]
    return table(("robot", "derivation", "time"), rows)


def comparison() -> dict[str, str]:
    """Return the tables of the page on peers, by name."""
    return {
        "comparison-batch": speed_table("batch"),
        "comparison-single": speed_table("single"),
        "comparison-panda": inverse_kinematics("panda"),
        "comparison-jaco": inverse_kinematics("jaco"),
        "comparison-planning": planning_table(),
        "comparison-simulation": simulation_table(),
        "comparison-derivations": derivation_table(),
        "comparison-machine": machine(read("kinematics")),
    }


def accuracy() -> str:
    """Return the table of laws: what was required, and the worst that was seen."""
    laws = read("acceptance")["laws"]
    rows = []
    for folder, quantities in ACCURACY.items():
        for quantity in quantities:
            found = [
                law
                for law in laws
                if law["law"].startswith(f"{folder}/") and law["quantity"] == quantity
            ]
            if not found:
                raise LookupError(f"no law of {folder} has the quantity {quantity!r}")
            rows.append(
                [
                    f"{folder}: {quantity}",
                    str(len(found)),
                    f"{max(law['samples'] for law in found):,}",
                    rounded(max(law["seen"] for law in found), 1),
                    f"{found[0]['required']:g}",
                ]
            )
    return table(("quantity", "cases", "samples a case", "worst seen", "allowed"), rows)


def library() -> str:
    """Return the table of the library's robots."""
    rows = []
    for name in dhkit.robots():
        arm = Arm.load(name)
        source = " ".join((arm.description.source or "").split()).removesuffix(".")
        rows.append([f"`{name}`", arm.description.kinds, arm.description.convention.value, source])
    return table(("name", "joints", "table", "source"), rows)


def title(path: Path) -> str:
    """Return the first heading of a page."""
    found = re.search(r"^# (.*)$", path.read_text("utf-8"), re.MULTILINE)
    return found[1] if found else path.stem


def llms() -> str:
    """Return llms.txt: what dhkit is, its rules, and an index of the pages."""
    intro = (HERE / "llms.md").read_text("utf-8")
    lines = [intro.rstrip(), ""]
    for folder in ("tutorials", "how-to", "explanation"):
        lines += ["", f"## {title(HERE / folder / 'index.md')}"]
        pages = sorted(path for path in (HERE / folder).glob("*.md") if path.stem != "index")
        lines += [f"- [{title(path)}]({folder}/{path.stem}.html)" for path in pages]
    lines += ["", "## Guides"]
    lines += [
        f"- [{title(path)}]({path.stem}.html)"
        for path in sorted(HERE.glob("*.md"))
        if path.stem not in {"index", "llms"}
    ]
    lines += ["", "## Arm, method by method"]
    for name, member in vars(Arm).items():
        if not name.startswith("_"):
            about = getattr(member, "__func__", member).__doc__ or ""
            lines.append(f"- `{name}`: {about.strip().splitlines()[0]}")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write all tables."""
    folder = HERE / "_generated"
    (folder / "extra").mkdir(parents=True, exist_ok=True)
    tables = {**comparison(), "accuracy": accuracy(), "library": library()}
    for name, text in tables.items():
        (folder / f"{name}.md").write_text(text, "utf-8")
    (folder / "extra" / "llms.txt").write_text(llms(), "utf-8")


if __name__ == "__main__":
    main()
