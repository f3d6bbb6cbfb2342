"""What holding the two paths against each other found."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Agreement", "VerificationReport"]


@dataclass(frozen=True)
class Agreement:
    """The worst disagreement seen in one quantity.

    Attributes
    ----------
    quantity
        What was compared.
    error
        The largest error over the samples, by the quantity's measure; NaN if a value was missing or not finite.
    tolerance
        The largest error that still counts as agreement.
    q
        The state at which it was seen, rad and m.
    """

    quantity: str
    error: float
    tolerance: float
    q: tuple[float, ...]

    @property
    def ok(self) -> bool:
        """Whether the two agree."""
        return self.error <= self.tolerance


@dataclass(frozen=True)
class VerificationReport:
    """Our own numbers against Pinocchio's, over random states.

    Attributes
    ----------
    robot
        Its name.
    reference
        What it was held against, with its version.
    samples, seed
        How many random states, from which seed.
    agreements
        The worst of each quantity.
    """

    robot: str
    reference: str
    samples: int
    seed: int
    agreements: tuple[Agreement, ...]

    @property
    def ok(self) -> bool:
        """Whether every quantity agrees."""
        return all(agreement.ok for agreement in self.agreements)

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        width = max(len(agreement.quantity) for agreement in self.agreements)
        lines = [f"{self.robot} against {self.reference}, {self.samples} states, seed {self.seed}"]
        for agreement in self.agreements:
            verdict = "agrees" if agreement.ok else f"DISAGREES at q = {[float(f'{x:.6g}') for x in agreement.q]}"
            figures = f"{agreement.error:8.1e}  of at most {agreement.tolerance:.0e}"
            lines.append(f"  {agreement.quantity:{width}}  {figures}  {verdict}")
        return "\n".join(lines)
