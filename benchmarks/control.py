"""Simulation beside loops over Pinocchio and roboticstoolbox (`make bench`): benchmarks/results/control.md, .json.

One arm, many arms, and accuracy beside time. Takes about three minutes; ``--single 1 --arms 1000 --repeats 3`` for a
look.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.command import publish, tell
from benchmarks.peers.aba_loop import AbaLoop, default_swing
from benchmarks.peers.fdyn import Fdyn, own_puma_accelerations
from benchmarks.simulation_report import (
    BatchRow,
    IntegrationRow,
    ModelCheck,
    SimulationReport,
    SingleRow,
    Timing,
)
from dhkit.arm import Arm
from dhkit.bench.benchmark_report import Missing, Requirement
from dhkit.bench.contenders import Call, UnavailableError
from dhkit.bench.machine import Machine
from dhkit.bench.rounds import calm, lasting, repeated, rounds
from dhkit.control import ComputedTorque, PDGravity, SimulationResult, Sine
from dhkit.description import Array
from dhkit.dynamics import kinetic_energy, potential_energy
from dhkit.verification import random_motions

RESULT = Path(__file__).parent / "results" / "control"
RATE = 1000.0
"""Calls of the sampled controllers, and steps of their plants, per second, Hz."""
MAX_SECONDS = 1.5
"""Longest time of simulating 10 s of one PUMA under computed torque, s."""
MIN_RATIO = 200.0
"""Smallest time of an arm in a loop over pin.aba, over that in dhkit's batch."""
MAX_DIFFERENCE = 1e-9
"""Largest difference of the loop's last states from the batch's, rad and rad/s: both add up the same steps, and differ
by rounding."""
LOOP_ARMS = 4
"""Arms that the peer's loop moves, one after another."""
FINE_STEPS = 8
"""Steps in a period of the run that shows the integration error: with order 4, its own error is 4096 times smaller."""
SPARSE_RATE = 20.0
"""Rows per second of a continuous run of which little more than the end is needed, Hz."""
EXACT_TOLERANCE = 1e-13
"""Tolerance of the runs that errors are measured against."""
TIGHT_OPTIONS = {"rtol": 1e-10, "atol": 1e-12}
"""Tolerances with which fdyn is about as exact as DOP853 is by default."""
SWING_RATES = (1000.0, 2000.0, 4000.0)
SPREAD = 0.5
"""Farthest that the arms of the batch begin from their target, rad."""
BANDWIDTH = 3.0
"""Bandwidth of the batch's controller, rad/s: after 1 s its arms still move; at rest all last states would agree."""
OFFSET = 0.05
"""Distance of the continuously controlled arm from its reference at the beginning, rad."""
STATES = 50
"""Random states at which a peer's accelerations are checked."""

Progress = Callable[[str], None]
States = tuple[Array, Array]
"""Joint values and rates of a run, shape (N, n) each."""


@dataclass(frozen=True)
class SimulationSizes:
    """The sizes of the simulations."""

    single: float = 10.0
    """Time of one arm under a sampled controller, s."""
    arms: int = 10_000
    batch: float = 1.0
    """Time of each arm of the batch, s."""
    swing: float = 5.0
    """Time of the passive swing, s."""
    controlled: float = 0.5
    """Time under a continuous controller, s."""
    repeats: int = 5
    """Number of rounds."""


@dataclass
class _Measurements:
    """The measurements so far."""

    single: list[SingleRow] = field(default_factory=list)
    batch: list[BatchRow] = field(default_factory=list)
    integration: list[IntegrationRow] = field(default_factory=list)
    models: list[ModelCheck] = field(default_factory=list)
    missing: list[Missing] = field(default_factory=list)


