"""Hold motions in least time against classical ones and toppra's (`make bench`): benchmarks/results/planning.md, .json.

Takes some minutes; ``--pairs 3`` for a look.
"""

import argparse
import sys
from pathlib import Path

from dhkit.bench.motions import compare_motions
from dhkit.cli.bench import write
from dhkit.description import library_robot

RESULT = Path(__file__).parent / "results" / "planning"


def main(arguments=None):
    """Run the benchmark, write its report and print it."""
    parser = argparse.ArgumentParser(description="Motions in least time beside others.")
    parser.add_argument("--robot", default="puma560", help="of the library (default: puma560)")
    parser.add_argument("--pairs", type=int, default=30, help="random starts and goals (default: 30)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=RESULT, help="path of the results, without ending")
    chosen = parser.parse_args(arguments)
    report = compare_motions(
        library_robot(chosen.robot),
        chosen.pairs,
        seed=chosen.seed,
        progress=lambda line: print(line, file=sys.stderr, flush=True),
    )
    for path in write(report, chosen.output):
        print(f"wrote {path}", file=sys.stderr)
    print(report)


if __name__ == "__main__":
    main()
