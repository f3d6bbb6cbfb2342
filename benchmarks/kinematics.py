"""Time kinematics beside its peers, and hold it against our targets: benchmarks/results/kinematics.md, .json."""

from pathlib import Path

from benchmarks.targets import main

if __name__ == "__main__":
    main(("fk", "ik", "ik_numeric", "jacobian"), Path(__file__).parent / "results" / "kinematics")
