"""Write the tables of README.md from the results of the benchmarks: `make bench` ends with it."""

import json
import re
from pathlib import Path
from typing import Any

from dhkit.bench.benchmark_report import duration
from dhkit.description import write_atomically

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
QUANTITIES = {
    "fk": "forward kinematics",
    "ik": "inverse kinematics, all 8 branches",
    "ik_numeric": "numeric inverse kinematics",
    "jacobian": "Jacobian",
    "inverse_dynamics": "inverse dynamics",
    "mass_matrix": "mass matrix",
    "forward_dynamics": "forward dynamics",
    "inverse_dynamics_derivatives": "derivatives of inverse dynamics",
    "regressor": "regressor",
}
BRANCHES = 8
"""Solutions that a contender of inverse kinematics must return to be in the table."""
SPEED_MARKS = ("<!-- speed: tools/readme_table.py -->\n", "<!-- end of speed -->\n")
PROBLEM_MARKS = ("<!-- problems: tools/readme_table.py -->\n", "<!-- end of problems -->\n")


def speed_table() -> str:
    """Return the table: times an item in batches, and of one call, beside the fastest peers."""
    lines = [
        "| | batch: dhkit | fastest peer | one call: dhkit | fastest peer |",
        "|---|---|---|---|---|",
    ]
    for quantity, name in QUANTITIES.items():
        rows = [row for row in _rows() if row["quantity"] == quantity and _is_whole(row)]
        own = [row for row in rows if row["own"]]
        peers = [row for row in rows if not row["own"]]
        cells = [
            duration(_fastest(own, "batch")["seconds"]),
            # Where a peer has no call for batches, its calls in a loop count.
            _named(min(peers, key=lambda row: float(row["seconds"]))),
            duration(_fastest(own, "single")["seconds"]),
            _named(_fastest(peers, "single")),
        ]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    about = json.loads((RESULTS / "kinematics.json").read_text("utf-8"))
    machine = about["machine"]["processor"]
    count = f"{about['batch']:,}"
    lines.append(f"\nTime an item for a PUMA 560, batches of {count}, one core of an {machine}.")
    return "\n".join(lines) + "\n"


def _rows() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for name in ("kinematics", "dynamics"):
        found += json.loads((RESULTS / f"{name}.json").read_text("utf-8"))["rows"]
    return found


def _is_whole(row: dict[str, Any]) -> bool:
    """Return whether a contender's answer is right, and has all branches."""
    # Results in new arrays, as peers return them, and searches from nothing.
    is_plain = "out=" not in row["contender"] and "from 0.05" not in row["contender"]
    expected = {"ik": BRANCHES, "ik_numeric": row["solutions"]}.get(row["quantity"])
    return bool(row["agrees"]) and row["solutions"] == expected and is_plain


def _fastest(rows: list[dict[str, Any]], mode: str) -> dict[str, Any]:
    return min((row for row in rows if row["mode"] == mode), key=lambda row: float(row["seconds"]))


def _named(row: dict[str, Any]) -> str:
    return f"{duration(row['seconds'])} ({row['contender']})"


def problem_table() -> str:
    """Return the table of solvers: how many of the known solutions each finds for the arms that it takes."""
    rows = json.loads((RESULTS / "problems.json").read_text("utf-8"))["rows"]
    lines = [
        "| solver | arms | solutions found | invented | time a pose |",
        "|---|---|---|---|---|",
    ]
    taken = [row for row in rows if not row["reason"]]
    for solver in dict.fromkeys(row["contender"] for row in taken):
        own = [row for row in taken if row["contender"] == solver]
        found = sum(sum(row["found"].values()) for row in own)
        known = found + sum(sum(row["missed"].values()) for row in own)
        times = sorted(row["seconds"] for row in own)
        span = duration(times[0])
        if len(times) > 1:
            span += f" to {duration(times[-1])}"
        cells = (
            solver,
            len(own),
            f"{found:,} of {known:,}",
            sum(row["invented"] for row in own),
            span,
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    arms = {row["robot"]: row["poses"] for row in rows}
    count = f"The {sum(arms.values())} poses of {len(arms)} arms"
    place = "[benchmarks/problems](docs/how-to/benchmark-problems.md)"
    kinds = "regular, next to singularities and limits, and out of reach"
    lines.append(f"\n{count} in {place}: {kinds}.")
    return "\n".join(lines) + "\n"


def with_tables(readme: str) -> str:
    """Return README's text with the tables anew."""
    return _between(_between(readme, SPEED_MARKS, speed_table()), PROBLEM_MARKS, problem_table())


def _between(text: str, marks: tuple[str, str], content: str) -> str:
    """Return a text with the content between two marks replaced."""
    begin, end = marks
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    return pattern.sub(lambda _: f"{begin}{content}{end}", text)


if __name__ == "__main__":
    path = ROOT / "README.md"
    write_atomically(path, with_tables(path.read_text("utf-8")))
