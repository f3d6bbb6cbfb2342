"""A locked arm moves and weighs as the whole one does with those joints held."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from acceptance import different_robots_first, sample_size
from dhkit.description import (
    from_dh,
    from_toml,
    library_robot,
    lock,
    pose,
    robots,
    to_toml,
    with_parameters,
    with_payload,
    with_tool,
    with_uniform_links,
    world_to_frames,
    world_to_tool,
)
from dhkit.description.frames import carrying
from dhkit.errors import DescriptionError
from dhkit.expressions import exact
from dhkit.model import pinocchio_model
from random_arms import arms, states

AGREES = 1e-12
held_values = st.one_of(
    st.sampled_from(["0", "pi/2", "-pi/2", "pi", "0.5", "pi/6"]),
    st.floats(-3, 3, allow_subnormal=False),
)


def reduced_model(arm, held):
    """Pinocchio's own reduction; the drives of what is held stand still, so their armature must go."""
    model = pinocchio_model(arm)
    q = np.zeros(arm.n)
    for place, value in held.items():
        q[place] = float(arm_value(arm, value))
    ids = [model.getJointId(arm.joints[place].name) for place in held]
    return pin.buildReducedModel(model, ids, q), q


def arm_value(arm, value):
    from dhkit.description.table_rows import quantity

    return quantity("held", value, arm.parameters)


def disagreement(arm, held, count=5):
    """Worst errors of frames, mass matrix and gravity torque against Pinocchio's reduced model, each over its scale."""
    ours = lock(arm, held)
    reference, full = reduced_model(arm, held)
    model = pinocchio_model(ours)
    kept = [i for i in range(arm.n) if i not in held]
    data, reference_data = model.createData(), reference.createData()
    reach = max(1.0, arm.reach)
    worst = dict.fromkeys(("tool", "mass matrix", "gravity torque"), 0.0)
    for q in states(ours, count):
        full[kept] = q
        errors = {"tool": np.abs(world_to_tool(ours, q) - world_to_tool(arm, full)).max() / reach}
        M, M_reference = (
            np.array(pin.crba(m, d, q, pin.Convention.WORLD))
            for m, d in ((model, data), (reference, reference_data))
        )
        errors["mass matrix"] = (
            np.abs(np.triu(M) - np.triu(M_reference)).max() / np.abs(M_reference).max()
        )
        weight = np.nansum(arm.numbers.mass) * np.linalg.norm(arm.numbers.gravity) * reach
        g = [
            pin.computeGeneralizedGravity(m, d, q).copy()
            for m, d in ((model, data), (reference, reference_data))
        ]
        errors["gravity torque"] = np.abs(g[0] - g[1]).max() / max(weight, 1e-3)
        for key, error in errors.items():
            worst[key] = max(worst[key], error)
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_library_robots_with_some_joints_held(name, law):
    arm = library_robot(name)
    rng = np.random.default_rng(7)
    for _ in range(law.samples(100)):
        count = rng.integers(1, arm.n)
        held = {
            int(place): float(rng.choice([0, 0.3, -1.1, np.pi / 2, np.pi]))
            for place in rng.choice(arm.n, count, False)
        }
        for key, error in disagreement(arm, held, 2).items():
            law.holds(key, error, AGREES, (name, held))


@pytest.mark.slow
@given(arms(least=2, most=6), st.data())
def test_any_arm_with_some_joints_held(law, arm, data):
    law.samples(1000)
    places = data.draw(st.sets(st.integers(0, arm.n - 1), min_size=1, max_size=arm.n - 1))
    held = {place: data.draw(held_values) for place in places}
    try:
        lock(arm, held)
    except DescriptionError as error:
        pytest.fail(f"{held}: {error}")
    if near_parallel(arm, held):
        return  # a table cannot say two axes 1e-9 apart better than to 1e-7: see the test below
    for key, error in disagreement(arm, held).items():
        law.holds(key, error, AGREES, held)


def near_parallel(arm, held) -> bool:
    """Whether neighbouring axes of the shorter table nearly point along each other, joints held where they are.

    Below 1e-10 the table takes them for parallel, which misses by as much times the lever.
    """
    q = np.zeros(arm.n)
    for place, value in held.items():
        q[place] = float(arm_value(arm, value))
    z = [T[:3, 2] for T in carrying(arm.convention, list(world_to_frames(arm, q)))]
    moving = [z[i] for i in range(arm.n) if i not in held]
    tilts = [np.linalg.norm(np.cross(a, b)) for a, b in pairwise(moving)]
    return any(1e-15 < tilt < 1e-3 for tilt in (*tilts, *np.abs(arm.numbers.sin_alpha)))


