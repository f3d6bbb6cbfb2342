"""An arm in a browser: live through a server of our own, or saved as one offline page."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, Robot, description_of
from dhkit.description.frames import joint_array
from dhkit.display import repr_line
from dhkit.errors import ModelError
from dhkit.viewer import protocol
from dhkit.viewer.exports import Exportable, Snapshot
from dhkit.viewer.motion import Motion, played_motion
from dhkit.viewer.notebook import framed_page, notebook_widget
from dhkit.viewer.opening import open_in_browser
from dhkit.viewer.overlays import ball_transforms, color_bytes, ghost_tints, rounded_boxes
from dhkit.viewer.pictures import Ghost
from dhkit.viewer.scene import build_scene, first_configuration, node_transforms, scene_size
from dhkit.viewer.session import OF_ONE_ARM, Slot

if TYPE_CHECKING:
    from dhkit.kinematics.manipulability import Ellipsoid
    from dhkit.planning.obstacles import Scene
    from dhkit.viewer.protocol import Samples
    from dhkit.viewer.server import Answer, ViewerServer

_ELLIPSOID_SHARE = 0.25
"""Length that the longest half axis of ellipsoids is drawn with, as a share of the arm's size."""


class View(Exportable):
    """A view of an arm, first in its ``ready`` configuration or at zero.

    The server starts with the first use of :attr:`url` or :meth:`open`; a page that opens then shows the present
    state and follows. :meth:`save_html` needs no server. Safe to use from several threads.

    Parameters
    ----------
    description
        The arm.
    frames
        Whether the DH frames are drawn as triads with labels; a page can switch them too.
    answer
        Answers requests of pages with panels: see :class:`dhkit.viewer.server.ViewerServer`. Pages have panels where
        this is given.
    port, token
        Address of the page, for pages that are to find it again; by default any free port and a new token.

    Raises
    ------
    ModelError
        A mesh cannot be read.

    Examples
    --------
    >>> from dhkit.description.library import library_robot
    >>> with View(library_robot("planar2r"), frames=True) as view:
    ...     view.show([0.3, 0.5])
    ...     view.play(([0.0, 1.0], [[0.3, 0.5], [1.2, -0.4]]))
    """

    def __init__(
        self,
        description: Robot,
        *,
        frames: bool = False,
        answer: Answer | None = None,
        port: int = 0,
        token: str | None = None,
    ) -> None:
        self._description: Description = description_of(description)
        description = self._description
        self._answer = answer
        self._port = port
        self._token = token
        self._server: ViewerServer | None = None
        self._widget: Any = None
        """The widget of a notebook that shows this view."""
        self._closed = False
        self._lock = threading.RLock()
        self._state: dict[Slot, bytes] = {Slot.SCENE: self._scene(description)}
        self._q = first_configuration(description)
        self._played: Motion | None = None
        self._ghosts: tuple[Ghost, ...] = ()
        self._ghost_names: tuple[tuple[str, str], ...] = ()
        self._trace: Array | None = None
        self._obstacles: Scene = ()
        self.frames(frames)
        self.show(first_configuration(description))

    @property
    def description(self) -> Description:
        """The arm."""
        return self._description

    @property
    def url(self) -> str:
        """Address of the page for a browser on this machine; the first use starts the server.

        Raises
        ------
        ModelError
            The view is closed, or the server did not start.
        """
        return self._live().url

    def open(self, *, block: bool = False) -> str:
        """Open the page in the default browser and return its address.

        With ``block`` it returns when Ctrl-C is pressed: a script that ends takes its view along.
        """
        url = self.url
        open_in_browser(url)
        with suppress(KeyboardInterrupt):
            while block:
                time.sleep(0.2)
        return url

    def show(self, q: ArrayLike) -> None:
        """Move the arm; at most as fast as pages can draw, with the latest state always drawn.

        Parameters
        ----------
        q
            Joint values, shape (n,), rad and m.

        Raises
        ------
        ValueError
            Another shape, or values that are not finite.
        """
        q = joint_array(self._description, q)
        if q.ndim != 1:
            raise ValueError(
                f"q has shape {q.shape}; expected ({self._description.n},): play shows a motion"
            )
        if not np.isfinite(q).all():
            raise ValueError(f"q is {q.tolist()}; expected finite values")
        self._q = q.copy()
        self._played = None
        self._publish(Slot.MOTION, protocol.encode_pose(q, node_transforms(self._description, q)))

    def replace(self, description: Robot, q: ArrayLike | None = None) -> None:
        """Show another arm instead of this one; drawings made for the arm before are removed.

        Parameters
        ----------
        description
            The arm.
        q
            Joint values that it is shown in, shape (n,), rad and m; its first configuration if not given.

        Raises
        ------
        ModelError
            A mesh that cannot be read.
        """
        description = description_of(description)
        scene = self._scene(description)
        with self._lock:
            self._description = description
            for slot in OF_ONE_ARM:
                self._state.pop(slot, None)
            self._played = None
            self._trace = None
            self._ghosts = ()
            self._ghost_names = ()
            self._q = first_configuration(description) if q is None else joint_array(description, q)
            self._publish(Slot.SCENE, scene)
            self.show(self._q)

    def panel(self, name: str, data: object) -> None:
        """Send the state of a panel, of values that JSON can hold, to the pages; it replaces the last of its name."""
        self._live().publish_state(name, data)

    def append(self, samples: Samples) -> None:
        """Send rows of numbers to the pages that follow those of the same name."""
        self._live().append(samples)

    def play(self, motion: Motion, *, trace: bool = True) -> None:
        """Play a motion; the page can pause, repeat and slow it down.

        Parameters
        ----------
        motion
            A trajectory of this arm; or a simulation of it, with a translucent ghost that follows the reference
            exactly; or times, shape (N,), s, increasing, and joint values, shape (N, n), rad and m, between which
            joints move evenly. The arm that was simulated may differ in its payload and parameters.
        trace
            Whether the tool draws its path.

        Raises
        ------
        ValueError
            Other shapes, fewer than two samples, values that are not finite, or times that do not increase.
        DescriptionError
            The trajectory or the simulation is another robot's.
        """
        times, q, reference_q = played_motion(self._description, motion)
        transforms = node_transforms(self._description, q)
        ghost = None
        if reference_q is not None:
            ghost = node_transforms(self._description, reference_q), ghost_tints(1)
        self._played = motion
        self._publish(
            Slot.MOTION, protocol.encode_animation(times, q, transforms, trace=trace, ghost=ghost)
        )

    def trace(self, points: ArrayLike | None) -> None:
        """Draw a line through points, instead of the last; None takes it away.

        Parameters
        ----------
        points
            Shape (N, 3), m, in the world.

        Raises
        ------
        ValueError
            Another shape, or values that are not finite.
        """
        self._trace = line = _point_rows(points, "points")
        self._publish(Slot.TRACE, protocol.encode_trace(line))

    def points(self, positions: ArrayLike | None, colors: ArrayLike | None = None) -> None:
        """Draw a cloud of points, instead of the last; None takes it away.

        Parameters
        ----------
        positions
            Shape (N, 3), m, in the world. Some ten thousand are drawn at a good rate.
        colors
            Red, green and blue from 0 to 1, shape (N, 3), or (3,) for all points; grey if not given.

        Raises
        ------
        ValueError
            Other shapes, values that are not finite, or colors below 0 or above 1.
        """
        cloud = _point_rows(positions, "positions")
        self._publish(Slot.POINTS, protocol.encode_points(cloud, color_bytes(colors, len(cloud))))

    def ellipsoid(self, ellipsoid: Ellipsoid | None, scale: float | None = None) -> None:
        """Draw an ellipsoid or a batch of them, instead of the last; None takes them away.

        Parameters
        ----------
        ellipsoid
            As :func:`dhkit.kinematics.manipulability.velocity_ellipsoid` gives it; what is NaN is left out.
        scale
            Length that a half axis of 1 is drawn with, m; by default such that the longest half axis is a quarter of
            the arm's size.

        Raises
        ------
        ValueError
            An infinite half axis, or a scale that is not positive.
        """
        longest = _ELLIPSOID_SHARE * scene_size(self._description)
        transforms = (
            np.zeros((0, 4, 4)) if ellipsoid is None else ball_transforms(ellipsoid, scale, longest)
        )
        self._publish(Slot.ELLIPSOIDS, protocol.encode_ellipsoids(transforms))

    def ghosts(
        self,
        q: ArrayLike | None,
        tints: ArrayLike | None = None,
        names: Sequence[str] | None = None,
    ) -> None:
        """Draw translucent copies of the arm in further states, instead of the last; None takes them away.

        Parameters
        ----------
        q
            Joint values, shape (k, n), rad and m; rows with NaN are left out, so that the branches of an inverse
            kinematics solution can be given as they are.
        tints
            Red, green and blue from 0 to 1, shape (k, 3), or (3,) for all ghosts; by default each has its own.
        names
            Names of the k ghosts, which a page with panels writes beside them.

        Raises
        ------
        ValueError
            Other shapes, another number of names, or colors below 0 or above 1.
        """
        states = (
            np.zeros((0, self._description.n)) if q is None else joint_array(self._description, q)
        )
        states = states[None] if isinstance(q, str) else states
        if states.ndim != 2:
            raise ValueError(f"q has shape {states.shape}; expected (k, {self._description.n})")
        colors = (
            ghost_tints(len(states)) if tints is None else color_bytes(tints, len(states), "tints")
        )
        if names is not None and len(names) != len(states):
            raise ValueError(f"{len(names)} names; expected {len(states)}, one a ghost")
        shown = np.atleast_1d(np.isfinite(states).all(axis=1))
        self._ghost_names = tuple(
            (str(name), f"#{bytes(color).hex()}")
            for name, color, is_shown in zip(names or (), colors, shown, strict=names is not None)
            if is_shown
        )
        transforms = node_transforms(self._description, states[shown])
        self._ghosts = tuple(
            Ghost(T, tuple(tint))
            for T, tint in zip(transforms, colors[shown].tolist(), strict=True)
        )
        self._publish(Slot.GHOSTS, protocol.encode_ghosts(transforms, colors[shown]))

    def obstacles(self, obstacles: Scene | None) -> None:
        """Draw translucent obstacles, instead of the last; None takes them away.

        Parameters
        ----------
        obstacles
            As :meth:`dhkit.Arm.plan` takes them: ``Obstacle.box(...)`` and the like, and ``Floor()``.

        Raises
        ------
        TypeError
            The scene has something else than obstacles and floors.
        ValueError
            The scene has more than one floor.
        """
        scene = () if obstacles is None else tuple(obstacles)
        boxes = rounded_boxes(scene, scene_size(self._description))
        self._obstacles = scene
        self._publish(Slot.OBSTACLES, protocol.encode_obstacles(*boxes))

    def frames(self, visible: bool) -> None:
        """Show or hide the DH frames."""
        self._frames = visible
        self._publish(Slot.FRAMES, protocol.encode_frames(visible))

    def wait(self, timeout: float = 10.0) -> None:
        """Return when a page is connected and every page has drawn the latest state.

        Raises
        ------
        TimeoutError
            Not within so many seconds.
        """
        self._live().wait(timeout)

    def close(self) -> None:
        """Stop the server; pages say that the connection is lost, and the view cannot be moved any more."""
        with self._lock:
            self._closed = True
            server = self._server
            self._server = None
        if server is not None:
            server.close()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """Show the present state as a page of its own."""
        return framed_page(self.html(interactive=True), self._description.name)

    def _repr_mimebundle_(
        self, include: object = None, exclude: object = None
    ) -> dict[str, Any] | Any:
        """Show the page in a notebook, such that it follows :meth:`show` where anywidget is installed."""
        page = self.html(interactive=True)
        with self._lock:
            if self._widget is None:
                self._widget = notebook_widget(page, self._description.name)
            else:
                self._widget.page = page
            widget = self._widget
        if widget is None:
            return {
                "text/html": framed_page(page, self._description.name),
                "text/plain": repr(self),
            }
        return widget._repr_mimebundle_(include=include, exclude=exclude)

    def __repr__(self) -> str:
        # Without the token: a notebook that is passed on would show it.
        if self._closed:
            state = "closed"
        elif self._server is None:
            state = "no server yet"
        else:
            state = f"port {self._server.port}"
        return repr_line("View", self._description.name, state)

    def snapshot(self) -> Snapshot:
        """Return the present contents of the view."""
        with self._lock:
            return Snapshot(
                self._description,
                dict(self._state),
                self._q,
                self._played,
                self._frames,
                self._ghosts,
                self._ghost_names,
                self._trace,
                self._obstacles,
            )

    def _scene(self, description: Description) -> bytes:
        from dhkit.model.shapes import link_parts

        scene = build_scene(description, link_parts(description))
        scene.about["panels"] = self._answer is not None
        return protocol.encode_scene(scene)

    def _live(self) -> ViewerServer:
        from dhkit.viewer.server import ViewerServer

        with self._lock:
            if self._closed:
                raise ModelError("the viewer is closed")
            if self._server is None:
                self._server = ViewerServer(self._state, self._answer, self._port, self._token)
            return self._server

    def _publish(self, slot: Slot, message: bytes) -> None:
        with self._lock:
            if self._closed:
                raise ModelError("the viewer is closed")
            self._state[slot] = message
            if self._server is not None:
                self._server.publish(slot, message)
            if self._widget is None:
                return
            if slot == Slot.SCENE:
                self._widget.page = self.html(interactive=True)
            elif slot == Slot.MOTION and self._played is None:
                self._widget.send({"q": self._q.tolist()})
            else:
                self._widget.send({}, [message])


def _point_rows(value: ArrayLike | None, name: str) -> Array:
    """Return points, shape (N, 3), m, all finite; no point for None."""
    points = np.zeros((0, 3)) if value is None else np.asarray(value, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"{name} has shape {points.shape}; expected (N, 3)")
    if not np.isfinite(points).all():
        raise ValueError(f"{name} has values that are not finite")
    return points
