"""All kernels of an arm's dynamics, for those who want them compiled before they are used."""

from __future__ import annotations

from dhkit.description import Description, takes_robot
from dhkit.dynamics.loads import friction_kernel, wrench_kernel
from dhkit.dynamics.programs import EXPRESSIONS, dynamics_kernel
from dhkit.kernels import Kernel


@takes_robot
def dynamic_kernels(description: Description) -> list[Kernel]:
    """Return the kernels of friction and wrenches, and of an arm with bodies those of its equation of motion."""
    kernels = [friction_kernel(description.n, smooth) for smooth in (False, True)]
    kernels.append(wrench_kernel(description)[0])
    if all(joint.bodies for joint in description.joints):
        kernels += [dynamics_kernel(quantity, description)[0] for quantity in EXPRESSIONS]
    return kernels