def compare_simulations(
    arm: Arm,
    sizes: SimulationSizes | None = None,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> SimulationReport:
    """Time simulation beside peers, in one process, contenders in turns.

    Parameters
    ----------
    arm
        The robot, with bodies.
    sizes
        Sizes of the simulations; by default those of the requirements.
    seed
        Seed of the states at the beginning.
    progress
        Called with a line before each step.

    Returns
    -------
    SimulationReport
        The measurements; after Ctrl-C those until then.
    """
    tell = progress or (lambda line: None)
    sizes = sizes or SimulationSizes()
    measurements, interrupted = _Measurements(), False
    try:
        with calm():
            tell("compiling")
            arm.compile()
            tell("one arm")
            measurements.single.append(_single(arm, sizes))
            tell(f"{sizes.arms} arms")
            _many(arm, sizes, seed, measurements)
            tell("models")
            _check_models(arm, measurements)
            tell("a passive swing")
            _swing(arm, sizes, seed, measurements)
            tell("a continuous controller")
            _controlled(arm, sizes, measurements)
    except KeyboardInterrupt:
        interrupted = True
    return SimulationReport(
        robot=arm.name,
        seed=seed,
        repeats=sizes.repeats,
        **{name: tuple(values) for name, values in vars(measurements).items()},
        requirements=tuple(_requirements(arm.name, sizes, measurements)),
        machine=Machine.here(),
        interrupted=interrupted,
    )


def _seconds(calls: Sequence[Call], repeats: int) -> Array:
    """Return the times of the calls, shape (rounds, len(calls)), s."""
    times = [lasting(call) for call in calls]
    repeating = [repeated(call, count) for call, count in zip(calls, times, strict=True)]
    return np.array(list(rounds(repeating, repeats))) / times


def _timing(seconds: Array) -> Timing:
    """Return median and quartiles of times over the rounds, shape (rounds,), s."""
    lower, middle, upper = np.quantile(seconds, [0.25, 0.5, 0.75]).tolist()
    return Timing(middle, lower, upper)


def _middle(arm: Arm) -> Array:
    """Return the middle of the joint limits, shape (n,), rad and m; 0 for joints without limits."""
    numbers = arm.description.numbers
    with np.errstate(invalid="ignore"):
        middle = (numbers.lower + numbers.upper) / 2
    return np.where(np.isfinite(middle), middle, 0.0)


def _wave(arm: Arm) -> Sine:
    """Return a reference that moves all joints by half a radian or metre to both sides."""
    return Sine(_middle(arm), np.full(arm.n, 0.5), 0.5)


def _difference(states: States, others: States) -> tuple[float, float]:
    """Return the largest differences of the last joint values and of the last rates."""
    q, qd = (float(np.abs(x[-1] - y[-1]).max()) for x, y in zip(states, others, strict=True))
    return q, qd


def _states(result: SimulationResult) -> States:
    return result.q, result.qd


def _single(arm: Arm, sizes: SimulationSizes) -> SingleRow:
    """Time one arm under computed torque, as a user calls it."""
    run = partial(arm.simulate, ComputedTorque.tuned(arm), _wave(arm), sizes.single, rate=RATE)
    result = run()
    timing = _timing(_seconds([run], sizes.repeats)[:, 0])
    return SingleRow(
        controller="computed torque",
        simulated=sizes.single,
        steps=len(result.t) - 1,
        timing=timing,
        joint_error=float(result.peak_error.max()),
        integration_error=max(
            _difference(_states(result), _states(run(plant_rate=FINE_STEPS * RATE)))
        ),
        audit=result.audit.error,
    )


def _many(arm: Arm, sizes: SimulationSizes, seed: int, measurements: _Measurements) -> None:
    """Time batches of arms that come to rest at a configuration, beside a loop over pin.aba that moves a few arms."""
    target, controller = _middle(arm), PDGravity.tuned(arm, BANDWIDTH)
    start = target + np.random.default_rng(seed).uniform(-SPREAD, SPREAD, (sizes.arms, arm.n))
    few = min(LOOP_ARMS, sizes.arms)

    def batch(keep: str, threads: int) -> Call:
        return partial(
            arm.simulate_batch,
            controller,
            target,
            sizes.batch,
            start,
            rate=RATE,
            keep=keep,
            threads=threads,
        )

    result = arm.simulate_batch(controller, target, sizes.batch, start, rate=RATE, keep="final")
    steps = len(result.t) - 1
    calls: dict[str, tuple[Call, int]] = {
        f'dhkit, keep="{keep}", {threads} thread{"s"[: threads - 1]}': (
            batch(keep, threads),
            sizes.arms,
        )
        for keep in ("final", "errors")
        for threads in (1, 2)
    }
    differences: dict[str, float] = {}
    try:
        loop = AbaLoop(arm.description, controller, target, 1 / RATE)
        name = "loop over pin.aba"
        ends = np.array([loop(q0, steps) for q0 in start[:few]])
        differences[name] = float(np.abs(ends - np.hstack([result.q[:few], result.qd[:few]])).max())
        calls[name] = (lambda: [loop(q0, steps) for q0 in start[:few]]), few
    except UnavailableError as error:
        measurements.missing.append(Missing("batch", "pin.aba", str(error)))
    counts = np.array([count * steps for _, count in calls.values()])
    each = _seconds([call for call, _ in calls.values()], sizes.repeats) / counts
    measurements.batch += [
        BatchRow(
            contender=name,
            arms=count,
            each=_timing(each[:, k]),
            ratio=float(np.median(each[:, k] / each[:, 0])),
            difference=differences.get(name),
        )
        for k, (name, (_, count)) in enumerate(calls.items())
    ]


def _check_models(arm: Arm, measurements: _Measurements) -> None:
    """Compare accelerations with those of the toolbox's robot of our table, and of its own PUMA."""
    motion = random_motions(arm.description, STATES)
    q, qd, tau = motion.q, motion.qd, arm.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    ours = arm.forward_dynamics(q, qd, tau)

    def compare(model: str, accelerations: Array) -> None:
        difference = float(np.abs(accelerations - ours).max() / np.abs(ours).max())
        measurements.models.append(ModelCheck(model, difference))

    try:
        compare(
            "roboticstoolbox, DHRobot of dhkit's table",
            Fdyn(arm.description).accelerations(q, qd, tau),
        )
        if arm.name == "puma560":
            compare(
                "roboticstoolbox, its own Puma560 without friction",
                own_puma_accelerations(q, qd, tau),
            )
    except UnavailableError as error:
        measurements.missing.append(Missing("models", "roboticstoolbox", str(error)))


def _swing(arm: Arm, sizes: SimulationSizes, seed: int, measurements: _Measurements) -> None:
    """Compare the swing of an arm that is let go at rest, without stops."""
    start = np.random.default_rng(seed + 1).normal(size=arm.n) * 0.3
    run = partial(arm.simulate, q0=start, duration=sizes.swing, restitution=None)

    def drift(states: States) -> float:
        kinetic = kinetic_energy(arm.description, *states)
        energy = kinetic + potential_energy(arm.description, states[0])
        return float(np.abs(energy - energy[0]).max() / kinetic.max())

    def sampled(rate: float) -> States:
        return _states(run(rate=rate))

    contenders: dict[str, Callable[[], States]] = {
        f"dhkit, RK4 at {rate / 1000:g} kHz": partial(sampled, rate) for rate in SWING_RATES
    }
    contenders |= _continuous(run)
    problem = f"Passive swing, {sizes.swing:g} s"
    for name, peer in (
        (
            "solve_ivp over pin.aba, RK45, its defaults",
            lambda: partial(default_swing, arm.description),
        ),
        ("roboticstoolbox fdyn, RK45, its defaults", lambda: Fdyn(arm.description).swing),
        (
            f"roboticstoolbox fdyn, RK45, rtol {TIGHT_OPTIONS['rtol']:g}",
            lambda: Fdyn(arm.description, TIGHT_OPTIONS).swing,
        ),
    ):
        try:
            contenders[name] = partial(peer(), start, sizes.swing)
        except UnavailableError as error:
            measurements.missing.append(Missing(problem, name, str(error)))
    exact = _states(run(rate=None, plant_rate=SPARSE_RATE, tolerance=EXACT_TOLERANCE))
    measurements.integration += _integrations(
        problem, contenders, exact, sizes.swing, sizes.repeats, drift
    )


def _controlled(arm: Arm, sizes: SimulationSizes, measurements: _Measurements) -> None:
    """Compare an arm that begins away from its reference and follows it under computed torque in continuous time."""
    wave, controller = _wave(arm), ComputedTorque.tuned(arm)
    q0, qd0 = (rows[0] for rows in wave.sampled(np.zeros(1))[:2])
    q0 = q0 + OFFSET
    run = partial(
        arm.simulate,
        controller,
        wave,
        sizes.controlled,
        q0=q0,
        qd0=qd0,
        restitution=None,
        saturation=False,
    )
    contenders = dict(_continuous(run))
    contenders["dhkit, RK4 at 1 kHz, torques held"] = lambda: _states(run(rate=RATE))
    problem = f"Computed torque in continuous time, {sizes.controlled:g} s"
    for name, options in (("its defaults", {}), (f"rtol {TIGHT_OPTIONS['rtol']:g}", TIGHT_OPTIONS)):
        full = f"roboticstoolbox fdyn, RK45, {name}"
        try:
            controlled = Fdyn(arm.description, options).controlled
            contenders[full] = partial(controlled, controller, wave, q0, qd0, sizes.controlled)
        except UnavailableError as error:
            measurements.missing.append(Missing(problem, full, str(error)))
    exact = _states(run(rate=None, plant_rate=SPARSE_RATE, tolerance=EXACT_TOLERANCE))
    measurements.integration += _integrations(
        problem, contenders, exact, sizes.controlled, sizes.repeats
    )


def _continuous(run: Callable[..., SimulationResult]) -> Mapping[str, Callable[[], States]]:
    """Return runs by DOP853, by name: with as many rows as by default, and with few."""
    return {
        "dhkit, DOP853, 1000 rows a second": lambda: _states(run(rate=None)),
        f"dhkit, DOP853, {SPARSE_RATE:g} rows a second": lambda: _states(
            run(rate=None, plant_rate=SPARSE_RATE)
        ),
    }


def _integrations(
    problem: str,
    contenders: Mapping[str, Callable[[], States]],
    exact: States,
    simulated: float,
    repeats: int,
    drift: Callable[[States], float] | None = None,
) -> Iterator[IntegrationRow]:
    """Yield a row for each contender."""
    seconds = _seconds(list(contenders.values()), repeats)
    for k, (name, contender) in enumerate(contenders.items()):
        states = contender()
        q, qd = _difference(states, exact)
        yield IntegrationRow(
            problem=problem,
            contender=name,
            simulated=simulated,
            timing=_timing(seconds[:, k]),
            joint_error=q,
            rate_error=qd,
            drift=None if drift is None else drift(states),
        )


def _requirements(
    robot: str, sizes: SimulationSizes, measurements: _Measurements
) -> Iterator[Requirement]:
    """Yield the requirements of simulation, beside the measured numbers."""
    full = SimulationSizes()
    conditions = f"puma560, {full.single:g} s, and {full.arms} arms for {full.batch:g} s"
    is_judged = robot == "puma560" and (sizes.single, sizes.arms, sizes.batch) == (
        full.single,
        full.arms,
        full.batch,
    )
    loop = next((row for row in measurements.batch if row.difference is not None), None)
    wall = measurements.single[0].timing.seconds if measurements.single else None
    lines = (
        ("one arm", "s for 10 s under computed torque, RK4 at 1 kHz", MAX_SECONDS, True, wall),
        (
            "many arms",
            "times a loop over pin.aba, one thread",
            MIN_RATIO,
            False,
            loop.ratio if loop else None,
        ),
        (
            "many arms",
            "difference from that loop's last states",
            MAX_DIFFERENCE,
            True,
            loop.difference if loop else None,
        ),
    )
    for quantity, what, required, at_most, measured in lines:
        yield Requirement(
            quantity, what, required, at_most, measured, is_judged, conditions=conditions
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark, write its report and print it."""
    full = SimulationSizes()
    parser = argparse.ArgumentParser(description="Simulation beside peers.")
    parser.add_argument("--robot", default="puma560", help="of the library (default: puma560)")
    parser.add_argument(
        "--single", type=float, default=full.single, help="s of one arm (default: %(default)s)"
    )
    parser.add_argument(
        "--arms", type=int, default=full.arms, help="of the batch (default: %(default)s)"
    )
    parser.add_argument(
        "--repeats", type=int, default=full.repeats, help="rounds (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--output", type=Path, default=RESULT, help="path of the results, without ending"
    )
    chosen = parser.parse_args(arguments)
    report = compare_simulations(
        Arm.load(chosen.robot),
        SimulationSizes(single=chosen.single, arms=chosen.arms, repeats=chosen.repeats),
        seed=chosen.seed,
        progress=tell,
    )
    publish(report, chosen.output)


if __name__ == "__main__":
    main()
