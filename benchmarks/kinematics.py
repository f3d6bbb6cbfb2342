"""Time kinematics beside its peers (`make bench`): benchmarks/results/kinematics.md and .json.

Arguments are those of `dhkit bench`, as in ``--robot ur5 --batch 10000``.
"""

import sys
from pathlib import Path

from dhkit.cli import main

RESULT = Path(__file__).parent / "results" / "kinematics"

if __name__ == "__main__":
    main(["bench", "fk", "ik", "jacobian", "--output", str(RESULT), *sys.argv[1:]])
