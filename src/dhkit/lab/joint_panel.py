"""The panel of joints: values by slider and number, named configurations, random ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from dhkit.lab.desk import Desk
from dhkit.lab.fields import LARGEST_JOINT_VALUE, Fields
from dhkit.programs import random_states


class JointPanel:
    """Requests ``joints.…``."""

    def __init__(self, desk: Desk, seed: int = 0) -> None:
        self.desk = desk
        self._random = np.random.default_rng(seed)

    def set(self, data: dict[str, Any]) -> dict[str, Any]:
        """Move the arm to joint values; those outside limits are marked. A simulation takes them as its setpoint."""
        fields, n = Fields("joints.set", data, ["q", "joint"]), self.desk.arm.n
        q = fields.vector("q", n, LARGEST_JOINT_VALUE)
        self.desk.steer(q, fields.whole("joint", 0, n - 1) if "joint" in fields else None)
        return {}

    def named(self, data: dict[str, Any]) -> dict[str, Any]:
        """Show a configuration by its name, zero, or random joint values inside the limits."""
        arm = self.desk.arm
        name = Fields("joints.named", data, ["name"]).choice("name", ["zero", "random", *arm.configurations])
        if name == "random" and name not in arm.configurations:
            q = random_states(arm, self._random, 1)[0]
        else:
            q = np.array(arm.configurations.get(name, np.zeros(arm.n)))
        self.desk.steer(q, None)
        return {"q": q.tolist()}
