"""Write the table of README.md from the results of the benchmark: `make bench` ends with it."""

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
MARKS = ("<!-- speed: tools/readme_table.py -->\n", "<!-- end of speed -->\n")


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


def with_table(readme: str) -> str:
    """Return README's text with the table anew."""
    begin, end = MARKS
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    return pattern.sub(lambda _: f"{begin}{speed_table()}{end}", readme)


if __name__ == "__main__":
    path = ROOT / "README.md"
    write_atomically(path, with_table(path.read_text("utf-8")))