def test_axes_that_are_nearly_parallel_cost_what_a_table_must_cost():
    """A tilt of 1e-6 puts the common normal 4e5 m away: 17 digits of that leave 1e-10 m."""
    arm = from_dh([(0, 0.1, 0.4, 0), (0, 0.2, 0.3, 1e-6), (0, 0.1, 0.2, 0.3)])
    ours = lock(arm, {1: "0.7"})
    q = states(ours, 50)
    full = np.insert(q, 1, 0.7, axis=1)
    assert np.abs(world_to_tool(ours, q) - world_to_tool(arm, full)).max() < 1e-9


def test_joints_at_the_base_are_held_without_a_common_normal():
    """Axes 1 and 3 are 6e-10 from parallel, but axis 1 goes into the base."""
    arm = from_dh([(0, 0.1, 0.4, "pi/2"), (0, 0.2, 0.3, 1.5707963262), (0, 0.1, 0.2, 0.3)])
    ours = lock(arm, {0: "0", 1: "0"})
    q = states(ours, 50)
    full = np.concatenate([np.zeros((50, 2)), q], axis=1)
    assert np.abs(world_to_tool(ours, q) - world_to_tool(arm, full)).max() < AGREES


def test_right_angles_and_numbers_stay_exact():
    arm = lock(library_robot("puma560"), {3: 0, 4: 0, 5: 0})
    assert arm.joints[2].d == exact(0.15005)
    assert str(arm.tool.placement.xyz[2]) == "0.4318"
    assert [x.half_turns for x in arm.tool.placement.rpy] == [0, 0, 0]
    ours = lock(library_robot("puma560"), {1: "-pi/2"})
    assert ours.joints[0].a == exact(0)
    assert all(
        joint.theta.half_turns is not None and joint.alpha.half_turns is not None
        for joint in ours.joints
    )


@pytest.mark.slow
def test_parameters_stay_parameters():
    arm = lock(library_robot("planar3r"), {1: 0})
    assert arm.joints[0].a.text == "l1 + l2"
    assert arm.joints[0].body.mass.text == "m1 + m2"
    longer = lock(library_robot("planar3r"), {1: "pi/3"})
    q = states(longer, 10)
    full = np.insert(q, 1, np.pi / 3, axis=1)
    assert (
        np.abs(world_to_tool(longer, q) - world_to_tool(library_robot("planar3r"), full)).max()
        < AGREES
    )


def test_names_and_places_mean_the_same():
    arm = library_robot("puma560")
    assert lock(arm, {"elbow": 0.5}) == lock(arm, {2: 0.5})
    assert lock(arm, {2: 0.5}).configurations["ready"] == tuple(
        q for i, q in enumerate(arm.configurations["ready"]) if i != 2
    )
    assert lock(arm, {}) == arm


@pytest.mark.parametrize(
    ("joints", "complaint"),
    [
        ({6: 0}, "no joint 6"),
        ({-1: 0}, "no joint -1"),
        ({"knee": 0}, "no joint 'knee'"),
        ({2: np.nan}, "not finite"),
        ({2: 0, "elbow": 0}, "given twice"),
        (dict.fromkeys(range(6), 0), "all 6 joints locked"),
        ({2: "x"}, "unknown name"),
    ],
)
def test_what_cannot_be_locked_is_said(joints, complaint):
    with pytest.raises(DescriptionError, match=complaint):
        lock(library_robot("puma560"), joints)


def test_shapes_move_with_their_links():
    arm = library_robot("puma560")
    held = {0: 0.3, 4: -0.8, 5: 1.0}
    ours = lock(arm, held)
    assert sum(len(joint.shapes) for joint in ours.joints) + len(ours.base.shapes) == 7
    from dhkit.model import link_parts

    q = states(ours, 1)[0]
    full = np.array([0.3, *q, -0.8, 1.0])
    where = {}
    for which, state in ((arm, full), (ours, q)):
        T = world_to_frames(which, state)
        where[which.n] = {
            part.file.name: T[part.link] @ part.T_link_part
            for part in link_parts(which)
            if part.file
        }
    for name, T in where[6].items():
        assert np.abs(where[3][name] - T).max() < AGREES


