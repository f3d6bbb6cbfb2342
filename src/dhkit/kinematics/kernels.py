"""All kernels of an arm's kinematics, for those who want them compiled before they are used."""

from __future__ import annotations

from dhkit.description import Description, takes_robot
from dhkit.kernels import Kernel
from dhkit.kinematics.forward import frames_kernel, tool_kernel
from dhkit.kinematics.inverse import solver_of
from dhkit.kinematics.jacobian import jacobian_dot_kernel, jacobian_kernel
from dhkit.kinematics.newton import error_kernel, step_kernel


@takes_robot
def kinematic_kernels(description: Description) -> list[Kernel]:
    """Return the kernels of frames, Jacobians and inverse kinematics, in closed form where there is one."""
    solver = solver_of(description)
    kernels = [tool_kernel(description)[0], frames_kernel(description)[0]]
    kernels += [jacobian_kernel(description, "world")[0], jacobian_kernel(description, "tool")[0]]
    kernels += [jacobian_dot_kernel(description, "world")[0], jacobian_dot_kernel(description, "tool")[0]]
    for size in (6, 3):
        kernels += [error_kernel(size), step_kernel(description.n, size)]
    return kernels if solver is None else [*kernels, solver.kernel]
