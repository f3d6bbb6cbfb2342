"""The class ``Arm``: a robot with all methods of dhkit, which delegate to the packages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, Unpack

from numpy.typing import ArrayLike

from dhkit import description as describe
from dhkit.cached_property import cached_property
from dhkit.description import Array, Description, DHTable, Named
from dhkit.display import repr_line
from dhkit.errors import DescriptionError

if TYPE_CHECKING:
    from dhkit.arm_calls import ArmCalls
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
    from dhkit.dynamics import ForwardDynamicsDerivatives, InverseDynamicsDerivatives
    from dhkit.grading import GradeReport, Rubric
    from dhkit.kinematics import (
        Classification,
        IKPath,
        IKSolutions,
        Motion,
        Preference,
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
    from dhkit.report import Report
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


_ONE_THREAD: Final = 1
"""The number of threads of a single call, by identity: 1.0 and True go the ordinary way, which refuses them."""


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

        Examples
        --------
        >>> arm = Arm.load("puma560")
        >>> arm.n, arm.name
        (6, 'puma560')
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
        """Return a chain of a URDF as an arm; :func:`dhkit.model.extract_dh` also reports the steps.

        Parameters
        ----------
        name
            Path of the URDF (``.urdf``, ``.xacro``), or ``example:NAME`` for a robot of the package example-robot-data;
            ``#TIP`` or ``#BASE..TIP`` after it names the ends of the chain.
        base, tip
            First and last link of the chain; the root, and the end of the only chain, unless given.
        convention
            Convention of the table.
        side
            Treatment of links that hang on moving joints beside the chain: ``"freeze"`` carries them along with those
            joints at zero, ``"drop"`` leaves them out.
        as_designed
            Whether rounded angles of the file, such as 1.5708, are read as the right angles that they stand for.
        exact
            Whether the file's axes are kept to the last digit; lengths of the table may then be large.
        package_dirs
            Folders with the packages that ``package://NAME/...`` names.

        Returns
        -------
        Arm
            The arm of the chain, with its bodies, limits and shapes.

        Raises
        ------
        ModelError
            The file is refused, or has no such chain, or several and no tip was given.

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
        """Return the arm of a Denavit-Hartenberg table.

        Parameters
        ----------
        rows
            One row a joint: four numbers, in the units given, or expressions as text, in metres and radians. In a row
            by names, ``{"theta": 0, "d": 0.3, "a": 0, "alpha": "pi/2"}``, zeros may be left out.
        order
            Names of the columns, in their order.
        kinds
            One letter a joint: R or P; all revolute unless given.
        convention
            ``"standard"``, or ``"modified"``: row i then holds alpha_(i-1) and a_(i-1).
        angle, length
            Units of bare numbers: rad or deg; m, mm, cm or in.
        name
            The robot's name.
        parameters
            Values of the names that occur in text, SI and radians.
        limits
            Lowest and highest value of each joint, in the units given, or None.
        bodies
            Body of each link, as for :func:`dhkit.description.from_dh`, or None.

        Raises
        ------
        DescriptionError
            Another number of columns, an unknown kind, unit or convention, or a value that is not a finite number.

        Examples
        --------
        >>> arm = Arm.from_dh([(0, 0.3, 0, "pi/2"), (0, 0, "l", 0)], parameters={"l": 0.5})
        >>> arm.fk([0, 0])[:3, 3]
        array([0.5, 0. , 0.3])
        """
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
        """Return this arm with another tool frame.

        Parameters
        ----------
        T
            Pose of the tool in DH frame n, shape (4, 4), m; it replaces the arm's own.

        Raises
        ------
        ValueError
            T is not a pose.

        Examples
        --------
        >>> import dhkit
        >>> arm = Arm.load("planar2r").with_tool(dhkit.pose((0.1, 0, 0)))
        >>> arm.fk([0, 0])[:3, 3]
        array([1., 0., 0.])
        """
        return Arm(describe.with_tool(self._description, T))

    def with_base(self, T: ArrayLike) -> Arm:
        """Return this arm with its base elsewhere.

        Parameters
        ----------
        T
            Pose of frame 0 in the world, shape (4, 4), m; it replaces the arm's own.

        Raises
        ------
        ValueError
            T is not a pose.

        Examples
        --------
        >>> import dhkit
        >>> arm = Arm.load("planar2r").with_base(dhkit.pose((0, 0, 0.5)))
        >>> arm.fk([0, 0])[:3, 3]
        array([0.9, 0. , 0.5])
        """
        return Arm(describe.with_base(self._description, T))

    def with_payload(
        self,
        mass: Quantity | Payload,
        com: Sequence[Quantity] = (0, 0, 0),
        inertia: ArrayLike | None = None,
    ) -> Arm:
        """Return this arm with a rigid load on its last link.

        Parameters
        ----------
        mass
            Mass, kg; text may use the arm's parameters. Or a :class:`dhkit.Payload`, which has all three values.
        com
            Centre of mass in the tool's frame, shape (3,), m.
        inertia
            Tensor about the load's centre of mass in the tool's axes, shape (3, 3), kg m^2; a point mass unless given.

        Raises
        ------
        DescriptionError
            The last link has no body, or the load is an impossible body.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> more = arm.with_payload(2.0).gravity_torque([0, 0]) - arm.gravity_torque([0, 0])
        >>> more.round(3)                                   # 2 kg * 9.81 m/s^2, 0.9 m and 0.4 m from the axes
        array([17.658,  7.848])
        """
        if isinstance(mass, describe.Payload):
            return Arm(mass.carried(self._description))
        return Arm(describe.with_payload(self._description, mass, com, inertia))

    def with_parameters(self, **values: Quantity) -> Arm:
        """Return this arm with other values of its parameters.

        Parameters
        ----------
        **values
            Values by name, SI and radians; text may name other parameters.

        Raises
        ------
        DescriptionError
            The arm has no such parameter, or the values make no robot.

        Examples
        --------
        >>> Arm.load("planar2r").with_parameters(l1=0.6).fk([0, 0])[:3, 3]
        array([1., 0., 0.])
        """
        return Arm(describe.with_parameters(self._description, **values))

    def with_limits(
        self,
        *,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        torque: ArrayLike | None = None,
    ) -> Arm:
        """Return this arm with other limits of its joints; those not given stay.

        Parameters
        ----------
        lower, upper
            Lowest and highest joint values, rad and m, one number for all joints or shape (n,). Infinite on both sides:
            the joint is unlimited.
        velocity
            Largest speeds, rad/s and m/s, one number or shape (n,); inf: unlimited.
        torque
            Largest torques and forces, N m and N, one number or shape (n,); inf: unlimited.

        Raises
        ------
        DescriptionError
            A lower limit above the upper one, one side infinite, NaN, or a speed or torque that is not positive.
        ValueError
            Another shape.

        Examples
        --------
        >>> arm = Arm.load("planar2r").with_limits(velocity=[1.0, 2.0])
        >>> arm.limits.velocity
        array([1., 2.])
        """
        return Arm(
            describe.with_limits(
                self._description, lower=lower, upper=upper, velocity=velocity, torque=torque
            )
        )

    def with_uniform_links(self, masses: Sequence[Quantity] | None = None) -> Arm:
        """Return this arm with each link a thin uniform rod, its mass a parameter ``m1`` ... ``mn``.

        Link i lies from frame i-1's origin to frame i's, in the modified convention from frame i's to frame i+1's; the
        last ends at the tool. See :func:`dhkit.description.with_uniform_links`.

        Parameters
        ----------
        masses
            One mass a link, kg; 1 kg each unless given.

        Raises
        ------
        DescriptionError
            Another number of masses, or ``m1`` ... is a parameter with a meaning of its own.

        Examples
        --------
        >>> arm = Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.4, 0)]).with_uniform_links([2.0, 1.0])
        >>> print(arm.lagrangian.text(("M",)).splitlines()[2])
        M22 = 4*m2/75
        """
        return Arm(describe.with_uniform_links(self._description, masses))

    def lock(self, joints: Mapping[int | str, Quantity]) -> Arm:
        """Return this arm with joints locked; their links are joined to the links before them.

        Masses, limits and drives of the remaining joints stay; links keep the shapes that they are drawn with. See
        :func:`dhkit.description.lock`.

        Parameters
        ----------
        joints
            Value at which each joint is locked, rad or m, by the joint's place from 0 or by its name.

        Raises
        ------
        DescriptionError
            No such joint, one named twice, or none left to move.

        Examples
        --------
        >>> arm = Arm.load("puma560").lock({0: 0.0, "elbow": -1.57})
        >>> arm.n, arm.joint_names
        (4, ('shoulder', 'wrist_roll', 'wrist_pitch', 'flange_roll'))
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
        """Write the arm's robot file, with its meshes beside it.

        Parameters
        ----------
        path
            The file, which ends in ``.toml``.

        Returns
        -------
        tuple[Path, ...]
            The files written, the robot file first.

        Raises
        ------
        DescriptionError
            Another suffix than ``.toml``.
        ModelError
            A file cannot be read or written.

        Examples
        --------
        >>> Arm.load("planar2r").save("mine.toml")[0].name
        'mine.toml'
        >>> Arm.load("./mine.toml") == Arm.load("planar2r")
        True
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

        Examples
        --------
        >>> Arm.load("planar2r").compile()
        """
        from dhkit.dynamics import dynamic_kernels
        from dhkit.kinematics import kinematic_kernels

        kernels = kinematic_kernels(self._description) + dynamic_kernels(self._description)
        count = len(kernels) + self._calls.count()
        for k, kernel in enumerate(kernels):
            kernel.compile()
            if progress is not None:
                progress(k + 1, count)
        for k, _ in enumerate(self._calls.compile(), start=len(kernels)):
            if progress is not None:
                progress(k + 1, count)

    # Kinematics

    def fk(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the pose of the tool in the world.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., 4, 4), m; NaN where q is not finite.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> arm.fk([0, np.pi / 2])[:3, 3].round(3)
        array([0.5, 0.4, 0. ])
        >>> arm.fk(np.zeros((1000, 2))).shape
        (1000, 4, 4)
        """
        if threads is _ONE_THREAD and (T := self._calls.fk(q, out)) is not None:
            return T
        from dhkit.kinematics import forward_kinematics

        return forward_kinematics(self._description, q, out, threads)

    def frames(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the poses of all DH frames in the world.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Frames 0 ... n, shape (..., n+1, 4, 4), m; frame 0 is the base.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> Arm.load("planar2r").frames([0, 0])[:, 0, 3]      # x of the origins
        array([0. , 0.5, 0.9])
        """
        if threads is _ONE_THREAD and (T := self._calls.frames(q, out)) is not None:
            return T
        from dhkit.kinematics import frames

        return frames(self._description, q, out, threads)

    def jacobian(
        self,
        q: ArrayLike,
        frame: ReferenceAxes = "world",
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the tool's geometric Jacobian.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        frame
            ``"world"``: both velocities in the world's axes (Pinocchio's LOCAL_WORLD_ALIGNED, not its WORLD).
            ``"tool"``: in the tool's axes (Pinocchio's LOCAL).
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., 6, n): rows 0 to 2 the velocity of the tool's origin, m, rows 3 to 5 the angular velocity, rad.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> J = Arm.load("planar2r").jacobian([0, 0])
        >>> J[[0, 1, 5]]                                      # x, y and the rotation about z
        array([[0. , 0. ],
               [0.9, 0.4],
               [1. , 1. ]])
        """
        if (
            threads is _ONE_THREAD
            and frame == "world"
            and (J := self._calls.jacobian(q, out)) is not None
        ):
            return J
        from dhkit.kinematics import jacobian

        return jacobian(self._description, q, frame, out, threads)

    def jacobian_derivative(
        self,
        q: ArrayLike,
        frame: ReferenceAxes = "world",
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the derivatives of the tool's Jacobian with respect to each joint value, dJ/dq_k.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        frame
            As for :meth:`jacobian`.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n, 6, n): entry [..., k, :, :] is dJ/dq_k, in the units of J per rad or m.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> q, qd = [0.3, 0.4], np.array([1.0, -1.0])
        >>> Jd = np.tensordot(qd, arm.jacobian_derivative(q), axes=1)
        >>> bool(np.allclose(Jd, arm.jacobian_dot(q, qd)))
        True
        """
        is_world = frame == "world"
        if (
            threads is _ONE_THREAD
            and is_world
            and (dJ := self._calls.jacobian_derivative(q, out)) is not None
        ):
            return dJ
        from dhkit.kinematics import jacobian_derivative

        return jacobian_derivative(self._description, q, frame, out, threads)

    def jacobian_dot(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        frame: ReferenceAxes = "world",
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the time derivative of the tool's Jacobian.

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (..., n), rad, m and per second; batch axes broadcast.
        frame
            As for :meth:`jacobian`.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., 6, n), m/s and rad/s.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> q, qd, qdd = [0.3, 0.4], [1.0, -1.0], [0.0, 0.5]
        >>> acceleration = arm.jacobian(q) @ qdd + arm.jacobian_dot(q, qd) @ qd
        >>> acceleration.shape
        (6,)
        """
        is_world = frame == "world"
        if (
            threads is _ONE_THREAD
            and is_world
            and (Jd := self._calls.jacobian_dot(q, qd, out)) is not None
        ):
            return Jd
        from dhkit.kinematics import jacobian_dot

        return jacobian_dot(self._description, q, qd, frame, out, threads)

    def ik(
        self,
        T: ArrayLike,
        seed: ArrayLike | None = None,
        out: Array | None = None,
        threads: int = 1,
        redundancy: ArrayLike | None = None,
        prefer: Preference | None = None,
    ) -> IKSolutions:
        """Return all solutions of fk(q) = T.

        See :func:`dhkit.kinematics.inverse_kinematics`.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (..., 4, 4), m.
        seed
            Joint values, shape (n,) or (..., n), rad and m, from which a joint takes its angle that is free at a
            singularity, 0 unless given, and an arm of seven joints its redundancy.
        out
            Array that receives the joint values, shape (..., B, n), float64, C-contiguous. Only for closed forms.
        threads
            Number of threads that share a large batch. Only for closed forms.
        redundancy
            For arms of seven joints, which have infinitely many solutions: the joint value 7, or the arm angle, of
            those that are returned, shape () or (...), rad; see :attr:`family`. Without it and without a seed, a value
            is chosen that allows a solution inside the limits.
        prefer
            What that value is chosen for: ``"limits"``, distance from the limits; ``"manipulability"``; or joint values
            (7,) to be near to. The best of 33 values is refined to a 64th of their steps.

        Returns
        -------
        IKSolutions
            ``q`` (..., B, n), ``valid`` (..., B), and a status for each pose. In closed form the branches are the same
            for every pose; of other arms of six joints B is the largest number of solutions in the batch. A pose that
            is out of reach is a status, not an exception.

        Raises
        ------
        ModelError
            The arm has no closed form, and prismatic joints or not six or seven.
        ValueError, TypeError
            T has not shape (..., 4, 4); ``seed``, ``out``, ``redundancy`` or ``prefer`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("puma560")
        >>> T = arm.fk("nominal")
        >>> solutions = arm.ik(T)
        >>> solutions.q.shape, int(solutions.valid.sum())
        ((8, 6), 8)
        >>> bool(np.allclose(arm.fk(solutions.q), T))
        True
        """
        if (
            seed is None
            and redundancy is None
            and prefer is None
            and threads is _ONE_THREAD
            and (found := self._calls.ik(T, out)) is not None
        ):
            return found
        is_at_redundancy = redundancy is not None and seed is None and out is None
        if is_at_redundancy and prefer is None and threads is _ONE_THREAD:
            found = self._calls.ik_at_redundancy(T, redundancy)
            if found is not None:
                return found
        from dhkit.kinematics import inverse_kinematics

        return inverse_kinematics(self._description, T, seed, out, threads, redundancy, prefer)

    def nearest_pose(self, T: ArrayLike) -> Array:
        """Return the nearest pose that an arm of five joints reaches: the same position, turned by the least angle.

        Joint limits are not regarded. :meth:`ik` solves the result.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (..., 4, 4), m.

        Returns
        -------
        Array
            Shape (..., 4, 4), m; NaN where the position is out of reach, or T is no pose.

        Raises
        ------
        ModelError
            The arm is not a turntable with three parallel axes and a last one across them.
        ValueError, TypeError
            T has not shape (..., 4, 4), or is not numeric.

        Examples
        --------
        >>> rows = [[0, 349, 16, -90], [0, 0, 221, 0], [0, 0, 221, 0], [90, 0, 0, 90], [0, 145, 0, 0]]
        >>> scorbot = Arm.from_dh(rows, length="mm", angle="deg")
        >>> T = [[0, 0, 1, 0.3], [0, 1, 0, 0.2], [-1, 0, 0, 0.4], [0, 0, 0, 1]]
        >>> scorbot.ik(T).status.item()
        'out_of_reach'
        >>> scorbot.ik(scorbot.nearest_pose(T)).status.item()
        'ok'
        """
        from dhkit.kinematics import nearest_pose

        return nearest_pose(self._description, T)

    def redundancy(self, q: ArrayLike) -> Array:
        """Return the redundancy of joint values of an arm of seven joints.

        Parameters
        ----------
        q
            Joint values, shape (..., 7), rad, or the name of a configuration.

        Returns
        -------
        Array
            Joint value 7, or the arm angle in (-pi, pi], shape (...), rad: what :meth:`ik` takes as ``redundancy``.

        Raises
        ------
        ModelError
            The arm has prismatic joints, or not seven joints.

        Examples
        --------
        >>> arm = Arm.load("panda")
        >>> float(arm.redundancy("ready"))
        0.7853981633974483
        """
        from dhkit.kinematics import redundancy_of

        return redundancy_of(self._description, q)

    def redundancy_intervals(
        self, T: ArrayLike, *, limits: bool = True
    ) -> list[tuple[float, float]]:
        """Return the intervals of the redundancy in which an arm of seven joints reaches a pose.

        See :func:`dhkit.kinematics.redundancy_intervals`.

        Parameters
        ----------
        T
            Pose of the tool in the world, shape (4, 4), m.
        limits
            Whether all joints must be inside their limits.

        Returns
        -------
        list[tuple[float, float]]
            Beginning and end of each interval, rad, in ascending order; of an arm angle in [-pi, pi], where one that
            goes through pi is in two parts.

        Raises
        ------
        ModelError
            The arm has prismatic joints, or not seven joints.
        ValueError, TypeError
            T has not shape (4, 4).

        Examples
        --------
        >>> arm = Arm.load("panda")
        >>> [(round(begin, 2), round(end, 2)) for begin, end in arm.redundancy_intervals(arm.fk("ready"))]
        [(-0.16, 1.73)]
        """
        from dhkit.kinematics import redundancy_intervals

        return redundancy_intervals(self._description, T, limits=limits)

    def ik_chunks(
        self,
        T: ArrayLike,
        size: int = 16_384,
        seed: ArrayLike | None = None,
        threads: int = 1,
        redundancy: ArrayLike | None = None,
    ) -> Iterator[tuple[slice, IKSolutions]]:
        """Yield slices of many poses, and their solutions, in memory that is used again.

        Several times faster than one call for a million poses: new memory costs more time than the solutions.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (N, 4, 4), m.
        size
            Number of poses in a chunk.
        seed, threads, redundancy
            As for :meth:`ik`, whose closed form the arm must have.

        Returns
        -------
        Iterator[tuple[slice, IKSolutions]]
            Slice of the poses, and their solutions. The next chunk overwrites the joint values: copy what you keep.

        Raises
        ------
        ModelError, ValueError, TypeError
            As for :meth:`ik`; ``size`` is below 1.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> poses = arm.fk(np.random.default_rng(0).uniform(-1, 1, (1000, 2)))
        >>> sum(int(found.valid.sum()) for _, found in arm.ik_chunks(poses, size=256))
        2000
        """
        from dhkit.kinematics import inverse_kinematics_in_chunks

        return inverse_kinematics_in_chunks(self._description, T, size, seed, threads, redundancy)

    def ik_numeric(
        self,
        T: ArrayLike,
        q0: ArrayLike | None = None,
        *,
        position_only: bool = False,
        restarts: int = 511,
        tolerance: float = 1e-12,
        seed: int = 0,
        limits: bool = True,
        prefer: Preference | None = None,
        threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> IKSolutions:
        """Return one solution of fk(q) = T for each pose by iteration, for any arm.

        See :func:`dhkit.kinematics.solve_numerically` for the method.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (..., 4, 4), m.
        q0
            Start, shape (n,) or (..., n), rad and m; the middle of the limits unless given.
        position_only
            Whether only the tool's position is to be reached.
        restarts
            Largest number of further starts for a pose.
        tolerance
            Largest error: position as a share of the reach, rotation in rad.
        seed
            Seed of the random starts.
        limits
            Whether joints stay inside their limits.
        prefer
            What the solution of a redundant arm is moved for along its self-motion: ``"limits"``, far from the limits;
            ``"manipulability"``; or joint positions (n,), rad and m, or their name, to come near to.
        threads
            Number of threads that share a large batch.
        progress
            Called with the number of finished poses and of all; an exception in it ends the work.

        Returns
        -------
        IKSolutions
            One branch; the status of a pose says whether it was found.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape or type; ``prefer`` for an arm that is not redundant.

        Examples
        --------
        >>> arm = Arm.load("panda")
        >>> found = arm.ik_numeric(arm.fk("ready"))
        >>> str(found.status), found.q.shape
        ('ok', (1, 7))
        >>> found = arm.ik_numeric(arm.fk("ready"), prefer="limits")
        >>> bool(abs(arm.fk(found.q[0]) - arm.fk("ready")).max() < 1e-9)
        True
        """
        is_usual = position_only is False and limits is True
        is_usual = is_usual and prefer is None and progress is None
        is_usual = is_usual and type(restarts) is int and restarts == 511
        if is_usual and threads is _ONE_THREAD and type(tolerance) is float and type(seed) is int:
            found = self._calls.ik_numeric(T, q0, tolerance, seed)
            if found is not None:
                return found
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
            prefer=prefer,
            threads=threads,
            progress=progress,
        )

    def ik_path(
        self,
        T: ArrayLike,
        q0: ArrayLike,
        *,
        limits: bool = True,
        redundancy: ArrayLike | None = None,
    ) -> IKPath:
        """Follow one branch of the inverse kinematics along a path of poses.

        An arm of seven joints keeps the redundancy of ``q0`` unless that leads nowhere; see
        :func:`dhkit.kinematics.follow_path`.

        Parameters
        ----------
        T
            Poses of the tool in the world, shape (N, 4, 4), m, near enough to each other for joints to move less than
            45 degrees (or an eighth of the reach) between them.
        q0
            Joint values near which the path starts, shape (n,), rad and m.
        limits
            Whether solutions outside the joint limits are left out.
        redundancy
            For an arm of seven joints the redundancy at the poses, shape () or (N,), rad, instead of that of ``q0``.

        Returns
        -------
        IKPath
            Joint values (N, n), and the poses where the branch was switched, lost, or near a singularity.

        Raises
        ------
        ValueError
            T has not shape (N, 4, 4), or q0 not (n,) or not finite; ``redundancy`` does not fit.
        ModelError
            The arm has no closed form and fewer than six joints.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("puma560")
        >>> line = np.repeat(arm.fk("nominal")[None], 50, axis=0)
        >>> line[:, 1, 3] += np.linspace(0, 0.2, 50)
        >>> arm.ik_path(line, q0="nominal")
        <IKPath of 50 poses: 0 switches, 0 lost, 0 near a singularity>
        """
        from dhkit.kinematics import follow_path

        return follow_path(self._description, T, q0, limits=limits, redundancy=redundancy)

    @property
    def family(self) -> Classification:
        """Geometry of the axes and the family of closed-form inverse kinematics, if any; prints as text."""
        from dhkit.kinematics import classify

        return classify(self._description)

    def manipulability(self, q: ArrayLike, motion: Motion = "translational") -> Array:
        """Return Yoshikawa's manipulability, sqrt(det(J J^T)).

        For an arm that can never move its tool in all directions, it is the product of the largest singular values. See
        :func:`dhkit.kinematics.manipulability`.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        motion
            Rows of the Jacobian that are used: ``"translational"``, ``"rotational"`` or ``"whole"``. ``"whole"`` mixes
            m and rad: its values depend on the unit of length.

        Returns
        -------
        Array
            Shape (...); 0 at a singularity, NaN where q is not finite.

        Raises
        ------
        ValueError, TypeError
            q has not shape (..., n); another motion.

        Examples
        --------
        >>> import numpy as np
        >>> float(Arm.load("planar2r").manipulability([0.2, np.pi / 2]).round(6))   # l1 l2 abs(sin q2)
        0.2
        """
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
        """Return the positions that the tool reaches, from random states, with the manipulability there.

        Parameters
        ----------
        samples
            Number of random states, uniform inside the joint limits.
        seed
            Seed of the random states.
        edge
            Edge of the grid's cells, m; chosen by the number of samples unless given.
        threads
            Number of threads that share the kinematics.
        progress
            Called with the number of finished samples and of all; an exception in it ends the work.

        Returns
        -------
        Workspace
            Positions, m, of the first 4,194,304 samples at most, counts and extents of all, and estimates of area or
            volume; it is sampled, not proved.

        Raises
        ------
        ValueError
            ``samples`` is below 1, or ``edge`` is not positive or makes too many cells.

        Examples
        --------
        >>> space = Arm.load("planar2r").workspace(samples=5000)
        >>> [round(float(r), 1) for r in space.radii]          # least and largest distance from axis 1, m
        [0.2, 0.9]
        """
        from dhkit.kinematics import workspace

        return workspace(
            self._description, samples, seed, edge=edge, threads=threads, progress=progress
        )

    def singularities(self) -> Singularities:
        """Return the singularities of the arm in closed form.

        Returns
        -------
        Singularities
            Conditions on the joint values, which print as text.

        Raises
        ------
        ModelError
            No closed form of this arm's singularities is known.

        Examples
        --------
        >>> print(Arm.load("planar2r").singularities())
        elbow: q2 = 0° (stretched) or 180° (folded)
        """
        from dhkit.kinematics import singularities

        return singularities(self._description)

    def export_c(self, folder: str | Path, name: str | None = None) -> tuple[Path, Path]:
        """Write forward kinematics, Jacobian and closed-form inverse kinematics as C99 source and header.

        See :func:`dhkit.kinematics.export_kinematics`. Inverse kinematics to be read: :meth:`export_ik`.

        Parameters
        ----------
        folder
            An existing folder.
        name
            Name of the files and beginning of the functions' names, an identifier of C; the robot's unless given.

        Returns
        -------
        tuple[Path, Path]
            Source and header: self-contained C99; link with ``-lm``.

        Raises
        ------
        ValueError
            ``name`` is not an identifier of C.
        OSError
            The folder cannot be written to.

        Examples
        --------
        >>> [path.name for path in Arm.load("planar2r").export_c(".")]
        ['planar2r.c', 'planar2r.h']
        """
        from dhkit.kinematics import export_kinematics

        return export_kinematics(self._description, folder, name)

    def export_ik(self, folder: str | Path, language: str = "c") -> tuple[Path, ...]:
        """Write closed-form inverse kinematics as code, step by step as derived.

        See :meth:`dhkit.symbolic.InverseDerivation.export`.

        Parameters
        ----------
        folder
            An existing folder.
        language
            ``"c"``, ``"python"`` or ``"matlab"``.

        Returns
        -------
        tuple[Path, ...]
            The files written; they need no library.

        Raises
        ------
        DescriptionError
            The arm has no closed form.
        ValueError
            Another language.

        Examples
        --------
        >>> [path.name for path in Arm.load("planar2r").export_ik(".", "python")]
        ['planar2r_ik.py']
        """
        return self.symbolic.ik.export(folder, language)

    # Dynamics

    def mass_matrix_derivative(
        self, q: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return the derivatives of the mass matrix with respect to each joint value, dM/dq_k.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n, n, n): entry [..., k, :, :] is dM/dq_k, in the units of M per rad or m.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> q, qd = [0.3, 0.4], np.array([1.0, -1.0])
        >>> M_dot = np.tensordot(qd, arm.mass_matrix_derivative(q), axes=1)
        >>> C = arm.coriolis_matrix(q, qd)
        >>> bool(np.allclose(M_dot, C + C.T))
        True
        """
        if (
            threads is _ONE_THREAD
            and (dM := self._calls.mass_matrix_derivative(q, out)) is not None
        ):
            return dM
        from dhkit.dynamics import mass_matrix_derivative

        return mass_matrix_derivative(self._description, q, out, threads)

    def mass_matrix(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the mass matrix M, with the drives' reflected inertia.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n, n), symmetric, kg m^2, kg m and kg; NaN where q is not finite.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> Arm.load("planar2r").mass_matrix([0, 0]).round(4)
        array([[0.9217, 0.23  ],
               [0.23  , 0.08  ]])
        """
        if threads is _ONE_THREAD and (M := self._calls.mass_matrix(q, out)) is not None:
            return M
        from dhkit.dynamics import mass_matrix

        return mass_matrix(self._description, q, out, threads)

    def coriolis_matrix(
        self, q: ArrayLike, qd: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return the Coriolis matrix C by Christoffel symbols, so that C qd are torques.

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (..., n), rad, m and per second; batch axes broadcast.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n, n); C qd is in N m and N. The factorization is that of Pinocchio's computeCoriolisMatrix.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> Arm.load("planar2r").coriolis_matrix([0, 1.0], [1.0, 0.5]).round(4)
        array([[-0.0631, -0.1893],
               [ 0.1262,  0.    ]])
        """
        if threads is _ONE_THREAD and (C := self._calls.coriolis_matrix(q, qd, out)) is not None:
            return C
        from dhkit.dynamics import coriolis_matrix

        return coriolis_matrix(self._description, q, qd, out, threads)

    def gravity_torque(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the torques g that hold the arm at rest.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n), N m and N.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> Arm.load("planar2r").gravity_torque([0, 0]).round(3)
        array([15.206,  2.943])
        """
        if threads is _ONE_THREAD and (g := self._calls.gravity_torque(q, out)) is not None:
            return g
        from dhkit.dynamics import gravity_torque

        return gravity_torque(self._description, q, out, threads)

    def bias(
        self, q: ArrayLike, qd: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return the torques C qd + g of a motion without acceleration.

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (..., n), rad, m and per second; batch axes broadcast.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n), N m and N.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> q, qd = [0.2, 0.4], [1.0, 0.5]
        >>> h = arm.coriolis_matrix(q, qd) @ qd
        >>> bool(np.allclose(arm.bias(q, qd), h + arm.gravity_torque(q)))
        True
        """
        if threads is _ONE_THREAD and (h := self._calls.bias(q, qd, out)) is not None:
            return h
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
        """Return the joint torques of a motion, tau = M qdd + C qd + g + friction - J^T wrench.

        Parameters
        ----------
        q, qd, qdd
            Joint values, rates and accelerations, shape (..., n), rad, m and seconds; batch axes broadcast.
        wrench
            Shape (..., 6): force, N, then moment, N m, that the environment applies at the tool's origin, in the
            world's axes.
        friction
            True for dry friction as a step, 0 at rest; ``Friction(width=...)`` for a smooth one.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n), N m and N; NaN where an input is not finite.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> q, qd, qdd = [0.3, -0.5], [1.0, 0.2], [0.5, -1.0]
        >>> tau = arm.inverse_dynamics(q, qd, qdd)
        >>> bool(np.allclose(tau, arm.mass_matrix(q) @ qdd + arm.bias(q, qd)))
        True
        """
        is_free = wrench is None and friction is False
        if (
            threads is _ONE_THREAD
            and is_free
            and (torque := self._calls.inverse_dynamics(q, qd, qdd, out)) is not None
        ):
            return torque
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
        """Return the joint accelerations under torques: M qdd = tau - C qd - g - friction + J^T wrench.

        Parameters
        ----------
        q, qd, tau
            Joint values, rates and torques, shape (..., n), rad, m, seconds, N m and N; batch axes broadcast.
        wrench
            Shape (..., 6): force, N, then moment, N m, that the environment applies at the tool's origin, in the
            world's axes.
        friction
            True for dry friction as a step, 0 at rest; ``Friction(width=...)`` for a smooth one.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n), rad/s^2 and m/s^2; NaN where an input is not finite, or M is singular at this state.

        Raises
        ------
        DescriptionError
            A link without a body; joints that carry no inertia at any state.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> arm = Arm.load("planar2r")
        >>> tau = arm.inverse_dynamics([0.3, -0.5], [1.0, 0.2], [0.5, -1.0])
        >>> bool(np.allclose(arm.forward_dynamics([0.3, -0.5], [1.0, 0.2], tau), [0.5, -1.0]))
        True
        """
        is_free = wrench is None and friction is False
        if (
            threads is _ONE_THREAD
            and is_free
            and (qdd := self._calls.forward_dynamics(q, qd, tau, out)) is not None
        ):
            return qdd
        from dhkit.dynamics import forward_dynamics

        return forward_dynamics(self._description, q, qd, tau, wrench, friction, out, threads)

    def kinetic_energy(
        self, q: ArrayLike, qd: ArrayLike, out: Array | None = None, threads: int = 1
    ) -> Array:
        """Return the kinetic energy of links and drives, qd^T M qd / 2.

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (..., n), rad, m and per second; batch axes broadcast.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (...), J.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> float(Arm.load("planar2r").kinetic_energy([0, 0], [1.0, 0.0]).round(4))
        0.4608
        """
        from dhkit.dynamics import kinetic_energy

        return kinetic_energy(self._description, q, qd, out, threads)

    def potential_energy(self, q: ArrayLike, out: Array | None = None, threads: int = 1) -> Array:
        """Return the potential energy in gravity, 0 for a mass at the world's origin.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (...), J.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> float(Arm.load("planar2r").potential_energy([np.pi / 2, 0]).round(3))   # both links upright
        15.206
        """
        from dhkit.dynamics import potential_energy

        return potential_energy(self._description, q, out, threads)

    def power(self, qd: ArrayLike, tau: ArrayLike, out: Array | None = None) -> Array:
        """Return the mechanical power of the joints, qd . tau.

        Parameters
        ----------
        qd, tau
            Joint rates and torques, shape (..., n), rad/s, m/s, N m and N; batch axes broadcast.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.

        Returns
        -------
        Array
            Shape (...), W.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> float(Arm.load("planar2r").power([1.0, 2.0], [3.0, 0.5]))
        4.0
        """
        from dhkit.dynamics import power

        return power(self._description, qd, tau, out)

    def friction_torque(
        self,
        qd: ArrayLike,
        friction: Friction | None = None,
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the friction torques: viscous, and dry friction that differs by direction.

        Parameters
        ----------
        qd
            Joint rates, shape (..., n), rad/s and m/s.
        friction
            Model of dry friction near rest; a step, 0 at rest, unless given.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n), joint side, N m and N, with the sign of the motion: the torque that a motor must add.

        Raises
        ------
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> import numpy as np
        >>> Arm.load("puma560").friction_torque(np.full(6, 0.5)).round(2)
        array([27.63, 18.33,  9.08,  1.06,  0.88,  0.41])
        """
        from dhkit.dynamics import friction_torque

        return friction_torque(self._description, qd, friction, out, threads)

    def regressor(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        base: bool = False,
        out: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """Return the matrix Y(q, qd, qdd) of inverse dynamics, which is linear in the inertial parameters.

        tau = Y theta + B qdd, where theta is :func:`dhkit.dynamics.inertial_parameters` and B is
        ``description.numbers.drive_inertia``; B is 0 for an arm without drives. Base parameters contain the drives'
        inertia: with ``base=True``, tau = Y beta with beta = ``base_parameters().values()``.

        Parameters
        ----------
        q, qd, qdd
            Joint values, rates and accelerations, shape (..., n), rad, m and seconds; batch axes broadcast.
        base
            Whether the columns are those of the base parameters, in the order of ``base_parameters().names``.
        out
            Array that receives the result, float64, C-contiguous, of the shape below; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        Array
            Shape (..., n, 10 n), columns link by link: mass, first moments x, y, z and second moments xx, yy, zz, xy,
            yz, xz of the link about the origin of its DH frame. With ``base=True`` shape (..., n, parameters). NaN
            where a state is not finite.

        Raises
        ------
        DescriptionError
            ``base=True`` and a link without a body.
        RingError
            ``base=True`` and the symbolic equations of motion are too long.
        ValueError, TypeError
            An argument of another shape, or not numeric.

        Examples
        --------
        >>> import numpy as np
        >>> from dhkit.dynamics import inertial_parameters
        >>> arm = Arm.load("planar2r")
        >>> motion = [0.3, -0.5], [1.0, 0.2], [0.5, -1.0]
        >>> Y = arm.regressor(*motion)
        >>> Y.shape
        (2, 20)
        >>> bool(np.allclose(Y @ inertial_parameters(arm), arm.inverse_dynamics(*motion)))
        True
        >>> arm.regressor(*motion, base=True).shape
        (2, 6)
        """
        if not isinstance(base, bool):
            raise TypeError(f"base is {type(base).__name__}; expected True or False")
        call = self._calls.base_regressor if base else self._calls.regressor
        if threads is _ONE_THREAD and (Y := call(q, qd, qdd, out)) is not None:
            return Y
        from dhkit.dynamics import base_regressor, regressor

        of_arm = base_regressor if base else regressor
        return of_arm(self._description, q, qd, qdd, out, threads)

    def inverse_dynamics_derivatives(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        out: Array | None = None,
        threads: int = 1,
    ) -> InverseDynamicsDerivatives:
        """Return the derivatives of the torques tau = M qdd + C qd + g, without friction, by q, qd and qdd.

        Parameters
        ----------
        q, qd, qdd
            Joint values, rates and accelerations, shape (..., n), rad, m and seconds; batch axes broadcast.
        out
            Array that receives all three, shape (..., 3, n, n), float64, C-contiguous; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        InverseDynamicsDerivatives
            ``dtau_dq``, ``dtau_dqd`` and ``dtau_dqdd`` = M, shape (..., n, n) each, signs and meaning as in Pinocchio;
            views of one array (..., 3, n, n). NaN where an input is not finite.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> found = Arm.load("planar2r").inverse_dynamics_derivatives([0, 0], [0, 0], [0, 0])
        >>> found.dtau_dqdd.round(4)
        array([[0.9217, 0.23  ],
               [0.23  , 0.08  ]])
        """
        if threads is _ONE_THREAD:
            found = self._calls.inverse_dynamics_derivatives(q, qd, qdd, out)
            if found is not None:
                return found
        from dhkit.dynamics import inverse_dynamics_derivatives

        return inverse_dynamics_derivatives(self._description, q, qd, qdd, out, threads)

    def forward_dynamics_derivatives(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike,
        out: Array | None = None,
        threads: int = 1,
    ) -> ForwardDynamicsDerivatives:
        """Return the derivatives of the accelerations qdd = M^-1 (tau - C qd - g), without friction, by q, qd and tau.

        Parameters
        ----------
        q, qd, tau
            Joint values, rates and torques, shape (..., n), rad, m, seconds, N m and N; batch axes broadcast.
        out
            Array that receives all three, shape (..., 3, n, n), float64, C-contiguous; a new array unless given.
        threads
            Number of threads that share a large batch.

        Returns
        -------
        ForwardDynamicsDerivatives
            ``dqdd_dq``, ``dqdd_dqd`` and ``dqdd_dtau`` = M^-1, shape (..., n, n) each, signs and meaning as in
            Pinocchio; views of one array (..., 3, n, n). NaN where an input is not finite or M is singular.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError, TypeError
            An argument of another shape, or not numeric; ``out`` does not fit.

        Examples
        --------
        >>> found = Arm.load("planar2r").forward_dynamics_derivatives([0, 0], [0, 0], [0, 0])
        >>> found.dqdd_dtau.round(3)
        array([[  3.84, -11.04],
               [-11.04,  44.24]])
        """
        if threads is _ONE_THREAD:
            found = self._calls.forward_dynamics_derivatives(q, qd, tau, out)
            if found is not None:
                return found
        from dhkit.dynamics import forward_dynamics_derivatives

        return forward_dynamics_derivatives(self._description, q, qd, tau, out, threads)

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
        """Simulate the arm under a controller, sampled at a rate or continuous.

        See :func:`dhkit.control.simulate` for the integration.

        Parameters
        ----------
        controller
            Called as ``controller(t, q, qd, setpoint)``, returns torques (n,), N m and N; no torques unless given. See
            :class:`dhkit.control.Controller`.
        reference
            The reference to follow: a motion, joint values (n,) or a pose of the tool (4, 4) to hold; ``q0`` unless
            given.
        duration
            Simulated time, s; that of the reference unless given.
        q0, qd0
            Joint values and rates at the start, shape (n,), rad, m and per second; the reference's first joint values
            and zero rates unless given.
        options, **keywords
            Fields of :class:`dhkit.SimulationOptions`, as one value or one by one: ``plant``, ``friction``,
            ``restitution``, ``pushes``, ``rate``, ``plant_rate``, ``sensors``, ``saturation``, ``tolerance``,
            ``progress``.

        Returns
        -------
        SimulationResult
            The run: times, states, torques, errors, and an audit of the energy.

        Raises
        ------
        SimulationError
            The controller raises or returns something else than a finite array (n,), or the state is no longer finite;
            ``result`` of the error holds the rows until then.

        Examples
        --------
        >>> import dhkit
        >>> arm = Arm.load("planar2r")
        >>> motion = arm.quintic([0, 0], [1.0, 0.5], duration=1.0)
        >>> run = arm.simulate(dhkit.ComputedTorque.tuned(arm), motion)
        >>> bool(run.peak_error.max() < 1e-3)                 # rad
        True
        """
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
        """Simulate a batch of arms under one controller, with their states advanced together.

        There are no joint stops, no pushes and no stiction; dry friction has to be smooth. See
        :func:`dhkit.control.simulate_batch`.

        Parameters
        ----------
        controller
            Called for all arms at once, with joint values and rates (B, n); returns torques (B, n). No torques unless
            given.
        reference
            A motion, or joint values (n,) or (B, n) to hold; ``q0`` unless given.
        duration
            Simulated time, s; that of the reference unless given.
        q0, qd0
            Joint values and rates at the start, shape (n,) or (B, n), rad, m and per second.
        options, **keywords
            Fields of :class:`dhkit.BatchOptions`, as one value or one by one: ``plant``, ``friction``, ``rate``,
            ``plant_rate``, ``keep``, ``sensors``, ``saturation``, ``threads``, ``progress``.

        Returns
        -------
        BatchResult
            The runs.

        Raises
        ------
        SimulationError
            The controller raises or returns another shape.

        Examples
        --------
        >>> import dhkit, numpy as np
        >>> arm = Arm.load("planar2r")
        >>> starts = np.random.default_rng(0).uniform(-0.1, 0.1, (100, 2))
        >>> runs = arm.simulate_batch(dhkit.PDGravity.tuned(arm), [0.0, 0.0], 2.0, q0=starts)
        >>> bool(abs(runs.q[-1]).max() < 1e-3)
        True
        """
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
        """Return how several controllers follow one motion, each starting on it.

        Parameters
        ----------
        reference
            The motion.
        controllers
            Names from ``dhkit.control.CONTROLLERS``, tuned alike, all of them unless given; or a mapping of names of
            your own to controllers or such names.
        bandwidth
            Bandwidth of the controllers given by name, rad/s.
        damping
            Their damping ratio.
        duration, q0, qd0, options, **keywords
            As for :meth:`simulate`.

        Returns
        -------
        Comparison
            A table of errors and torques; prints as text.

        Raises
        ------
        ValueError
            No such controller.

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
        """Return the linear system dx/dt = A x + B u of the arm near a state, by exact derivatives.

        Parameters
        ----------
        q, qd
            The state, shape (n,), rad, m and per second; at rest unless ``qd`` is given.

        Returns
        -------
        tuple[Array, Array]
            A, shape (2n, 2n), and B, shape (2n, n), SI units; u is tau minus C qd + g.

        Raises
        ------
        ValueError
            A state that is not (n,) and finite.
        DescriptionError
            A link without a body.

        Examples
        --------
        >>> A, B = Arm.load("planar2r").linearize([0, 0])
        >>> A.shape, B.shape
        ((4, 4), (4, 2))
        """
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
        """Return the cubic polynomials of time between two configurations.

        Craig 2005, Introduction to Robotics, section 7.3.

        Parameters
        ----------
        q0, q1
            Start and goal, shape (n,), rad and m.
        duration
            Duration, s; the shortest from rest to rest that the limits allow unless given.
        qd0, qd1
            Rates at both ends, shape (n,), rad/s and m/s; 0 unless given.
        limits
            Limits that the motion keeps; the arm's own unless given, without those of torque where a link has no body.
            A given duration is then held against the joints' ranges alone.
        torques
            Torques of a motion to use instead of the arm's, as for :func:`dhkit.trajectories.least_slowdown`.

        Returns
        -------
        Trajectory
            The motion: ``q(t)``, ``qd(t)``, ``qdd(t)``, ``tau(t)``.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, or rates without a duration.
        PlanningError
            A joint leaves its limits on the way, the duration is too short for the limits given, or no duration keeps
            them.

        Examples
        --------
        >>> motion = Arm.load("planar2r").cubic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.q(1.0), motion.qd(1.0)
        (array([0.25, 0.5 ]), array([0.375, 0.75 ]))
        """
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
        """Return the quintic polynomials of time between two configurations.

        Parameters
        ----------
        q0, q1
            Start and goal, shape (n,), rad and m.
        duration
            Duration, s; the shortest from rest to rest that the limits allow unless given.
        qd0, qd1
            Rates at both ends, shape (n,), rad/s and m/s; 0 unless given.
        qdd0, qdd1
            Accelerations at both ends, shape (n,), per second squared; 0 unless given.
        limits
            Limits that the motion keeps; the arm's own unless given, without those of torque where a link has no body.
            A given duration is then held against the joints' ranges alone.
        torques
            Torques of a motion to use instead of the arm's, as for :func:`dhkit.trajectories.least_slowdown`.

        Returns
        -------
        Trajectory
            The motion.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, or rates without a duration.
        PlanningError
            A joint leaves its limits on the way, the duration is too short for the limits given, or no duration keeps
            them.

        Examples
        --------
        >>> motion = Arm.load("planar2r").quintic([0, 0], [0.5, 1.0], duration=2.0)
        >>> motion.qdd(0.0), motion.q(2.0)
        (array([0., 0.]), array([0.5, 1. ]))
        """
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
        """Return the motion of trapezoidal velocity between two configurations, all joints together.

        Linear with parabolic blends: Craig 2005, section 7.3.

        Parameters
        ----------
        q0, q1
            Start and goal, shape (n,), rad and m.
        duration
            Duration, s; the shortest from rest to rest that the limits allow unless given.
        blend
            Share of the duration for accelerating, and again for braking, in (0, 0.5]; the one with the shortest
            duration unless given.
        limits
            Limits that the motion keeps; the arm's own unless given, without those of torque where a link has no body.
            A given duration is then held against the joints' ranges alone.
        torques
            Torques of a motion to use instead of the arm's, as for :func:`dhkit.trajectories.least_slowdown`.

        Returns
        -------
        Trajectory
            The motion.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, or rates without a duration.
        PlanningError
            A joint leaves its limits on the way, the duration is too short for the limits given, or no duration keeps
            them.

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
        """Return the cubic spline through configurations, at rest at both ends.

        Parameters
        ----------
        points
            Configurations, shape (m, n), m >= 2, rad and m.
        times
            Times of the points, shape (m,), s, increasing; as short as the limits allow unless given.
        limits
            Limits that the motion keeps; the arm's own unless given, without those of torque where a link has no body.
            A given duration is then held against the joints' ranges alone.
        torques
            Torques of a motion to use instead of the arm's, as for :func:`dhkit.trajectories.least_slowdown`.

        Returns
        -------
        Trajectory
            The motion, with continuous accelerations.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, or rates without a duration.
        PlanningError
            A joint leaves its limits on the way, the duration is too short for the limits given, or no duration keeps
            them.

        Examples
        --------
        >>> motion = Arm.load("planar2r").spline([[0, 0], [0.5, 0.2], [1.0, 0.0]], times=[0, 1, 2])
        >>> motion.q(1.0)
        array([0.5, 0.2])
        """
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
        """Return the motion of the tool along the straight line between two poses.

        The orientation turns evenly; the time law is s(t) = 10 t^3 - 15 t^4 + 6 t^5.

        Parameters
        ----------
        T0, T1
            Poses of the tool in the world, shape (4, 4), m.
        q0
            Joint values near which the motion begins, shape (n,), rad and m.
        duration
            Duration, s; the shortest that the limits allow unless given.
        limits
            Limits that the motion keeps; the arm's own unless given, without those of torque where a link has no body.
            A given duration is then held against the joints' ranges alone.
        torques
            Torques of a motion to use instead of the arm's, as for :func:`dhkit.trajectories.least_slowdown`.

        Returns
        -------
        Trajectory
            The motion; velocity and acceleration are 0 at both ends.

        Raises
        ------
        ValueError
            Other shapes, matrices that are not poses, or a duration that is not positive.
        PlanningError
            The workspace, a singularity or a joint limit is in the way, or no duration keeps the limits.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> T0, T1 = arm.fk([[0.2, 1.2], [0.8, 1.0]])
        >>> motion = arm.straight_line(T0, T1, q0=[0.2, 1.2], duration=1.0)
        >>> middle = arm.fk(motion.q(0.5))[:3, 3]
        >>> bool(abs(middle - (T0[:3, 3] + T1[:3, 3]) / 2).max() < 1e-7)
        True
        """
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
        """Return the motion of the tool along a circle or an arc.

        Parameters
        ----------
        T0
            The first pose of the tool in the world, shape (4, 4), m.
        centre
            Centre of the circle, shape (3,), m, world.
        axis
            Direction of its axis, shape (3,), world.
        angle
            Angle of the arc, rad; a whole circle unless given.
        q0
            Joint values near which the motion begins, shape (n,), rad and m.
        duration
            Duration, s; the shortest that the limits allow unless given.
        limits
            Limits that the motion keeps; the arm's own unless given.
        turning
            Whether the tool turns with the arc; otherwise it keeps its orientation.
        torques
            Torques of a motion to use instead of the arm's, as for :func:`dhkit.trajectories.least_slowdown`.

        Returns
        -------
        Trajectory
            The motion.

        Raises
        ------
        ValueError
            Other shapes, a matrix that is not a pose, or an axis without direction.
        PlanningError
            As for :meth:`straight_line`.

        Examples
        --------
        >>> arm = Arm.load("puma560")
        >>> T = arm.fk("nominal")
        >>> motion = arm.circle(T, T[:3, 3] + [0, 0.05, 0], [1, 0, 0], q0="nominal", duration=2.0)
        >>> bool(abs(arm.fk(motion.q(1.0))[:3, 3] - T[:3, 3] - [0, 0.1, 0]).max() < 1e-6)
        True
        """
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
        """Return a planner of optimal motions, to be used for many motions.

        Parameters
        ----------
        objective
            ``"time"``, ``"effort"``, ``"energy"``, ``"jerk"``, a term such as ``Time()``, or a sum such as
            ``Time() + 0.01 * Effort()``.
        limits
            Limits of position, velocity, acceleration, jerk and torque; the arm's own unless given.
        constraints
            Further constraints, such as ``ToolSpeed(0.5)``.
        intervals
            Number of intervals of the mesh; chosen by the arm and the objective unless given.
        friction
            Friction of the joints, as for inverse dynamics; a step is smoothed over 0.01 rad/s.

        Returns
        -------
        Planner
            Its :meth:`~dhkit.planning.Planner.solve` plans a motion.

        Raises
        ------
        ValueError, TypeError
            An argument that is none of these.

        Examples
        --------
        >>> planner = Arm.load("planar2r").planner("effort", intervals=16)
        >>> planner.solve([0, 0], [1.0, 0.5], duration=1.0).report.certificate.ok
        True
        """
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
        """Return the best motion between two configurations, or to a pose of the tool, certified.

        Planners are cached: the second motion with the same objective and constraints needs no new program.

        Parameters
        ----------
        start
            Joint values (n,), rad and m, or the name of a configuration.
        goal
            The same, or a pose (4, 4) of the tool in the world, of which all branches of inverse kinematics are tried.
        objective
            ``"time"``, ``"effort"``, ``"energy"``, ``"jerk"``, a term such as ``Time()``, or a sum such as
            ``Time() + 0.01 * Effort()``.
        constraints
            Further constraints, such as ``ToolSpeed(0.5)``.
        intervals
            Number of intervals of the mesh; chosen by the arm and the objective unless given.
        friction
            Friction of the joints, as for inverse dynamics; a step is smoothed over 0.01 rad/s.
        options, **keywords
            Fields of :class:`dhkit.PlanOptions`, as one value or one by one: ``via``, ``coordinates``, ``duration``,
            ``start_velocity``, ``goal_velocity``, ``limits``, ``payload``, ``obstacles``, ``clearance``,
            ``self_collision``, ``warm``, ``max_iterations``, ``time_limit``, ``progress``, ``compare``. Unless options
            are given, the report compares the motion with classical ones.

        Returns
        -------
        Trajectory
            The motion; its ``report`` has the certificate, the active limits and the other branches' durations.

        Raises
        ------
        PlanningError
            There is no such motion, or none was found: says which limit or obstacle prevents it.
        ValueError, TypeError
            Arguments of another shape or type.

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
        """Return the best timing of a given path, from rest to rest.

        See :func:`dhkit.planning.along_path`.

        Parameters
        ----------
        path
            A path without corners, such as one of :func:`dhkit.trajectories.joint_path`.
        objective
            ``"time"``, ``"effort"``, ``"energy"``, or a sum such as ``Time() + 0.01 * Effort()``.
        constraints
            Further constraints, such as ``ToolSpeed(0.5)``.
        intervals
            Initial number of intervals of the path's parameter.
        friction
            Friction of the joints, as for inverse dynamics; a step is smoothed over 0.01 rad/s.
        options, **keywords
            Fields of :class:`dhkit.PathOptions`, as one value or one by one: ``duration``, ``limits``, ``payload``,
            ``obstacles``, ``clearance``, ``self_collision``, ``max_iterations``, ``time_limit``, ``progress``.

        Returns
        -------
        Trajectory
            The motion, which stays exactly on the path, with its certificate.

        Raises
        ------
        PlanningError
            No timing keeps the limits, or none was found.
        ValueError, TypeError
            Arguments of another shape or type.

        Examples
        --------
        >>> from dhkit.trajectories import joint_path, tool_line
        >>> arm = Arm.load("planar2r")
        >>> line = tool_line(*arm.fk([[0.2, 1.2], [0.8, 1.0]]))
        >>> motion = arm.plan_path(joint_path(arm, line, q0=[0.2, 1.2]), intervals=60)
        >>> motion.report.certificate.ok
        True
        """
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
        """Check a motion against limits and obstacles, as planned motions are checked.

        Parameters
        ----------
        motion
            A motion of this arm.
        limits
            Limits of position, velocity, acceleration, jerk and torque; the arm's own unless given.
        friction
            Friction that the drives' torques include, False for none; the motion's own unless given.
        payload
            Payload of the tool; the motion's own unless given.
        obstacles
            Obstacles to stay clear of.
        clearance
            Least distance from them, m.
        self_collision
            Whether links keep the clearance from each other too.
        independent
            Whether a second check, which shares no code with the first, searches the motion for violations. It takes
            0.05 to 1 s.

        Returns
        -------
        Certificate
            ``.ok``, and the largest use of each limit.

        Raises
        ------
        DescriptionError
            A motion of another robot, or limits of torques of an arm without bodies.
        PlanningError
            A clearance larger than the space in which the arm moves.
        ModelError
            Pinocchio or coal is needed and not installed.

        Examples
        --------
        >>> arm = Arm.load("planar2r")
        >>> arm.certify(arm.quintic([0, 0], [1.0, 0.5])).ok
        True
        """
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
        """Return the exact distances of the links' capsules from obstacles, and from each other.

        Parameters
        ----------
        q
            Joint values, shape (..., n), rad and m, or the name of a configuration.
        obstacles
            Obstacles, of which at most one is a :class:`dhkit.Floor`.
        self_collision
            Whether distances between links are included.

        Returns
        -------
        Distances
            Least distances, shape (...), m, and the closest pair.

        Raises
        ------
        ModelError
            coal is not installed, or a mesh cannot be read.
        ValueError, TypeError
            Another shape of q, or of an obstacle.

        Examples
        --------
        >>> import dhkit
        >>> ball = dhkit.Obstacle.sphere(0.1, (0.4, 0.2, 0.9), name="ball")
        >>> Arm.load("puma560").distance([0, 0, 0, 0, 0, 0], [ball]).pair
        ('link 3', 'ball')
        """
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
        """Judge a student's answers exactly: proved right, or wrong with the difference and the mistake.

        See :func:`dhkit.grading.grade_answers`.

        Parameters
        ----------
        answers
            Answers by quantity: M, C, h, g, tau, K, V, L, A1 ... An, T, J, and dh and ik as tables as on a sheet. An
            answer is text, numbers, sympy or CasADi expressions, or a function.
        names
            How the student's names map on the robot's: ``{"q": ["th1", "th2"], "angles": "absolute"}``.
        task
            What was asked for, as on a sheet: ``{"friction": True}``.
        rubric
            Weights and penalties; verdicts become marks.
        seed
            Seed of the states at which wrong answers are shown; a fixed one unless given.
        explain
            Whether the mistake behind a wrong answer is looked for.
        **quantities
            Answers as keyword arguments, entries one by one too: ``M11=...``, ``g2=...``.

        Returns
        -------
        GradeReport
            Verdicts, differences, witnesses and diagnosis; prints as text.

        Raises
        ------
        AnswerError
            Answers that cannot be read.

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
        """Return Lagrange's equations of the arm, exactly.

        Parameters
        ----------
        symbols
            Names that stay symbols: ``"none"``: all are numbers; ``"file"``: the parameters of the robot file;
            ``"inertial"``: every inertial parameter, lengths and gravity.

        Returns
        -------
        Lagrangian
            Exact M, C, g, tau, K and V, which print as text, LaTeX and code.

        Raises
        ------
        DescriptionError
            A link without a body.
        ValueError
            Another choice of symbols.

        Examples
        --------
        >>> print(Arm.load("planar2r").derive().text(("g",)).splitlines()[1])
        g2 = m2*g*l2*c12/2
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
        """Return the fewest parameters that determine the joint torques.

        See :func:`dhkit.symbolic.base_parameters`.

        Returns
        -------
        BaseParameters
            Their number, and each as a combination of inertial parameters; rotors are included.

        Raises
        ------
        DescriptionError
            A link without a body.

        Examples
        --------
        >>> len(Arm.load("puma560").base_parameters())
        40
        """
        from dhkit.symbolic import base_parameters

        return base_parameters(self._description)

    # URDF, Pinocchio, verification

    def urdf(self) -> str:
        """Return the arm as URDF text, with meshes named ``meshes/...`` relative to it.

        Returns
        -------
        str
            The text; every DH frame is a link ``dh0`` ... ``dhn``, the tool is ``tool``.

        Examples
        --------
        >>> '<robot name="planar2r"' in Arm.load("planar2r").urdf()
        True
        """
        from dhkit.model import urdf_text

        return urdf_text(self._description)

    def write_urdf(self, path: str | Path, mesh_prefix: str | None = None) -> tuple[Path, ...]:
        """Write the arm's URDF, with its meshes beside it.

        Parameters
        ----------
        path
            The file; its folder is created.
        mesh_prefix
            Beginning of the meshes' names in the URDF instead of ``meshes/``: ``package://my_robot/meshes/`` for ROS.

        Returns
        -------
        tuple[Path, ...]
            The files written, the URDF first.

        Raises
        ------
        ModelError
            A file cannot be written or read.

        Examples
        --------
        >>> Arm.load("planar2r").write_urdf("planar2r.urdf")[0].name
        'planar2r.urdf'
        """
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
        """Return a new Pinocchio model of the arm, built from its URDF.

        See :func:`dhkit.model.pinocchio_model`; :attr:`model` keeps one.

        Returns
        -------
        pinocchio.Model
            With gravity, armature, friction and limits set; joint i of the table is joint i of the model.

        Raises
        ------
        ModelError
            Pinocchio is not installed, or refuses the model.

        Examples
        --------
        >>> Arm.load("planar2r").pinocchio_model().nq
        2
        """
        from dhkit.model import pinocchio_model

        return pinocchio_model(self._description)

    def verify(self, samples: int = 1000, seed: int = 0) -> VerificationReport:
        """Compare dhkit's kinematics and dynamics with Pinocchio's at random states.

        Pinocchio computes from the URDF that dhkit writes. See :func:`dhkit.verification.verify`.

        Parameters
        ----------
        samples
            Number of random states inside the limits.
        seed
            Their seed.

        Returns
        -------
        VerificationReport
            The worst error of each quantity, with its state; ``.ok`` is true if all agree.

        Raises
        ------
        ModelError
            Pinocchio is not installed, or refuses the model.
        ValueError
            ``samples`` is below 1.

        Examples
        --------
        >>> Arm.load("planar2r").verify(samples=50).ok
        True
        """
        from dhkit.verification import verify

        return verify(self._description, samples, seed)

    def report(
        self,
        folder: str | Path,
        motion: Trajectory | str | Path | None = None,
        run: SimulationResult | str | Path | None = None,
        format: str = "pdf",
    ) -> Report:
        """Write the arm up as an article of at most 30 pages, with its programs beside it.

        It has kinematics, inverse kinematics worked out, dynamics, verification, a motion and controllers; the
        student's own text has empty places.

        Parameters
        ----------
        folder
            The folder, which is made if there is none.
        motion
            The motion that it shows, or its file; a quintic between two configurations unless given.
        run
            A simulation that it shows, or its file. One of this arm with locked joints stands for a simplified model,
            whose equations are derived too.
        format
            ``"pdf"`` (needs the package typst), ``"html"`` or ``"tex"``.

        Returns
        -------
        Report
            The paths of the written files, and the number of pages of a PDF.

        Raises
        ------
        ValueError
            Another format.
        DescriptionError
            The folder is a file, or a motion or simulation cannot be read.
        MissingPackageError
            A PDF without the package typst.

        Examples
        --------
        >>> Arm.load("planar2r").report("out/planar2r", format="html")  # doctest: +SKIP
        <Report of out/planar2r/report.html: 4 files>
        """
        from dhkit.report import write_report

        return write_report(self._description, folder, motion, run, format)

    # Viewer

    def view(self, *, frames: bool = False, port: int = 0, token: str | None = None) -> View:
        """Return a view of the arm for a browser, a page or a picture.

        Parameters
        ----------
        frames
            Whether the DH frames are drawn.
        port
            Port of the page on 127.0.0.1; a free one for 0.
        token
            Token of the page's address; a random one unless given.

        Returns
        -------
        View
            It shows states, motions and ghosts; ``.open()`` opens the browser, ``.save_html(...)`` writes a page.

        Examples
        --------
        >>> with Arm.load("planar2r").view() as view:
        ...     view.picture(size=(320, 240)).size
        (320, 240)
        """
        from dhkit.viewer import View

        return View(self._description, frames=frames, port=port, token=token)

    @cached_property
    def _calls(self) -> ArmCalls:
        """Compiled functions for single states."""
        from dhkit.arm_calls import ArmCalls

        return ArmCalls(self._description)

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