@given(arms(), st.floats(0.1, 10), st.integers(0, 1000))
def test_a_payload_weighs_on_the_arm_as_pinocchio_says(law, arm, mass, seed):
    law.samples(1000)
    rng = np.random.default_rng(seed)
    com, points = rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.1, 0.1, (4, 3))
    tensor = sum(
        mass / 4 * (p @ p * np.eye(3) - np.outer(p, p)) for p in points - points.mean(axis=0)
    )
    tensor = (tensor + tensor.T) / 2
    loaded = pinocchio_model(with_payload(arm, mass, com, tensor))
    reference = pinocchio_model(arm)
    tool = reference.frames[reference.getFrameId("tool")]
    reference.appendBodyToJoint(tool.parentJoint, pin.Inertia(mass, com, tensor), tool.placement)
    reach = max(1.0, arm.reach)
    for q in states(arm, 3):
        M, M_reference = (
            np.triu(pin.crba(m, m.createData(), q, pin.Convention.WORLD))
            for m in (loaded, reference)
        )
        law.holds("mass matrix", np.abs(M - M_reference).max() / np.abs(M_reference).max(), AGREES)
        g, g_reference = (
            pin.computeGeneralizedGravity(m, m.createData(), q) for m in (loaded, reference)
        )
        weight = (np.nansum(arm.numbers.mass) + mass) * 9.81 * reach
        law.holds("gravity torque", np.abs(g - g_reference).max() / weight, AGREES)


def test_a_payload_may_be_a_parameter_and_needs_a_body_to_join():
    planar = library_robot("planar2r")
    loaded = with_payload(planar, "m1/2", (0.1, 0, 0))
    assert loaded.joints[1].body.mass.symbols == {"m1", "m2"}
    assert "/(m1" in loaded.joints[1].body.com[0].text
    bare = from_dh([(0, 0, 1, 0)])
    with pytest.raises(DescriptionError, match="has no body to join"):
        with_payload(bare, 1.0)
    assert with_payload(with_uniform_links(bare), 1.0).numbers.mass[0] == 2.0
    for bad, complaint in (
        ((-1.0,), "-1 kg"),
        ((np.nan,), "not finite"),
        ((1.0, (0, 0, np.inf)), "not finite"),
    ):
        with pytest.raises(DescriptionError, match=complaint):
            with_payload(planar, *bad)
    with pytest.raises(DescriptionError, match="eigenvalue"):
        with_payload(planar, 1.0, inertia=np.diag([-1.0, 1, 1]))


def test_a_payload_hangs_on_the_tool():
    arm = with_tool(library_robot("puma560"), pose((0, 0, 0.2), euler=(90, 0, 0), degrees=True))
    body = with_payload(arm, 1.0, (0.1, 0, 0.3)).joints[-1].body
    # The tool's z points along frame 6's -y.
    lone = np.array([0.1, -0.3, 0.2])
    expected = (0.09 * np.array([0, 0, 0.032]) + lone) / 1.09
    assert np.abs(np.array([float(x) for x in body.com]) - expected).max() < 1e-15


@st.composite
def symbolic_arms(draw):
    """Draw a table with parameters in any place, and uniform links."""
    rows = draw(
        st.lists(
            st.tuples(
                st.sampled_from(["0", "th", "0.3"]),
                st.sampled_from(["0", "d1", "0.2"]),
                st.sampled_from(["0", "l1", "l2", "0.3"]),
                st.sampled_from(["0", "pi/2", "al", "0.4"]),
            ),
            min_size=2,
            max_size=6,
        )
    )
    kinds = "".join(draw(st.sampled_from("RRP")) for _ in rows)
    parameters = {"th": 0.3, "d1": 0.2, "l1": 0.5, "l2": "l1 - 0.1", "al": 0.6}
    arm = from_dh(
        rows,
        kinds=kinds,
        convention=draw(st.sampled_from(["standard", "modified"])),
        parameters=parameters,
    )
    return with_uniform_links(arm)


@pytest.mark.slow
@settings(max_examples=sample_size(200))
@given(symbolic_arms(), st.data())
def test_a_locked_arm_of_symbols_can_be_written_and_its_parameters_changed(law, arm, data):
    """What parameters a locked arm still has may be changed, before or after: the same arm. The others are refused."""
    law.samples(200)
    places = data.draw(st.sets(st.integers(0, arm.n - 1), min_size=1, max_size=arm.n - 1))
    held = {place: data.draw(st.sampled_from(["0", "pi/2", "0.3", "th"])) for place in places}
    ours = lock(arm, held)
    assert from_toml(to_toml(ours)) == ours
    q = states(ours, 3)
    for name, value in {"th": -0.4, "d1": -0.1, "l1": 0.05, "al": -0.6, "m1": 3.0}.items():
        if name not in ours.parameters:
            with pytest.raises(DescriptionError, match="has no parameter"):
                with_parameters(ours, **{name: value})
            continue
        changed = with_parameters(ours, **{name: value})
        other = lock(with_parameters(arm, **{name: value}), held)
        law.holds(
            "tool",
            np.abs(world_to_tool(changed, q) - world_to_tool(other, q)).max(),
            AGREES,
            (held, name),
        )
        law.holds(
            "masses", np.abs(changed.numbers.mass - other.numbers.mass).max(), AGREES, (held, name)
        )
