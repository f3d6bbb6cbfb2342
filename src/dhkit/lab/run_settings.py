"""What a run of the control panel simulates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dhkit.control import CONTROLLERS
from dhkit.dynamics import Friction
from dhkit.lab.fields import Fields

SMOOTH = 0.05
"""rad/s or m/s of smooth friction."""
FRICTIONS = ("none", "smooth", "stiction")
REFERENCES = ("hold", "sine", "motion", "target", "sliders")
PARTS = ("controller", "bandwidth", "damping", "friction", "payload", "compensate", "reference")
OWN = "own"
"""The name of the controller of the person's own program."""
TITLES = {
    OWN: "Your own",
    "pd": "PD of each joint",
    "pid": "PID of each joint",
    "pd-gravity": "PD and gravity",
    "feed-forward": "Feed-forward",
    "computed-torque": "Computed torque",
    "operational-space": "Operational space",
    "adaptive": "Adaptive",
    "lqr": "LQR",
}


@dataclass(frozen=True)
class Settings:
    """What is simulated."""

    controller: str = "computed-torque"
    bandwidth: float = 20.0
    """rad/s."""
    damping: float = 1.0
    friction: str = "none"
    payload: float = 0.0
    """kg at the tool, which the controller does not know of."""
    compensate: bool = False
    reference: str = "hold"

    def changed(self, request: str, data: dict[str, Any]) -> Settings:
        """Return the settings with some of them changed.

        Raises
        ------
        ValueError
            A value that is none.
        """
        fields = Fields(request, data, PARTS)
        return Settings(
            fields.choice("controller", [*CONTROLLERS, OWN], self.controller),
            fields.number("bandwidth", 0.1, 1000.0, self.bandwidth),
            fields.number("damping", 0.01, 10.0, self.damping),
            fields.choice("friction", FRICTIONS, self.friction),
            fields.number("payload", 0.0, 1000.0, self.payload),
            fields.flag("compensate", self.compensate),
            fields.choice("reference", REFERENCES, self.reference),
        )

    @property
    def model(self) -> Friction | None:
        """The friction of the joints."""
        return {"none": None, "smooth": Friction(SMOOTH), "stiction": Friction()}[self.friction]
