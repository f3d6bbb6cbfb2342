"""Time simulation beside loops over Pinocchio and roboticstoolbox (`make bench`): benchmarks/results/control.md, .json.

Takes about three minutes; ``--single 1 --arms 1000 --repeats 3`` for a look.
"""

import argparse
import sys
from pathlib import Path

from dhkit.arm import Arm
from dhkit.bench.simulations import SimulationSizes, compare_simulations
from dhkit.cli.bench import write

RESULT = Path(__file__).parent / "results" / "control"
FULL = SimulationSizes()


def main(arguments=None):
    """Run the benchmark, write its report and print it."""
    parser = argparse.ArgumentParser(description="Simulation beside peers.")
    parser.add_argument("--robot", default="puma560", help="of the library (default: puma560)")
    parser.add_argument("--single", type=float, default=FULL.single, help="s of one arm (default: %(default)s)")
    parser.add_argument("--arms", type=int, default=FULL.arms, help="of the batch (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=FULL.repeats, help="rounds (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=RESULT, help="path of the results, without ending")
    chosen = parser.parse_args(arguments)
    report = compare_simulations(
        Arm.load(chosen.robot),
        SimulationSizes(single=chosen.single, arms=chosen.arms, repeats=chosen.repeats),
        seed=chosen.seed,
        progress=lambda line: print(line, file=sys.stderr, flush=True),
    )
    for path in write(report, chosen.output):
        print(f"wrote {path}", file=sys.stderr)
    print(report)


if __name__ == "__main__":
    main()
