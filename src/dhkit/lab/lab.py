"""The lab: panels beside an arm in the browser, whose requests Python answers."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Robot, description_of
from dhkit.display import repr_line
from dhkit.errors import ModelError
from dhkit.lab.answers_panel import AnswersPanel
from dhkit.lab.assignment import Assignment
from dhkit.lab.control_panel import ControlPanel
from dhkit.lab.desk import Desk
from dhkit.lab.dynamics_panel import DynamicsPanel
from dhkit.lab.jobs import Jobs
from dhkit.lab.motion_panel import MotionPanel
from dhkit.lab.obstacle_panel import ObstaclePanel
from dhkit.lab.own_panel import OwnPanel
from dhkit.lab.python_panel import PythonPanel
from dhkit.lab.record import taken_up
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.lab.table_panel import TablePanel
from dhkit.lab.task_panel import TaskPanel
from dhkit.lab.tool_panel import ToolPanel
from dhkit.lab.transforms_panel import Solid, TransformsPanel
from dhkit.lab.workspace_panel import WorkspacePanel
from dhkit.programs import Isolation, random_states
from dhkit.viewer import View


class Lab:
    """An arm that a person moves, drives, edits and controls in the browser.

    The server runs from the beginning, on this machine's loopback interface alone, with a random token in its address.
    All pages show the same arm, and a page that is loaded again shows the present state.

    Parameters
    ----------
    arm
        The arm.
    own
        A program with ``fk``, ``ik`` or ``controller`` that is compared with the arm: a ``.py`` or ``.m`` file, or a
        command; see :class:`dhkit.programs.Program`.
    isolation
        Isolation of the program: files and resources that it can use; None for the best that works here.
    solid
        An ``.stl`` file with the solid of the panel of transforms; by default a box.
    assignment
        Texts and goals that the page shows first; its robot is the arm.
    loaded_from
        Name or path that the arm was loaded from, for "Copy as Python"; by default its name, if it is in the library.
    record
        File in which the work on the assignment is recorded, to be handed in; work in it is taken up again.
    port, token
        Address of the page, for pages that are to find it again; by default any free port and a new token.

    Raises
    ------
    ModelError
        A mesh cannot be read, or the server did not start.
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
        isolation: Isolation | None = None,
        solid: str | Path | None = None,
        assignment: Assignment | None = None,
        loaded_from: str | None = None,
        record: Path | None = None,
    ) -> None:
        arm = arm if isinstance(arm, Arm) else Arm(description_of(arm))
        if assignment is not None:
            assignment.require(arm)
        self._lock = threading.RLock()
        self._closed = False
        work = None if record is None or assignment is None else taken_up(record, assignment)
        solid_read = None if solid is None else Solid.read(Path(solid))
        self.view = View(arm.description, answer=self.answer, port=port, token=token)
        self.desk = desk = Desk(arm, self.view)
        if assignment is not None and assignment.start is not None:
            desk.q = assignment.start.copy()
        self._tool = ToolPanel(desk)
        table = TablePanel(desk)
        obstacles = ObstaclePanel(desk)
        jobs = Jobs(lambda state: self.view.panel("job", state), self._lock)
        self._motions = MotionPanel(desk, jobs, obstacles)
        self._own = OwnPanel(desk, own, isolation, self._lock)
        self._control = ControlPanel(desk, self._motions, self._own)
        judged_answers = AnswersPanel(desk, self._lock)
        self._panels: tuple[Panel, ...] = (
            JointPanel(desk),
            self._tool,
            table,
            obstacles,
            self._motions,
            self._control,
            DynamicsPanel(desk, self._lock),
            WorkspacePanel(desk, self._lock),
            judged_answers,
            TransformsPanel(desk, solid_read),
            TaskPanel(
                desk,
                self._motions,
                self._own,
                judged_answers,
                self._control,
                assignment,
                record,
                work,
            ),
            PythonPanel(desk, table, self._tool, self._motions, self._control, loaded_from),
            self._own,
        )
        self._requests: dict[str, Callable[[JsonObject], JsonObject]] = {}
        for panel in self._panels:
            self._requests |= panel.handlers()
        desk.publish()
        for panel in self._panels:
            panel.publish()
        self._own.begin()

    @property
    def url(self) -> str:
        """Address of the page for a browser on this machine; the token in it is the permission to use the page."""
        return self.view.url

    def answer(self, name: str, data: JsonObject) -> JsonObject:
        """Return the answer to a page's request.

        Raises
        ------
        ValueError
            There is no such request, or a field has a wrong value.
        DhkitError
            The request cannot be fulfilled.
        """
        handler = self._requests.get(name)
        if handler is None:
            raise ValueError(f"no request {name[:40]!r}")
        with self._lock:
            if self._closed:
                raise ModelError("the lab is closed")
            return handler(data)

    def close(self) -> None:
        """End running work, and the server."""
        with self._lock:
            self._closed = True
        for panel in self._panels:
            panel.close()
        self.desk.close()
        self.view.close()

    def __enter__(self) -> Lab:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        state = "closed" if self._closed else f"port {urlsplit(self.view.url).port}"
        return repr_line("Lab", self.desk.arm.name, state)


class JointPanel(Panel):
    """The panel of joints: values by slider and number, named configurations, random values."""

    def __init__(self, desk: Desk, seed: int = 0) -> None:
        super().__init__(desk)
        self._random = np.random.default_rng(seed)

    @answers("joints.set", "q", "joint")
    def set_values(self, fields: Fields) -> None:
        """Move the arm to joint values; those outside limits are marked. A simulation takes them as its setpoint."""
        n = self.desk.arm.n
        q = fields.joint_values("q", n)
        self.desk.steer(q, fields.integer("joint", 0, n - 1) if "joint" in fields else None)

    @answers("joints.named", "name")
    def set_named(self, fields: Fields) -> JsonObject:
        """Move the arm to a configuration by name, to zero, or to random joint values inside the limits."""
        arm = self.desk.arm
        name = fields.choice("name", ["zero", "random", *arm.configurations])
        if name == "random" and name not in arm.configurations:
            q = random_states(arm, self._random, 1)[0]
        else:
            q = np.array(arm.configurations.get(name, np.zeros(arm.n)))
        self.desk.steer(q, None)
        return {"q": q.tolist()}
