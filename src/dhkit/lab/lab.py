"""The lab: panels beside an arm in the browser, whose requests Python answers."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any
from urllib.parse import urlsplit

from dhkit.arm import Arm
from dhkit.description import Robot, description_of
from dhkit.display import repr_line
from dhkit.errors import ModelError
from dhkit.lab.assignment import Assignment
from dhkit.lab.control_panel import ControlPanel
from dhkit.lab.desk import Desk
from dhkit.lab.dynamics_panel import DynamicsPanel
from dhkit.lab.fields import Fields
from dhkit.lab.jobs import Jobs
from dhkit.lab.joint_panel import JointPanel
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.own_panel import OwnPanel
from dhkit.lab.python_lines import python_lines
from dhkit.lab.submit_panel import SubmitPanel
from dhkit.lab.table_panel import TablePanel
from dhkit.lab.task_panel import TaskPanel
from dhkit.lab.tool_panel import ToolPanel
from dhkit.lab.transforms_panel import Solid, TransformsPanel
from dhkit.lab.workspace_panel import WorkspacePanel
from dhkit.viewer import View


class Lab:
    """An arm that a person moves, drives, edits and controls in the browser.

    The server runs from the beginning, on this machine's loopback interface alone, with a random token in its address;
    all pages show the same arm, and a page that is loaded anew the present state.

    Parameters
    ----------
    arm
        The arm.
    own
        A program with ``fk``, ``ik`` or ``controller``, which is held against the arm: a ``.py`` or ``.m`` file, or a
        command; see :class:`dhkit.programs.Program`.
    sandbox
        What it runs in: ``"bwrap"``, or None.
    solid
        What the panel of transforms turns and moves: an ``.stl`` file, a box unless given.
    assignment
        Texts and goals that the page shows first; its robot is the arm.
    port, token
        Where the page is, for pages that are to find it again; any free port and a new token unless given.

    Raises
    ------
    ModelError
        A mesh that cannot be read, or the server did not start.
    DescriptionError
        The assignment is about another robot.

    Examples
    --------
    >>> with Lab(Arm.load("planar2r")) as lab:
    ...     lab.answer("joints.set", {"q": [0.1, 0.2]})
    {}
    """

    def __init__(
        self,
        arm: Robot,
        port: int = 0,
        token: str | None = None,
        own: str | Path | Sequence[str] | None = None,
        sandbox: str | None = None,
        solid: str | Path | None = None,
        assignment: Assignment | None = None,
    ) -> None:
        arm = arm if isinstance(arm, Arm) else Arm(description_of(arm))
        if assignment is not None:
            assignment.require(arm)
        self._lock = threading.RLock()
        self._closed = False
        given = None if solid is None else Solid.read(Path(solid))
        self.view = View(arm.description, answer=self.answer, port=port, token=token)
        self.desk = Desk(arm, self.view)
        if assignment is not None and assignment.start is not None:
            self.desk.q = assignment.start.copy()
        jobs = Jobs(lambda state: self.view.panel("job", state), self._lock)
        joints = JointPanel(self.desk)
        self._tool = ToolPanel(self.desk)
        table = TablePanel(self.desk)
        self._motions = MotionPanel(self.desk, jobs)
        self._own = OwnPanel(self.desk, own, sandbox, self._lock)
        self._control = ControlPanel(self.desk, self._motions, self._own)
        self._dynamics = DynamicsPanel(self.desk, self._lock)
        self._workspace = WorkspacePanel(self.desk, self._lock)
        self._submit = SubmitPanel(self.desk, self._lock)
        transforms = TransformsPanel(self.desk, given)
        task = TaskPanel(self.desk, self._motions, self._own, assignment)
        self._requests: dict[str, Callable[[dict[str, Any]], Any]] = {
            "joints.set": joints.set,
            "joints.named": joints.named,
            "tool.target": self._tool.target,
            "tool.pose": self._tool.pose,
            "tool.jog": self._tool.jog,
            "tool.choose": self._tool.choose,
            "tool.order": self._tool.order,
            "tool.clear": self._tool.clear,
            "tool.read": self._tool.read,
            "table.edit": table.edit,
            "table.convention": table.convention,
            "table.undo": table.undo,
            "table.redo": table.redo,
            "table.reset": table.reset,
            "table.steps": table.steps,
            "table.download": table.download,
            "motion.plan": self._motions.plan,
            "motion.cancel": self._motions.cancel,
            "motion.clear": self._motions.clear,
            "motion.file": self._motions.file,
            "motion.play": self._motions.play,
            "motion.show": self._motions.show,
            "motion.download": self._motions.download,
            "waypoints.add": self._motions.add,
            "waypoints.remove": self._motions.remove,
            "waypoints.go": self._motions.go,
            "waypoints.clear": self._motions.forget,
            "control.start": self._control.start,
            "control.change": self._control.change,
            "control.pause": self._control.pause,
            "control.stop": self._control.stop,
            "control.push": self._control.push,
            "control.download": self._control.download,
            "own.ghosts": self._own.ghosts,
            "own.score": self._own.score,
            "dynamics.read": self._dynamics.read,
            "dynamics.ellipsoid": self._dynamics.ellipsoid,
            "dynamics.entry": self._dynamics.entry,
            "workspace.show": self._workspace.show,
            "workspace.read": self._workspace.read,
            "transforms.apply": transforms.apply,
            "submit.grade": self._submit.grade,
            "submit.cancel": self._submit.cancel,
            "task.reset": task.reset,
            "bodies.assume": self._control.assume,
            "arm.planar": self._control.lock_to_planar,
            "python": self._python,
        }
        self.desk.publish()
        self.view.panel("target", None)
        table.publish()
        self._motions.publish()
        self._control.publish()
        self._dynamics.publish()
        self._workspace.publish()
        transforms.publish()
        task.publish()
        self._own.begin()

    @property
    def url(self) -> str:
        """Where a browser on this machine finds the page; the token in it is the permission to use it."""
        return self.view.url

    def answer(self, name: str, data: dict[str, Any]) -> Any:
        """Return the answer to a page's request.

        Raises
        ------
        ValueError
            No such request, or a field that does not fit.
        DhkitError
            What is asked for cannot be done.
        """
        request = self._requests.get(name)
        if request is None:
            raise ValueError(f"no request {name[:40]!r}")
        with self._lock:
            if self._closed:
                raise ModelError("the lab is closed")
            return request(data)

    def close(self) -> None:
        """End what runs, and the server."""
        with self._lock:
            self._closed = True
        self._motions.close()
        self._control.close()
        self._own.close()
        for panel in (self._dynamics, self._workspace, self._submit):
            panel.close()
        self.desk.close()
        self.view.close()

    def __enter__(self) -> Lab:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        where = "closed" if self._closed else f"port {urlsplit(self.view.url).port}"
        return repr_line("Lab", self.desk.arm.name, where)

    def _python(self, data: dict[str, Any]) -> dict[str, Any]:
        Fields("python", data, [])
        return {"text": python_lines(self.desk, self._tool, self._motions, self._control)}
