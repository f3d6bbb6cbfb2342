"""Time dynamics beside its peers, and hold it against our targets: benchmarks/results/dynamics.md, .json."""

from pathlib import Path

from benchmarks.targets import main

if __name__ == "__main__":
    main(
        (
            "inverse_dynamics",
            "mass_matrix",
            "forward_dynamics",
            "inverse_dynamics_derivatives",
            "regressor",
        ),
        Path(__file__).parent / "results" / "dynamics",
    )
