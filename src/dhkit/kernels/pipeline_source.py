"""A pipeline as text of LLVM's intermediate representation: a function for each step, and one that calls them in order.

What goes from step to step lies in memory entry by entry, the items of an entry next to each other and filled up to
whole vectors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from dhkit.kernels.lowering import plain_results
from dhkit.kernels.vectors import FUSING, WIDTH, Body, Mask, Vector, select, spread
from dhkit.symbolic import Pipeline, PipelineStep
from dhkit.symbolic.programs.pipeline import INDEX


def pipeline_source(pipeline: Pipeline) -> list[str]:
    """Return the lines of ``i1 run(ptr parameters, ptr x0, ..., ptr y0, ...)``, which computes one item.

    It reads an item's inputs before it writes its outputs, and returns true. Outputs are NaN where an input is not
    finite.

    Parameters
    ----------
    pipeline
        The program.
    """
    inputs = [f"%x{k}" for k in range(len(pipeline.inputs) - 1)]
    outputs = [f"%y{k}" for k in range(len(pipeline.results))]
    pointers = ", ".join(f"ptr {name}" for name in ("%parameters", *inputs, *outputs))
    body = Body(FUSING, width=1)
    missing = _copied_inputs(pipeline, body)
    return [
        *Body(width=1).declarations(),
        *Body().declarations(),
        *chain.from_iterable(_function(pipeline, k) for k in range(len(pipeline.steps))),
        f"define internal i1 @run({pointers}) {{",
        "begin:",
        *(
            f"  {_buffer(name)} = alloca [{size * _padded(items)} x double], align 64"
            for name, (items, size) in pipeline.sizes.items()
        ),
        *body.lines,
        "  br label %step0",
        *chain.from_iterable(_called(pipeline, k) for k in range(len(pipeline.steps))),
        f"step{len(pipeline.steps)}:",
        *chain.from_iterable(
            _copied_output(f"%y{k}", name, *pipeline.sizes[name], missing)
            for k, name in enumerate(pipeline.results)
        ),
        "  ret i1 true",
        "}",
    ]


def _buffer(name: str) -> str:
    """Return the name of the memory of an input or of a step's output."""
    return f"%of_{name}"


