"""Programs that repeat a step: iterative methods whose number of steps depends on the item."""

from __future__ import annotations

from dataclasses import dataclass, replace

from dhkit.display import repr_line
from dhkit.symbolic.programs.graph import Graph, Variable


@dataclass(frozen=True)
class Loop:
    """A step on a state, repeated for each item until it is done, and a bounded number of times.

    Parameters are shared by all items. ``fixed`` are values of an item that do not change from step to step.

    Attributes
    ----------
    begin
        Inputs ``parameters`` and those of the program; outputs ``state`` and ``fixed``.
    step
        Inputs ``parameters``, those of the program, ``fixed`` and ``state``; outputs the next ``state``, and
        ``goes_on``, 1 where another step follows and else 0.
    finish
        Inputs as for ``step``; outputs those of the program.
    most
        Largest number of steps.
    in_lanes
        Whether batches are computed in the lanes of vectors, each until its slowest item is done. It pays where items
        take about the same number of steps.
    """

    begin: Graph
    step: Graph
    finish: Graph
    most: int
    in_lanes: bool = False

    def __post_init__(self) -> None:
        state, fixed = (variable.size for variable in self.begin.outputs)
        for graph in (self.step, self.finish):
            own, shared = graph.inputs[:-2], self.begin.inputs
            if own != shared or [x.size for x in graph.inputs[-2:]] != [fixed, state]:
                raise ValueError(f"{graph.name}: inputs differ from those of {self.begin.name}")
        if [variable.size for variable in self.step.outputs] != [state, 1]:
            raise ValueError(f"{self.step.name}: outputs are not a state and whether it goes on")

    def with_reciprocals(self) -> Loop:
        """Return the program with fewer divisions, see :meth:`Graph.with_reciprocals`."""
        return replace(
            self,
            begin=self.begin.with_reciprocals(),
            step=self.step.with_reciprocals(),
            finish=self.finish.with_reciprocals(),
        )

    @property
    def name(self) -> str:
        """Name of the program."""
        return self.finish.name

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """The parameters, and the inputs of an item."""
        return self.begin.inputs

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """The outputs of an item."""
        return self.finish.outputs

    def __repr__(self) -> str:
        return repr_line(f"Loop {self.name}", summary=f"at most {self.most} steps")
