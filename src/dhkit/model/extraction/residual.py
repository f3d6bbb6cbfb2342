"""Differences between an extracted table and its URDF, both computed by Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.display import value_line
from dhkit.errors import ModelError
from dhkit.model.reference import NoPinocchioError, PinocchioModel, pinocchio_model
from dhkit.model.urdf_chain import BASE_FRAME, TIP_FRAME, Chain, chain_model, tip_in_base

_STATES = 100
"""Number of random states of a residual."""
_DEFAULT_STROKE = 1.0
"""Largest displacement of a prismatic joint without limits in random states, m, in both directions."""
_MAX_READING_DIFFERENCE = 1e-9
"""Largest difference of our reading of the file from Pinocchio's, as a share of the arm's size."""
_MIN_GRAVITY_SHARE = 1e-6
"""Errors of gravity torques are relative to this share of weight times reach at least: rounding is 1e-16 of it."""


@dataclass(frozen=True)
class Residual:
    """The largest differences between an extracted table and its URDF over random states.

    Attributes
    ----------
    tool
        Largest difference of an entry of the tool's pose; m, and entries of the rotation.
    mass_matrix, gravity
        Largest difference of an entry of M and of g, relative to their largest entry in all states; None if they were
        not compared.
    states
        Number of random states.
    """

    tool: float
    mass_matrix: float | None
    gravity: float | None
    states: int

    @property
    def largest(self) -> float:
        """The largest of the differences of tool, M and g."""
        return max(self.tool, self.mass_matrix or 0.0, self.gravity or 0.0)

    def __str__(self) -> str:
        parts = [f"tool {self.tool:.1e}"]
        if self.mass_matrix is not None and self.gravity is not None:
            parts += [f"M {self.mass_matrix:.1e}", f"g {self.gravity:.1e}"]
        return f"{', '.join(parts)} over {self.states} random states"

    __repr__ = value_line


class Original:
    """A chain of a URDF at random states: tool, mass matrix and gravity torque.

    Without Pinocchio (there is no wheel of it for Windows) only the tool, by a product of the URDF's own transforms.
    """

    def __init__(self, chain: Chain, states: int = _STATES, seed: int = 0) -> None:
        self.chain = chain
        self.q = _random_states(chain, states, seed)
        try:
            self.model: PinocchioModel | None = chain_model(chain)
        except NoPinocchioError:
            self.model = None
        self.tool = np.array(list(self._tools()))
        steps = [float(np.linalg.norm(joint.T_parent_joint[:3, 3])) for joint in chain.joints]
        self.size = max(float(np.abs(self.tool[:, :3, 3]).max()), *steps) or 1.0
        self.M, self.g = (
            _dynamics(self.model, self.q) if self.model is not None else (np.zeros(0), np.zeros(0))
        )

    def check_reading(self) -> None:
        """Refuse a file that Pinocchio reads as another robot than dhkit.

        Raises
        ------
        ModelError
            The tool's poses differ: one of the readers does not know an element of the file.
        """
        difference = np.abs(np.array([tip_in_base(self.chain, q) for q in self.q]) - self.tool)
        difference[:, :3, 3] /= max(self.size, 1.0)
        if (largest := difference.max()) > _MAX_READING_DIFFERENCE:
            raise ModelError(
                f"{self.chain.path}: Pinocchio puts the tool {largest:.2g} away from where dhkit reads it"
            )

    def residual(self, description: Description) -> Residual:
        """Return the differences of a description's tool, M and g from the URDF's."""
        tool = float(np.abs(world_to_tool(description, self.q) - self.tool).max())
        if self.model is None or not all(joint.bodies for joint in description.joints):
            return Residual(tool, None, None, len(self.q))
        model = pinocchio_model(description)
        model.armature = np.zeros(model.nv)  # a URDF has none
        M, g = _dynamics(model, self.q)

        # max |M - M_0| / max |M_0| over all states; likewise g, whose scale is at least a share of weight times reach.
        numbers = description.numbers
        weight = float(np.nansum(numbers.mass)) * float(np.linalg.norm(numbers.gravity))
        reach = max(description.reach, float(np.abs(self.tool[:, :3, 3]).max()))
        M_scale = float(np.abs(self.M).max())
        g_scale = max(float(np.abs(self.g).max()), _MIN_GRAVITY_SHARE * weight * reach)
        M_error = float(np.abs(M - self.M).max())
        g_error = float(np.abs(g - self.g).max())
        return Residual(tool, M_error / (M_scale or 1.0), g_error / (g_scale or 1.0), len(self.q))

    def _tools(self) -> Iterator[Array]:
        if self.model is None:
            yield from (tip_in_base(self.chain, q) for q in self.q)
            return
        import pinocchio as pin

        data = self.model.createData()
        base = self.model.getFrameId(BASE_FRAME)
        tip = self.model.getFrameId(TIP_FRAME)
        for q in self.q:
            pin.framesForwardKinematics(self.model, data, q)
            yield (data.oMf[base].inverse() * data.oMf[tip]).homogeneous


def _random_states(chain: Chain, count: int, seed: int) -> Array:
    """Return the zero state and random ones, shape (count, n), rad and m: angles of a whole turn, strokes in limits."""
    rng = np.random.default_rng(seed)
    ranges = []
    for joint in chain.joints:
        stroke = joint.limits or (-_DEFAULT_STROKE, _DEFAULT_STROKE)
        ranges.append(stroke if joint.is_prismatic else (-np.pi, np.pi))
    low, high = np.array(ranges).T
    q = rng.uniform(low, high, (count, len(ranges)))
    q[0] = 0.0
    return q


def _dynamics(model: PinocchioModel, q: Array) -> tuple[Array, Array]:
    """Return M, shape (N, n, n), and g, shape (N, n)."""
    import pinocchio as pin

    data = model.createData()
    n = model.nv
    M = np.empty((len(q), n, n))
    g = np.empty((len(q), n))
    for k, state in enumerate(q):
        # Pinocchio fills the upper triangle of the symmetric M only.
        upper = np.triu(np.reshape(np.array(pin.crba(model, data, state)), (n, n)))
        M[k] = upper + np.triu(upper, 1).T
        g[k] = np.reshape(np.array(pin.computeGeneralizedGravity(model, data, state)), n)
    return M, g