def _padded(items: int) -> int:
    """Return a number of items, filled up to whole vectors where there are several."""
    return 1 if items == 1 else -(-items // WIDTH) * WIDTH


def _copied_inputs(pipeline: Pipeline, body: Body) -> Vector:
    """Copy the inputs into their memory; return 0, or NaN where an entry is not finite."""
    missing = Vector(body, body.constant(0.0))
    for k, variable in enumerate(pipeline.inputs[1:]):
        for entry in range(variable.size):
            source = body.define(f"getelementptr double, ptr %x{k}, i64 {entry}")
            value = Vector(body, body.define(f"load double, ptr {source}"))
            place = body.define(f"getelementptr double, ptr {_buffer(variable.name)}, i64 {entry}")
            body.lines.append(f"  store double {value.name}, ptr {place}")
            missing = missing + (value - value)
    return missing


def _copied_output(
    pointer: str, name: str, items: int, size: int, missing: Vector
) -> Iterator[str]:
    """Yield the lines that write a step's output item by item."""
    for item in range(items):
        for entry in range(size):
            value = f"{pointer}_{item}_{entry}"
            source = entry * _padded(items) + item
            place = item * size + entry
            yield f"  {value}_at = getelementptr double, ptr {_buffer(name)}, i64 {source}"
            yield f"  {value} = load double, ptr {value}_at"
            yield f"  {value}_sum = fadd double {value}, {missing.name}"
            yield f"  {value}_to = getelementptr double, ptr {pointer}, i64 {place}"
            yield f"  store double {value}_sum, ptr {value}_to, align 1"


def _called(pipeline: Pipeline, k: int) -> Iterator[str]:
    """Yield the lines that run a step, from the label ``stepK`` to a jump to the next one."""
    step = pipeline.steps[k]
    sources = [pipeline.source(step, one.name)[0] for one in step.graph.inputs[1:]]
    buffers = [_buffer(step.skips)] if step.skips else []
    buffers += [_buffer(name) for name in sources if name != INDEX]
    buffers += [_buffer(one.name) for one in step.outputs]
    pointers = ", ".join(f"ptr {name}" for name in ("%parameters", *buffers))
    yield f"step{k}:"
    if step.most == 1:
        yield f"  %still{k} = call i1 @step{k}({pointers})"
        yield f"  br label %step{k + 1}"
        return
    before = f"step{k}"
    yield f"  br label %again{k}"
    yield f"again{k}:"
    yield f"  %times{k} = phi i64 [0, %{before}], [%times{k}_after, %again{k}]"
    yield f"  %still{k} = call i1 @step{k}({pointers})"
    yield f"  %times{k}_after = add i64 %times{k}, 1"
    yield f"  %may{k} = icmp slt i64 %times{k}_after, {step.most}"
    yield f"  %on{k} = and i1 %still{k}, %may{k}"
    yield f"  br i1 %on{k}, label %again{k}, label %step{k + 1}"


def _function(pipeline: Pipeline, k: int) -> list[str]:
    """Return the lines of a step as ``i1 stepK(ptr parameters, [ptr skips,] ptr inputs ..., ptr outputs ...)``.

    It returns whether an item goes on.
    """
    step = pipeline.steps[k]
    names = [f"%in{j}" for j in range(len(step.graph.inputs) - 1)]
    sources = [pipeline.source(step, one.name) for one in step.graph.inputs[1:]]
    read = [name for name, (source, _) in zip(names, sources, strict=True) if source != INDEX]
    written = [f"%out{j}" for j in range(len(step.outputs))]
    skips = ["%skips"] if step.skips else []
    pointers = ", ".join(f"ptr {name}" for name in ("%parameters", *skips, *read, *written))

    body = Body(FUSING, width=1 if step.items == 1 else WIDTH)
    skipped = _skipped(body, step, written) if step.skips else None
    # What all items share is loaded where it is used. Only what the step writes anew is loaded before the first item.
    before: list[str] = []
    changed = {one.name for one in step.outputs}
    parameters = range(step.graph.inputs[0].size)
    inputs = [_for_all(body, body.lines, "%parameters", parameters)]
    for name, variable, (source, is_shared) in zip(
        names, step.graph.inputs[1:], sources, strict=True
    ):
        if source == INDEX:
            inputs.append([_index(body)])
        elif is_shared:
            items, size = pipeline.sizes[source]
            places = [e * _padded(items) + i for e in range(size) for i in range(items)]
            lines = before if source in changed else body.lines
            inputs.append(_for_all(body, lines, name, places))
        else:
            items, _ = pipeline.sizes[source]
            if items != step.items and step.items != _padded(step.items):
                raise ValueError(f"{step.graph.name}: {source} does not fill whole vectors")
            inputs.append([_loaded(body, name, step, entry) for entry in range(variable.size)])
    results = plain_results(step.graph, body, inputs)
    if skipped is not None:
        results = [[select(skipped, 0.0, value) for value in entries] for entries in results]
    if step.places:
        _store_at_places(body, step, written, results)
    else:
        _store_in_order(body, step, written, results)
    still = _any(body, step, results[-1][0]) if step.most > 1 else "false"
    return [
        f"define internal i1 @step{k}({pointers}) noinline {{",
        "entry:",
        *before,
        "  br label %compute",
        "compute:",
        "  %item = phi i64 [0, %entry], [%next, %computed]",
        "  %still = phi i1 [false, %entry], [%still_after, %computed]",
        *body.lines,
        "  br label %computed",
        "computed:",
        f"  %still_after = or i1 %still, {still}",
        f"  %next = add i64 %item, {body.width}",
        f"  %more = icmp slt i64 %next, {step.items}",
        "  br i1 %more, label %compute, label %end",
        "end:",
        "  ret i1 %still_after",
        "}",
    ]


def _skipped(body: Body, step: PipelineStep, written: Sequence[str]) -> Mask:
    """Return which of the current items are skipped; write 0 and go on with the next ones if all are."""
    skipped = _loaded(body, "%skips", step, 0).differs(0.0)
    bits = body.define(f"bitcast {body.truth_type} {skipped.name} to i{body.width}")
    are_all = body.define(f"icmp eq i{body.width} {bits}, -1")
    body.lines += [f"  br i1 {are_all}, label %skip, label %solve", "skip:"]
    zero = Vector(body, body.constant(0.0))
    _store_in_order(body, step, written, [[zero] * one.size for one in step.outputs])
    body.lines += ["  br label %computed", "solve:"]
    return skipped


def _store_in_order(
    body: Body, step: PipelineStep, written: Sequence[str], results: Sequence[Sequence[Vector]]
) -> None:
    """Write the current items' outputs next to each other."""
    for name, entries in zip(written, results, strict=False):
        for entry, value in enumerate(entries):
            place = _place(body, name, step, entry)
            body.lines.append(f"  store {body.number_type} {value.name}, ptr {place}, align 8")


def _store_at_places(
    body: Body, step: PipelineStep, written: Sequence[str], results: Sequence[Sequence[Vector]]
) -> None:
    """Write the current items' outputs one by one where ``places`` says."""
    names = [one.name for one in step.outputs]
    (places,) = results[names.index(step.places)]
    if step.items % body.width:
        # Those that fill up the last vector keep their places.
        own = _index(body)
        places = select(own < float(step.items), places, own)
    single = Body(body.liberties, 1, body.lines)
    for lane in range(body.width):
        place = body.define(f"fptosi double {places.lane(single, lane).name} to i64")
        for pointer, entries in zip(written, results, strict=False):
            for entry, value in enumerate(entries):
                one = value.lane(single, lane)
                start = body.define(
                    f"getelementptr double, ptr {pointer}, i64 {entry * _padded(step.items)}"
                )
                address = body.define(f"getelementptr double, ptr {start}, i64 {place}")
                body.lines.append(f"  store double {one.name}, ptr {address}, align 8")


def _for_all(body: Body, lines: list[str], pointer: str, places: Sequence[int]) -> list[Vector]:
    """Return numbers that all items share; the lines that load them go into ``lines``."""
    numbers = []
    for place in places:
        name = f"{pointer}_{place}"
        lines += [
            f"  {name}_at = getelementptr double, ptr {pointer}, i64 {place}",
            f"  {name} = load double, ptr {name}_at",
        ]
        if body.width > 1:
            kind = body.number_type
            lines += [
                f"  {name}_lane = insertelement {kind} poison, double {name}, i64 0",
                f"  {name}_all = shufflevector {kind} {name}_lane, {kind} poison, "
                f"<{body.width} x i32> zeroinitializer",
            ]
            name = f"{name}_all"
        numbers.append(Vector(body, name))
    return numbers


def _place(body: Body, pointer: str, step: PipelineStep, entry: int) -> str:
    """Return the address of an entry of the current items."""
    start = body.define(f"getelementptr double, ptr {pointer}, i64 {entry * _padded(step.items)}")
    return body.define(f"getelementptr double, ptr {start}, i64 %item")


def _loaded(body: Body, pointer: str, step: PipelineStep, entry: int) -> Vector:
    place = _place(body, pointer, step, entry)
    return Vector(body, body.define(f"load {body.number_type}, ptr {place}, align 8"))


def _index(body: Body) -> Vector:
    """Return the numbers of the current items."""
    single = Body(body.liberties, 1, body.lines)
    first = Vector(single, body.define("sitofp i64 %item to double"))
    if body.width == 1:
        return Vector(body, first.name)
    return spread(body, first) + Vector(body, body.constants(range(body.width)))


def _any(body: Body, step: PipelineStep, goes_on: Vector) -> str:
    """Return the name of whether one of the current items goes on."""
    still = goes_on.differs(0.0)
    if body.width == 1:
        return still.name
    if step.items % body.width:
        still = still & (_index(body) < float(step.items))
    bits = body.define(f"bitcast {body.truth_type} {still.name} to i{body.width}")
    return body.define(f"icmp ne i{body.width} {bits}, 0")
