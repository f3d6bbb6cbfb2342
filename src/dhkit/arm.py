"""The class ``Arm``: a robot with all methods of dhkit, which delegate to the packages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Unpack

from numpy.typing import ArrayLike

from dhkit import description as describe
from dhkit.cached_property import cached_property
from dhkit.description import Array, Description, DHTable, Named
from dhkit.display import repr_line
from dhkit.errors import DescriptionError

if TYPE_CHECKING:
    from dhkit.control import (
        BatchOptions,
        BatchResult,
        Comparison,
        Controller,
        Reference,
        SimulationOptions,
        SimulationResult,
    )
    from dhkit.control.options import BatchKeywords, SimulationKeywords
    from dhkit.description import Body, Payload
    from dhkit.description.table_rows import Quantity
    from dhkit.grading import GradeReport, Rubric
    from dhkit.kinematics import (
        Classification,
        IKPath,
        IKSolutions,
        Motion,
        ReferenceAxes,
        Singularities,
        Workspace,
    )
    from dhkit.model import PinocchioModel
    from dhkit.model.urdf_chain import Side
    from dhkit.planning import (
        Certificate,
        Constraint,
        Distances,
        ObjectiveLike,
        PathOptions,
        Planner,
        PlanOptions,
        Scene,
    )
    from dhkit.planning.request import PathKeywords, PlanKeywords
    from dhkit.symbolic import (
        BaseParameters,
        CasadiFunctions,
        Friction,
        Lagrangian,
        SymbolicKinematics,
        Symbols,
    )
    from dhkit.trajectories import JointPath, Limits, Torques, Trajectory
    from dhkit.verification import VerificationReport
    from dhkit.viewer import View


class Arm:
    """A serial robot arm; immutable, equal to its copies, picklable, safe to share between threads.

    Angles are in radians, lengths in metres; arrays are float64 with leading batch axes: q (..., n).

    Examples
    --------
    >>> arm = Arm.load("puma560")
    >>> arm.n, arm.name
    (6, 'puma560')
    >>> arm.fk(arm.configurations["ready"])[:3, 3].round(4)
    array([ 0.0203, -0.15  ,  1.5354])
    """

    _description: Description

    def __init__(self, description: Description) -> None:
        if isinstance(description, str | Path):
            name = str(description)
            raise TypeError(
                f"found {name!r}; expected a Description: Arm.load({name!r}) reads a robot"
            )
        if not isinstance(description, describe.Description):
            raise TypeError(
                f"found a {type(description).__name__}; expected a Description, as Arm.load reads it"
            )
        object.__setattr__(self, "_description", description)

    # Constructors

    @classmethod
    def load(
        cls,
        name: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        as_designed: bool = False,
    ) -> Arm:
        """Return a robot of the library by name, or read a robot file (``.toml``) or a chain of a URDF by path.

        ``example:NAME`` is a robot of the package example-robot-data. After a URDF or an example, ``#TIP`` or
        ``#BASE..TIP`` may name the links between which the chain lies, as ``base`` and ``tip`` do.

        Parameters
        ----------
        name
            Name or path.
        base, tip
            First and last link of the chain in a URDF; by default its root, and the end of its only chain.
        as_designed
            Read rounded angles of a URDF, such as 1.5708, as the right angles that they stand for.

        Raises
        ------
        DescriptionError
            No such robot, or a file that does not describe a robot.
        ModelError
            A URDF that is refused, or has no such chain, or several and no tip was given.
        """
        text = str(name)
        is_file = text.lower().endswith((".urdf", ".xacro"))
        if text.startswith("example:") or is_file or ".urdf#" in text.lower():
            return cls.from_urdf(name, base=base, tip=tip, as_designed=as_designed)
        if base is not None or tip is not None or as_designed:
            what = (
                "as_designed is for rounded angles"
                if as_designed
                else "base and tip cut a chain out"
            )
            raise DescriptionError(
                f"{name}: {what} of a URDF; expected a .urdf file or example:NAME"
            )
        if isinstance(name, str) and not name.endswith(".toml") and "/" not in name:
            return cls(describe.library_robot(name))
        return cls(describe.read_robot(name))

    @classmethod
    def from_urdf(
        cls,
        name: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        convention: Literal["standard", "modified"] = "standard",
        side: Side = "freeze",
        as_designed: bool = False,
        exact: bool = False,
        package_dirs: Sequence[str | Path] = (),
    ) -> Arm:
        """Return a chain of a URDF as an arm; see :func:`dhkit.model.extract_dh`, which also reports the steps.

        Examples
        --------
        >>> from dhkit.description import asset
        >>> arm = Arm.from_urdf(asset("urdf/puma560.urdf"))
        >>> arm.n, float(arm.description.numbers.a[1])
        (6, 0.4318)
        """
        from dhkit.model import extract_dh, urdf_source

        path, own_base, own_tip = (
            (name, None, None) if isinstance(name, Path) else urdf_source(name)
        )
        extraction = extract_dh(
            path,
            own_base if base is None else base,
            own_tip if tip is None else tip,
            convention=convention,
            side=side,
            as_designed=as_designed,
            exact=exact,
            package_dirs=package_dirs,
        )
        return cls(extraction.description)

    @classmethod
    def from_dh(
        cls,
        rows: Sequence[Sequence[Quantity]],
        *,
        order: Sequence[str] = ("theta", "d", "a", "alpha"),
        kinds: str | Sequence[str] | None = None,
        convention: str = "standard",
        angle: str = "rad",
        length: str = "m",
        name: str = "arm",
        parameters: Mapping[str, Quantity] | None = None,
        limits: Sequence[Sequence[Quantity] | None] | None = None,
        bodies: Sequence[Body | Mapping[str, object] | None] | None = None,
    ) -> Arm:
        """Return the arm of a Denavit-Hartenberg table; see :func:`dhkit.description.from_dh`."""
        return cls(
            describe.from_dh(
                rows,
                order=order,
                kinds=kinds,
                convention=convention,
                angle=angle,
                length=length,
                name=name,
                parameters=parameters,
                limits=limits,
                bodies=bodies,
            )
        )

    def with_tool(self, T: ArrayLike) -> Arm:
        """Return this arm with its tool at the pose T (4, 4), m, in DH frame n."""
        return Arm(describe.with_tool(self._description, T))

    def with_base(self, T: ArrayLike) -> Arm:
        """Return this arm with frame 0 at the pose T (4, 4), m, in the world."""
        return Arm(describe.with_base(self._description, T))

    def with_payload(
        self,
        mass: Quantity | Payload,
        com: Sequence[Quantity] = (0, 0, 0),
        inertia: ArrayLike | None = None,
    ) -> Arm:
        """Return this arm with a payload: mass, kg, and com (3,), m, in the tool's frame.

        See :func:`dhkit.description.with_payload`.
        """
        if isinstance(mass, describe.Payload):
            return Arm(mass.carried(self._description))
        return Arm(describe.with_payload(self._description, mass, com, inertia))

    def with_parameters(self, **values: Quantity) -> Arm:
        """Return this arm with other values of its parameters, SI and radians."""
        return Arm(describe.with_parameters(self._description, **values))

    def with_limits(
        self,
        *,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        torque: ArrayLike | None = None,
    ) -> Arm:
        """Return this arm with other limits, SI and radians; see :func:`dhkit.description.with_limits`."""
        return Arm(
            describe.with_limits(
                self._description, lower=lower, upper=upper, velocity=velocity, torque=torque
            )
        )

    def with_uniform_links(self, masses: Sequence[Quantity] | None = None) -> Arm:
        """Return this arm whose links are thin uniform rods; see :func:`dhkit.description.with_uniform_links`."""
        return Arm(describe.with_uniform_links(self._description, masses))

    def lock(self, joints: Mapping[int | str, Quantity]) -> Arm:
        """Return this arm with joints locked, by index from 0 or by name; see :func:`dhkit.description.lock`.

        Links keep the shapes that they are drawn with.
        """
        from dhkit.model.shapes import with_drawn_shapes

        return Arm(describe.lock(with_drawn_shapes(self._description), joints))

    # Properties

    @property
    def description(self) -> Description:
        """The robot as data."""
        return self._description

    @property
    def name(self) -> str:
        """The robot's name."""
        return self._description.name

    @property
    def n(self) -> int:
        """The number of joints."""
        return self._description.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints' names."""
        return tuple(joint.name for joint in self._description.joints)

    @cached_property
    def limits(self) -> Limits:
        """The joints' limits of position, velocity and torque; a description has none of acceleration and jerk."""
        from dhkit.trajectories import Limits

        return Limits.of(self._description)

    def save(self, path: str | Path) -> tuple[Path, ...]:
        """Write the arm's robot file (``.toml``), with its meshes beside it; return the files, the robot file first.

        Raises
        ------
        DescriptionError
            Another suffix than ``.toml``.
        ModelError
            A file cannot be read or written.
        """
        from dhkit.model import write_robot_with_meshes

        if Path(path).suffix.lower() != ".toml":
            raise DescriptionError(f"{path}: expected a robot file that ends in .toml")
        return write_robot_with_meshes(self._description, path)

    @cached_property
    def dh(self) -> DHTable:
        """The Denavit-Hartenberg table, which prints as a table."""
        return DHTable.of(self._description)

    @cached_property
    def configurations(self) -> Mapping[str, Array]:
        """Named joint vectors, shape (n,), rad and m, read-only."""
        return Named(self._description.numbers.configurations)

    def compile(self, progress: Callable[[int, int], None] | None = None) -> None:
        """Compile all kernels of this arm now, for control loops, servers and benchmarks.

        Otherwise a kernel is interpreted, and compiled after 65,536 items in large batches. Compiled kernels stay in
        the cache for later processes. With ``DHKIT_KERNELS=off`` all kernels are interpreted.

        Parameters
        ----------
        progress
            Called with the number of compiled kernels and of all kernels.
        """
        from dhkit.dynamics import dynamic_kernels
        from dhkit.kinematics import kinematic_kernels

        kernels = kinematic_kernels(self._description) + dynamic_kernels(self._description)
        for k, kernel in enumerate(kernels):
            kernel.compile()
            if progress is not None:
                progress(k + 1, len(kernels))

    # Kinematics

    def fk(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the tool's pose in the world, shape (..., 4, 4), m, for q (..., n), rad and m."""
        from dhkit.kinematics import forward_kinematics

        return forward_kinematics(self._description, q, out, threads)

    def frames(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return DH frames 0 ... n in the world, shape (..., n+1, 4, 4), m, for q (..., n), rad and m."""
        from dhkit.kinematics import frames

        return frames(self._description, q, out, threads)

    def jacobian(
        self,
        q: ArrayLike,
        frame: ReferenceAxes = "world",
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the tool's Jacobian, shape (..., 6, n), m and rad: linear velocity of the tool's origin, then angular.

        ``frame="world"`` gives both in the world's axes (Pinocchio's LOCAL_WORLD_ALIGNED, not its WORLD), ``"tool"`` in
        the tool's (Pinocchio's LOCAL).
        """
        from dhkit.kinematics import jacobian

        return jacobian(self._description, q, frame, out, threads)

    def jacobian_dot(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        frame: ReferenceAxes = "world",
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the Jacobian's time derivative at q, qd (..., n), shape (..., 6, n), m/s and rad/s."""
        from dhkit.kinematics import jacobian_dot

        return jacobian_dot(self._description, q, qd, frame, out, threads)

    def ik(
        self,
        T: ArrayLike,
        seed: ArrayLike | None = None,
        out: Array | None = None,
        threads: int = 1,
    ) -> IKSolutions:
        """Return all closed-form solutions of fk(q) = T for poses (..., 4, 4), m.

        See :func:`dhkit.kinematics.inverse_kinematics`; ``seed`` (n,) sets the joint that is free at a wrist
        singularity.
        """
        from dhkit.kinematics import inverse_kinematics

        return inverse_kinematics(self._description, T, seed, out, threads)

    def ik_chunks(
        self, T: ArrayLike, size: int = 16_384, seed: ArrayLike | None = None, threads: int = 1
    ) -> Iterator[tuple[slice, IKSolutions]]:
        """Yield slices of poses (N, 4, 4), m, and their solutions, which the next chunk overwrites.

        Several times faster than one call for a million poses; see
        :func:`dhkit.kinematics.inverse_kinematics_in_chunks`.
        """
        from dhkit.kinematics import inverse_kinematics_in_chunks

        return inverse_kinematics_in_chunks(self._description, T, size, seed, threads)

    def ik_numeric(
        self,
        T: ArrayLike,
        q0: ArrayLike | None = None,
        *,
        position_only: bool = False,
        restarts: int = 63,
        tolerance: float = 1e-12,
        seed: int = 0,
        limits: bool = True,
        threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> IKSolutions:
        """Return one solution per pose by iteration, for any arm; see :func:`dhkit.kinematics.solve_numerically`."""
        from dhkit.kinematics import solve_numerically

        return solve_numerically(
            self._description,
            T,
            q0,
            position_only=position_only,
            restarts=restarts,
            tolerance=tolerance,
            seed=seed,
            limits=limits,
            threads=threads,
            progress=progress,
        )

    def ik_path(self, T: ArrayLike, q0: ArrayLike, *, limits: bool = True) -> IKPath:
        """Follow one branch along poses (N, 4, 4) from near q0; see :func:`dhkit.kinematics.follow_path`."""
        from dhkit.kinematics import follow_path

        return follow_path(self._description, T, q0, limits=limits)

    @property
    def family(self) -> Classification:
        """Geometry of the axes and the family of closed-form inverse kinematics, if any; prints as text."""
        from dhkit.kinematics import classify

        return classify(self._description)

    def manipulability(self, q: ArrayLike, motion: Motion = "translational") -> Array:
        """Return the manipulability at q (..., n), shape (...); see :func:`dhkit.kinematics.manipulability`."""
        from dhkit.kinematics import manipulability

        return manipulability(self._description, q, motion)

    def workspace(
        self,
        samples: int = 100_000,
        seed: int = 0,
        *,
        edge: float | None = None,
        threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> Workspace:
        """Return the positions that the tool can reach, from random states; see :func:`dhkit.kinematics.workspace`."""
        from dhkit.kinematics import workspace

        return workspace(
            self._description, samples, seed, edge=edge, threads=threads, progress=progress
        )

    def singularities(self) -> Singularities:
        """Return the singularities of the arm in closed form; see :func:`dhkit.kinematics.singularities`."""
        from dhkit.kinematics import singularities

        return singularities(self._description)

    def export_c(self, folder: str | Path, name: str | None = None) -> tuple[Path, Path]:
        """Write the kinematics as C99 source and header; see :func:`dhkit.kinematics.export_kinematics`.

        Inverse kinematics to be read: :meth:`export_ik`.
        """
        from dhkit.kinematics import export_kinematics

        return export_kinematics(self._description, folder, name)

    def export_ik(self, folder: str | Path, language: str = "c") -> tuple[Path, ...]:
        """Write closed-form inverse kinematics in ``"c"``, ``"python"`` or ``"matlab"``, step by step as derived.

        The files need no library; see :meth:`dhkit.symbolic.InverseDerivation.export`.
        """
        return self.symbolic.ik.export(folder, language)

    # Dynamics

    def mass_matrix(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the mass matrix M with drives, shape (..., n, n), kg m^2, kg m and kg, for q (..., n), rad and m."""
        from dhkit.dynamics import mass_matrix

        return mass_matrix(self._description, q, out, threads)

    def coriolis_matrix(
        self, q: ArrayLike, qd: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return the Coriolis matrix C by Christoffel symbols, shape (..., n, n), so that C qd is in N m and N."""
        from dhkit.dynamics import coriolis_matrix

        return coriolis_matrix(self._description, q, qd, out, threads)

    def gravity_torque(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the torques g that hold the arm at rest, shape (..., n), N m and N."""
        from dhkit.dynamics import gravity_torque

        return gravity_torque(self._description, q, out, threads)

    def bias(
        self, q: ArrayLike, qd: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return C qd + g, shape (..., n), N m and N."""
        from dhkit.dynamics import bias

        return bias(self._description, q, qd, out, threads)

    def inverse_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        wrench: ArrayLike | None = None,
        friction: bool | Friction = False,
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the joint torques of a motion, shape (..., n), N m and N.

        See :func:`dhkit.dynamics.inverse_dynamics`; ``wrench`` (..., 6) acts on the tool from outside, N and N m.
        """
        from dhkit.dynamics import inverse_dynamics

        return inverse_dynamics(self._description, q, qd, qdd, wrench, friction, out, threads)

    def forward_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike,
        wrench: ArrayLike | None = None,
        friction: bool | Friction = False,
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the joint accelerations under torques, shape (..., n), rad/s^2 and m/s^2.

        See :func:`dhkit.dynamics.forward_dynamics`.
        """
        from dhkit.dynamics import forward_dynamics

        return forward_dynamics(self._description, q, qd, tau, wrench, friction, out, threads)

    def kinetic_energy(
        self, q: ArrayLike, qd: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return the kinetic energy with drives, shape (...), J."""
        from dhkit.dynamics import kinetic_energy

        return kinetic_energy(self._description, q, qd, out, threads)

    def potential_energy(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the potential energy, shape (...), J, 0 for a mass at the world's origin."""
        from dhkit.dynamics import potential_energy

        return potential_energy(self._description, q, out, threads)

    def power(self, qd: ArrayLike, tau: ArrayLike, out: Array | None = None) -> Array:
        """Return the mechanical power of the joints, qd . tau, shape (...), W."""
        from dhkit.dynamics import power

        return power(self._description, qd, tau, out)

    def friction_torque(
        self,
        qd: ArrayLike,
        friction: Friction | None = None,
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the friction torques, shape (..., n), N m and N; see :func:`dhkit.dynamics.friction_torque`."""
        from dhkit.dynamics import friction_torque

        return friction_torque(self._description, qd, friction, out, threads)

    @cached_property
    def casadi(self) -> CasadiFunctions:
        """The arm's mechanics as CasADi functions; see :class:`dhkit.symbolic.CasadiFunctions`."""
        from dhkit.symbolic import CasadiFunctions

        return CasadiFunctions(self._description)

    # Control

    def simulate(
        self,
        controller: Controller | None = None,
        reference: Reference | Trajectory | ArrayLike | None = None,
        duration: float | None = None,
        q0: ArrayLike | None = None,
        qd0: ArrayLike | None = None,
        *,
        options: SimulationOptions | None = None,
        **keywords: Unpack[SimulationKeywords],
    ) -> SimulationResult:
        """Simulate the arm under a controller; see :func:`dhkit.control.simulate`."""
        from dhkit.control import simulate

        return simulate(
            self._description, controller, reference, duration, q0, qd0, options=options, **keywords
        )

    def simulate_batch(
        self,
        controller: Controller | None = None,
        reference: Reference | Trajectory | ArrayLike | None = None,
        duration: float | None = None,
        q0: ArrayLike | None = None,
        qd0: ArrayLike | None = None,
        *,
        options: BatchOptions | None = None,
        **keywords: Unpack[BatchKeywords],
    ) -> BatchResult:
        """Simulate a batch of arms, with their states advanced together; see :func:`dhkit.control.simulate_batch`."""
        from dhkit.control import simulate_batch

        return simulate_batch(
            self._description, controller, reference, duration, q0, qd0, options=options, **keywords
        )

    def compare(
        self,
        reference: Reference | Trajectory,
        controllers: Sequence[str] | Mapping[str, str | Controller] | None = None,
        bandwidth: float = 20.0,
        damping: float = 1.0,
        *,
        duration: float | None = None,
        q0: ArrayLike | None = None,
        qd0: ArrayLike | None = None,
        options: SimulationOptions | None = None,
        **keywords: Unpack[SimulationKeywords],
    ) -> Comparison:
        """Return how controllers follow a motion, all of dhkit's or chosen ones; see :func:`dhkit.control.compare`.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> motion = arm.quintic([0.0, 0.5], [1.0, 1.0], duration=1.0)
        >>> print(arm.compare(motion, ("pid", "computed-torque"), plant=arm.with_payload(0.2)))  # doctest: +ELLIPSIS
        controller       largest error [rad] ...
        """
        from dhkit.control import compare

        return compare(
            self._description,
            reference,
            controllers,
            bandwidth,
            damping,
            duration=duration,
            q0=q0,
            qd0=qd0,
            options=options,
            **keywords,
        )

    def linearize(self, q: ArrayLike, qd: ArrayLike | None = None) -> tuple[Array, Array]:
        """Return A (2n, 2n) and B (2n, n), SI units, of the arm near a state; see :func:`dhkit.control.linearize`."""
        from dhkit.control import linearize

        return linearize(self._description, q, qd)

    # Motions

    def cubic(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        duration: float | None = None,
        qd0: ArrayLike | None = None,
        qd1: ArrayLike | None = None,
        limits: Limits | None = None,
        torques: Torques | None = None,
    ) -> Trajectory:
        """Return the cubic motion between two configurations; see :func:`dhkit.trajectories.cubic`."""
        from dhkit.trajectories import cubic

        return cubic(self._description, q0, q1, duration, qd0, qd1, limits, torques)

    def quintic(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        duration: float | None = None,
        qd0: ArrayLike | None = None,
        qd1: ArrayLike | None = None,
        qdd0: ArrayLike | None = None,
        qdd1: ArrayLike | None = None,
        limits: Limits | None = None,
        torques: Torques | None = None,
    ) -> Trajectory:
        """Return the quintic motion between two configurations; see :func:`dhkit.trajectories.quintic`."""
        from dhkit.trajectories import quintic

        return quintic(self._description, q0, q1, duration, qd0, qd1, qdd0, qdd1, limits, torques)

    def trapezoidal(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        duration: float | None = None,
        blend: float | None = None,
        limits: Limits | None = None,
        torques: Torques | None = None,
    ) -> Trajectory:
        """Return the motion of trapezoidal velocity; see :func:`dhkit.trajectories.trapezoidal`.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> arm.trapezoidal([0, 0], [0.6, 0.3], duration=2.0, blend=0.25).qd(1.0)
        array([0.4, 0.2])
        """
        from dhkit.trajectories import trapezoidal

        return trapezoidal(self._description, q0, q1, duration, blend, limits, torques)

    def spline(
        self,
        points: ArrayLike,
        times: ArrayLike | None = None,
        limits: Limits | None = None,
        torques: Torques | None = None,
    ) -> Trajectory:
        """Return the cubic spline through configurations (m, n); see :func:`dhkit.trajectories.spline`."""
        from dhkit.trajectories import spline

        return spline(self._description, points, times, limits, torques)

    def straight_line(
        self,
        T0: ArrayLike,
        T1: ArrayLike,
        q0: ArrayLike | None = None,
        duration: float | None = None,
        limits: Limits | None = None,
        torques: Torques | None = None,
    ) -> Trajectory:
        """Return the motion of the tool straight between two poses; see :func:`dhkit.trajectories.straight_line`."""
        from dhkit.trajectories import straight_line

        return straight_line(self._description, T0, T1, q0, duration, limits, torques)

    def circle(
        self,
        T0: ArrayLike,
        centre: ArrayLike,
        axis: ArrayLike,
        angle: float = 2 * math.pi,
        q0: ArrayLike | None = None,
        duration: float | None = None,
        limits: Limits | None = None,
        turning: bool = False,
        torques: Torques | None = None,
    ) -> Trajectory:
        """Return the motion of the tool along a circle or an arc; see :func:`dhkit.trajectories.circle`."""
        from dhkit.trajectories import circle

        return circle(
            self._description, T0, centre, axis, angle, q0, duration, limits, turning, torques
        )

    def planner(
        self,
        objective: ObjectiveLike = "time",
        limits: Limits | None = None,
        constraints: Constraint | Sequence[Constraint] = (),
        intervals: int | None = None,
        friction: bool | Friction = False,
    ) -> Planner:
        """Return a planner of optimal motions, to be used for many motions; see :class:`dhkit.planning.Planner`."""
        from dhkit.planning import Planner

        return Planner(self._description, objective, limits, constraints, intervals, friction)

    def plan(
        self,
        start: ArrayLike | str,
        goal: ArrayLike | str,
        objective: ObjectiveLike = "time",
        *,
        constraints: Constraint | Sequence[Constraint] = (),
        intervals: int | None = None,
        friction: bool | Friction = False,
        options: PlanOptions | None = None,
        **keywords: Unpack[PlanKeywords],
    ) -> Trajectory:
        """Return the best motion between two configurations, or to a pose of the tool; planners are cached.

        Arguments are those of :class:`dhkit.planning.Planner` and of its :meth:`~dhkit.planning.Planner.solve`.
        Unless options are given, the report compares the motion with classical ones.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> motion = arm.plan([0, 0], [1.0, 0.5], intervals=24)
        >>> motion.report.certificate.ok, motion.duration < arm.quintic([0, 0], [1.0, 0.5]).duration
        (True, True)
        """
        if options is None:
            keywords.setdefault("compare", True)
        planner = self._planner(objective, constraints, intervals, friction)
        return planner.solve(start, goal, options=options, **keywords)

    def _planner(
        self,
        objective: ObjectiveLike,
        constraints: Constraint | Sequence[Constraint],
        intervals: int | None,
        friction: bool | Friction,
    ) -> Planner:
        """Return the planner of an objective and constraints; each is made once."""
        from dhkit.planning import Objective
        from dhkit.planning.request import checked_constraints

        key = (Objective.of(objective), checked_constraints(constraints), intervals, friction)
        if key not in self._planners:
            self._planners.setdefault(key, self.planner(key[0], None, *key[1:]))
        return self._planners[key]

    @cached_property
    def _planners(self) -> dict[object, Planner]:
        return {}

    def plan_path(
        self,
        path: JointPath,
        objective: ObjectiveLike = "time",
        *,
        constraints: Constraint | Sequence[Constraint] = (),
        intervals: int = 200,
        friction: bool | Friction = False,
        options: PathOptions | None = None,
        **keywords: Unpack[PathKeywords],
    ) -> Trajectory:
        """Return the best timing of a given path; see :func:`dhkit.planning.along_path`."""
        from dhkit.planning import along_path

        return along_path(
            self._description,
            path,
            objective=objective,
            constraints=constraints,
            intervals=intervals,
            friction=friction,
            options=options,
            **keywords,
        )

    def certify(
        self,
        motion: Trajectory,
        limits: Limits | None = None,
        friction: bool | Friction | None = None,
        payload: Payload | None = None,
        *,
        obstacles: Scene = (),
        clearance: float = 0.01,
        self_collision: bool = False,
        independent: bool = False,
    ) -> Certificate:
        """Check a motion against limits, the arm's own unless given; see :func:`dhkit.planning.certify`."""
        from dhkit.planning import certify

        return certify(
            self._description,
            motion,
            limits,
            friction,
            payload,
            obstacles=obstacles,
            clearance=clearance,
            self_collision=self_collision,
            independent=independent,
        )

    def distance(
        self, q: ArrayLike, obstacles: Scene = (), self_collision: bool = False
    ) -> Distances:
        """Return the distances of the links from obstacles and from each other; see :func:`dhkit.planning.distance`."""
        from dhkit.planning import distance

        return distance(self._description, q, obstacles, self_collision)

    # Equations

    def grade(
        self,
        answers: Mapping[str, object] | None = None,
        *,
        names: Mapping[str, object] | None = None,
        task: Mapping[str, object] | None = None,
        rubric: Rubric | None = None,
        seed: int | None = None,
        explain: bool = True,
        **quantities: object,
    ) -> GradeReport:
        """Judge a student's M, C, h, g, tau, K, V, L, A1 ... An, T, J; see :func:`dhkit.grading.grade_answers`.

        Entries may be given one by one: ``M11=...``, ``g2=...``; with a rubric, verdicts become marks.

        Examples
        --------
        >>> report = Arm.load("planar2r").grade(g=["(m1/2 + m2)*g*l1*c1", "m2*g*l2*c2/2"])
        >>> report.verdict.value, report.diagnosis[0].mistake
        ('wrong', 'height_relative_angle')
        """
        from dhkit.grading import grade_answers

        given = {**(answers or {}), **quantities}
        return grade_answers(
            self._description, given, names, task, rubric, seed=seed, explain=explain
        )

    def derive(self, symbols: Symbols = "file") -> Lagrangian:
        """Return Lagrange's equations, exactly; see :func:`dhkit.symbolic.lagrangian`.

        ``symbols="none"`` has numbers, ``"file"`` the file's parameters, ``"inertial"`` a symbol for every inertial
        parameter.
        """
        from dhkit.symbolic import lagrangian

        return lagrangian(self._description, symbols)

    @cached_property
    def lagrangian(self) -> Lagrangian:
        """Lagrange's equations in the file's parameters: exact M, C, g, tau, K and V."""
        return self.derive()

    @cached_property
    def symbolic(self) -> SymbolicKinematics:
        """Symbolic kinematics: exact ``A(1)`` ... ``A(n)``, ``T`` and ``J`` as text, LaTeX, sympy and code."""
        from dhkit.symbolic import symbolic_kinematics

        return symbolic_kinematics(self._description)

    def base_parameters(self) -> BaseParameters:
        """Return the fewest parameters that determine the torques; see :func:`dhkit.symbolic.base_parameters`."""
        from dhkit.symbolic import base_parameters

        return base_parameters(self._description)

    # URDF, Pinocchio, verification

    def urdf(self) -> str:
        """Return the arm as URDF text, with meshes named ``meshes/...`` relative to it."""
        from dhkit.model import urdf_text

        return urdf_text(self._description)

    def write_urdf(self, path: str | Path, mesh_prefix: str | None = None) -> tuple[Path, ...]:
        """Write the URDF and its meshes beside it; see :func:`dhkit.model.write_urdf`."""
        from dhkit.model import write_urdf

        return write_urdf(self._description, path, mesh_prefix)

    @property
    def model(self) -> PinocchioModel:
        """The arm's Pinocchio model, with gravity, armature, friction and limits set; one object, built once.

        Changes of it stay in this object: equality, pickling, ``verify``, certificates of motions and everything else
        in dhkit use the description. :meth:`pinocchio_model` returns a new model.

        Raises
        ------
        ModelError
            Pinocchio is not installed.
        """
        return self._model

    @cached_property
    def _model(self) -> PinocchioModel:
        return self.pinocchio_model()

    def pinocchio_model(self) -> PinocchioModel:
        """Return a new Pinocchio model of the arm; see :func:`dhkit.model.pinocchio_model`."""
        from dhkit.model import pinocchio_model

        return pinocchio_model(self._description)

    def verify(self, samples: int = 1000, seed: int = 0) -> VerificationReport:
        """Compare dhkit's kinematics and dynamics with Pinocchio's at random states; ``.ok`` is true if they agree."""
        from dhkit.verification import verify

        return verify(self._description, samples, seed)

    # Viewer

    def view(self, *, frames: bool = False, port: int = 0, token: str | None = None) -> View:
        """Return a view of the arm for a browser; see :class:`dhkit.viewer.View`."""
        from dhkit.viewer import View

        return View(self._description, frames=frames, port=port, token=token)

    # Value semantics

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an Arm cannot be changed: {name!r}; with_... and lock make new ones")

    def __eq__(self, other: object) -> bool:
        return self._description == other._description if isinstance(other, Arm) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._description)

    def __getstate__(self) -> dict[str, Description]:
        """Return the description alone: derived values are computed again, and the Pinocchio model may have changed."""
        return {"_description": self._description}

    def __setstate__(self, state: dict[str, Description]) -> None:
        object.__setattr__(self, "_description", state["_description"])

    def __reduce__(self) -> tuple[type[Arm], tuple[Description]]:
        return Arm, (self._description,)

    def __repr__(self) -> str:
        described = f"{self._description.kinds}, {self._description.convention.value} DH"
        return repr_line(
            f"Arm {self.name}", summary=", ".join([described, *self._description.tool_texts])
        )

    def _repr_html_(self) -> str:
        return self._description._repr_html_()
