"""Programs of steps with different numbers of items: one pose, then 20 angles, then 16 roots, then 16 solutions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from dhkit.display import counted, repr_line
from dhkit.symbolic.programs.graph import Graph, Variable
from dhkit.symbolic.programs.loop import Loop

INDEX = "index"
"""The source of an input that is the number of the item, from 0."""


@dataclass(frozen=True, repr=False)
class PipelineStep:
    """A straight-line program that is run for several items, in the lanes of vectors where there are more than one.

    Attributes
    ----------
    graph
        The program; its first input holds the parameters.
    items
        Number of items.
    each
        Where each item's inputs come from, by the input's name: an output of an earlier step with as many items, or
        ``INDEX``; or all items' inputs, one entry after the other, as one output of a step of one item. An input that
        has its source's name need not be here.
    shared
        Sources of inputs that all items share, likewise: an input of the pipeline, or all items of an output, one entry
        after the other.
    most
        Largest number of times that the step is run, until its last output, ``goes_on``, is 0 for all items. Its other
        outputs take the place of earlier ones of the same names.
    skips
        Source of a number of each item, or empty: items where it is not 0 have the outputs 0. The step is not run for
        vectors of such items alone.
    places
        Output that is a permutation of the items' numbers, or empty: an item's outputs become those of the item of
        that number.
    """

    graph: Graph
    items: int = 1
    each: Mapping[str, str] = field(default_factory=dict)
    shared: Mapping[str, str] = field(default_factory=dict)
    most: int = 1
    skips: str = ""
    places: str = ""

    def __post_init__(self) -> None:
        if self.most > 1 and (self.skips or self.places):
            raise ValueError(
                f"{self.graph.name}: a step that is repeated has all items in their order"
            )

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """The outputs that later steps can use."""
        return self.graph.outputs[:-1] if self.most > 1 else self.graph.outputs

    def __repr__(self) -> str:
        often = f", at most {counted(self.most, 'time')}" if self.most > 1 else ""
        return repr_line(
            f"PipelineStep {self.graph.name}", summary=f"{counted(self.items, 'item')}{often}"
        )


@dataclass(frozen=True, repr=False)
class Pipeline:
    """Steps that are run one after the other.

    Attributes
    ----------
    name
        An identifier.
    inputs
        The parameters and the inputs, each of one item.
    steps
        The steps.
    results
        Names of the steps' outputs that are the pipeline's, item by item.
    """

    name: str
    inputs: tuple[Variable, ...]
    steps: tuple[PipelineStep, ...]
    results: tuple[str, ...]

    def __post_init__(self) -> None:
        sizes = {variable.name: (1, variable.size) for variable in self.inputs[1:]}
        for step in self.steps:
            for variable in step.graph.inputs[1:]:
                source, is_shared = self.source(step, variable.name)
                if source == INDEX:
                    continue
                items, size = sizes[source]
                if is_shared:
                    fits = variable.size == items * size
                else:
                    fits = items in (1, step.items) and step.items * variable.size == items * size
                if not fits:
                    raise ValueError(
                        f"{step.graph.name}: {variable.name} has {variable.size} entries, "
                        f"but {source} has {items} times {size}"
                    )
            self._check_masks(step, sizes)
            for variable in step.outputs:
                sizes[variable.name] = (step.items, variable.size)
        for name in self.results:
            if name not in sizes:
                raise ValueError(f"{self.name}: no step has the output {name}")

    def _check_masks(self, step: PipelineStep, sizes: Mapping[str, tuple[int, int]]) -> None:
        """Raise ValueError unless what a step skips and where it puts its outputs is one number of each item."""
        own = {one.name: (step.items, one.size) for one in step.outputs}
        fitting = ((step.items, 1), (1, step.items))
        for name, known in ((step.skips, sizes), (step.places, own)):
            if name and known.get(name) not in fitting:
                raise ValueError(
                    f"{step.graph.name}: {name} is not one number of each of {step.items} items"
                )

    def with_reciprocals(self) -> Pipeline:
        """Return the program with fewer divisions, see :meth:`Graph.with_reciprocals`."""
        steps = tuple(replace(step, graph=step.graph.with_reciprocals()) for step in self.steps)
        return replace(self, steps=steps)

    def source(self, step: PipelineStep, name: str) -> tuple[str, bool]:
        """Return where an input of a step comes from, and whether all items share it."""
        if name in step.each:
            return step.each[name], False
        if name in step.shared:
            return step.shared[name], True
        return name, any(variable.name == name for variable in self.inputs)

    @property
    def sizes(self) -> dict[str, tuple[int, int]]:
        """Number of items and of entries of an item, by the names of inputs and of the steps' outputs."""
        sizes = {variable.name: (1, variable.size) for variable in self.inputs[1:]}
        for step in self.steps:
            sizes.update({one.name: (step.items, one.size) for one in step.outputs})
        return sizes

    @property
    def outputs(self) -> Sequence[Variable]:
        """The outputs of the pipeline: (items, entries) each."""
        return [Variable(name, self.sizes[name]) for name in self.results]

    def __repr__(self) -> str:
        return repr_line(f"Pipeline {self.name}", summary=counted(len(self.steps), "step"))


Program: TypeAlias = Graph | Loop | Pipeline
"""A program that kernels run."""
