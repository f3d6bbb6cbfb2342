"""Inverse kinematics derived in the exact ring: proved, and held against the kernels and forward kinematics."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings

import dhkit
from acceptance import sample_size
from dhkit.description import (
    from_dh,
    from_toml,
    library_robot,
    pose,
    with_base,
    with_tool,
    world_to_tool,
)
from dhkit.errors import DescriptionError
from dhkit.kinematics import classify, inverse_kinematics
from dhkit.symbolic import inverse_derivation, symbolic_kinematics
from dhkit.symbolic.inverse.forms import FORMS, lemmas
from dhkit.symbolic.inverse.steps import names_in
from dhkit.verification import random_states
from ik_checks import FEW_JOINTS, FIVE_JOINTS, SIX_JOINTS, robot
from random_arms import (
    elbow_arms,
    few_joint_arms,
    five_joint_arms,
    slide_arms,
    three_parallel_arms,
)

CLOSES = 1e-12
"""Of forward kinematics, lengths over the reach, where no sine or root is below NEAR."""
CLOSES_NEAR = 1e-7
NEAR = 1e-3
"""Singularity measure below which textbook formulas lose digits."""
JOINTS = 1e-12
"""rad and shares of ``scale``: difference from the kernels, times the smallest measure of a branch."""
LIBRARY = [*SIX_JOINTS, *FIVE_JOINTS, *FEW_JOINTS]


def scale(arm, T):
    """Return the length that lengths of a solution are compared with, at poses (N, 4, 4): (N,), m.

    The reach counts no travel of slides without limits; the distance of the pose from the base does.
    """
    base = np.array([float(x) for x in arm.base.placement.xyz])
    return (arm.reach or 1.0) + np.linalg.norm(T[:, :3, 3] - base, axis=-1)


def gaps(arm, T, a, b):
    """Return the largest differences of joint values (N, B, n): (N, B), angles the short way, slides over ``scale``."""
    turned = np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)
    away = np.where(arm.numbers.prismatic, np.abs(a - b) / scale(arm, T)[:, None, None], turned)
    return away.max(axis=-1)


def smallest_measures(derivation, T):
    """The smallest sine, or root relative to its terms, of each branch at poses (N, 4, 4): (N, B), NaN for none.

    A step that loses digits hands its error on, and a later one divides it by its own measure again: where the smallest
    is below NEAR, all measures below 0.1 count, as the product of their shares of 0.1.
    """
    reach = scale(derivation.description, T)
    result = np.full((len(T), len(derivation.branches)), np.nan)
    with np.errstate(all="ignore"):
        for values, solved in derivation.candidates(T):
            least, shares = np.ones(len(T)), np.ones(len(T))
            for step in derivation.steps:
                if step.form is None:
                    continue
                letters = {
                    k: np.broadcast_to(values.of(x), len(T)) for k, x in step.form.letters.items()
                }
                kind = type(step.form).__name__
                if kind in ("Circle", "Square", "CosineAndSquare"):
                    measure = np.sqrt(
                        np.maximum(np.broadcast_to(step.form.solve(letters, 1.0)[1], len(T)), 0)
                    )
                elif kind in ("Line", "Flip", "Direction"):
                    size = np.hypot(letters["X"], letters["Y"]) * np.abs(
                        letters.get("k", 1.0) if kind == "Direction" else 1
                    )
                    measure = size / reach if kind == "Line" else size
                elif kind == "Turned" and step.unknown.name != "phi":
                    measure = np.hypot(letters["U"], letters["V"]) / reach
                else:
                    continue
                least, shares = np.minimum(least, measure), shares * np.minimum(measure / 0.1, 1.0)
            least = np.where(least < NEAR, 0.1 * shares, least)
            rows = np.flatnonzero(solved)
            result[rows, derivation._branch_index(values)[rows]] = least[rows]
    return result


def hold(law, arm, derivation, q, where):
    """Hold a derivation to the kernels and to forward kinematics, at the poses of joint values q (N, n)."""
    T = world_to_tool(arm, q)
    kernels, ours = inverse_kinematics(arm, T), derivation.solve(T)
    assert derivation.branches == tuple(kernels.branches), where
    solved = np.isfinite(ours).all(axis=-1)
    least = smallest_measures(derivation, T)
    regular = least > NEAR
    # At a singular pose the last bit decides whether a branch exists.
    assert kernels.valid[regular].all() and not (kernels.valid & ~solved).any(), where
    both = solved & kernels.valid & (least > 1e-9)
    law.holds(
        "joints beside the kernels, times the measure",
        np.max((gaps(arm, T, ours, kernels.q) * least)[both], initial=0),
        JOINTS,
        where,
    )
    if derivation.family.aims:
        return
    for name, rows, required in (
        ("regular", regular, CLOSES),
        ("near singular", ~regular, CLOSES_NEAR),
    ):
        some = np.where((solved & rows)[..., None], ours, np.nan)
        if (solved & rows).any():
            law.holds(
                f"closure, {name}", positions_close(arm, some, T, derivation), required, where
            )


def positions_close(arm, q, T, derivation):
    """The largest error of forward kinematics of joint values (N, B, n); positions over the reach."""
    rows = np.isfinite(q).all(axis=-1)
    reached = world_to_tool(arm, q[rows]) - np.broadcast_to(T[:, None], (*q.shape[:2], 4, 4))[rows]
    scale = (arm.reach or 1.0) + np.abs(T[:, :3, 3]).max()
    error = np.abs(reached[:, :3, 3]).max() / scale
    return max(error, np.abs(reached[:, :3, :3]).max()) if derivation.family.undoes_tool else error


@pytest.mark.parametrize("name", LIBRARY)
def test_every_robot_of_the_library_is_derived_proved_and_held_to_the_kernels(law, name):
    arm = robot(name)
    derivation = inverse_derivation(arm)
    assert derivation.family.name == classify(arm).name
    proof = derivation.prove(law.samples(5000), seed=1)
    assert proof, proof.statement
    assert "proved: " in proof.statement and "sampled: at " in proof.statement
    hold(law, arm, derivation, random_states(arm, law.samples(50_000), seed=2), name)
    assert derivation.solve(np.eye(4)).shape == (len(derivation.branches), arm.n)


def special_states(arm, count, seed):
    """Joint values (N, n) in quarter turns, some of them off by little: wrists, elbows and shoulders are singular."""
    rng = np.random.default_rng(seed)
    quarters = rng.integers(-2, 3, (count, arm.n)) * np.pi / 2
    off = rng.choice([0, 1e-15, 1e-12, 1e-9, 1e-6, 0.3, 1.0], (count, arm.n))
    return (
        np.where(arm.numbers.prismatic, rng.choice([0.1, 0.3, 0.5], (count, arm.n)), quarters) + off
    )


@pytest.mark.parametrize("name", LIBRARY)
def test_solutions_at_singular_poses_reach_them(law, name):
    arm = robot(name)
    derivation = inverse_derivation(arm)
    q = special_states(arm, law.samples(20_000), seed=3)
    T = world_to_tool(arm, q)
    found = derivation.solve(T)
    is_solved = np.isfinite(found).all(axis=-1).any(axis=1)
    if derivation.family.name == "three_parallel":
        # Where axis 6 is parallel to axis 2, theta6 is chosen, and axis 4 may then be out of reach.
        is_solved |= np.abs(np.sin(q[:, 4])) < 2e-6
    assert is_solved.all(), (name, q[~is_solved][:3])
    if not derivation.family.aims:
        law.holds(
            "closure, singular", positions_close(arm, found, T, derivation), CLOSES_NEAR, name
        )


def check_family(law, arm):
    law.samples(200)
    found = classify(arm)
    assume(found.family is not None)
    assume(
        min(float(np.min(found.fit.parameters.get(key, 1.0))) for key in ("L2", "L3", "L"))
        > 1e-3 * arm.reach
    )
    derivation = inverse_derivation(arm)
    assert derivation.family.name == found.name
    for proof in derivation.identities():
        assert proof, proof.statement
    arm = derivation.chain.description  # lengths of at most 1e-12 of the reach are read as 0
    hold(law, arm, derivation, random_states(arm, 50), found.words)


@settings(max_examples=sample_size(1000, quick=8))
@given(arm=elbow_arms())
def test_any_arm_of_the_pumas_family(law, arm):
    check_family(law, arm)


@pytest.mark.slow
@settings(max_examples=sample_size(1000, quick=8))
@given(arm=three_parallel_arms())
def test_any_arm_of_the_urs_family(law, arm):
    check_family(law, arm)


@pytest.mark.slow
@settings(max_examples=sample_size(1000, quick=8))
@given(arm=slide_arms())
def test_any_arm_of_the_stanfords_family(law, arm):
    check_family(law, arm)


@pytest.mark.slow
@settings(max_examples=sample_size(1000, quick=8))
@given(arm=five_joint_arms())
def test_any_arm_of_five_joints(law, arm):
    check_family(law, arm)


@given(arm=few_joint_arms())
def test_any_arm_of_few_joints(law, arm):
    check_family(law, arm)


def test_numbers_near_zero_and_right_angles_are_read_as_the_kernels_read_them(law):
    right, tiny = 1.5707963267949, 1e-15  # 13 digits, and what an import leaves of 0
    rows = [
        (0, 0.6, tiny, -right),
        (0, 0.15, 0.43, 0),
        (0, 0, 0.02, right),
        (0, 0.43, tiny, -right),
    ]
    arm = from_dh([*rows, (0, tiny, 0, right), (0, 0.06, 0, tiny)], name="rounded")
    derivation = inverse_derivation(arm)
    assert derivation.family.name == classify(arm).name
    assert "note: alpha1, -1.5707963267949, is read as -pi/2" in derivation.text()
    assert derivation.prove(100)
    T = world_to_tool(arm, random_states(arm, 1000))
    kernels, ours = inverse_kinematics(arm, T), derivation.solve(T)
    both = kernels.valid & (smallest_measures(derivation, T) > NEAR)
    assert both.mean() > 0.9
    assert np.nanmax(gaps(arm, T, ours, kernels.q)[both]) < 1e-9
    read = derivation.chain.description
    hold(law, read, derivation, random_states(read, 1000), "rounded")
    slide = [
        (0, tiny, 0, -right),
        (0, tiny, 0, -right),
        (1e-250, 0, 0.5, 0),
        (0, 0, 0, right),
        (0, 0, 0, right),
    ]
    arm = from_dh([*slide, (0, 0.1, 0, 0)], kinds="RRPRRR")
    hold(law, arm, inverse_derivation(arm), random_states(arm, 1000), "rounded slide")


def test_the_proof_can_fail():
    derivation = inverse_derivation(library_robot("puma560"))
    T = derivation.chain.tool_pose
    derivation.meanings[derivation.chain.names["px"]] = T[1, 3]  # px is taken for py
    proof = derivation.prove(5)
    assert not proof and "NOT TRUE: theta1" in proof.statement


def test_every_form_has_a_lemma_and_every_lemma_holds():
    assert set(lemmas()) == {form.__name__ for form in FORMS}
    for proof in lemmas().values():
        assert proof, proof.statement


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
def test_a_lemmas_solution_is_what_is_evaluated(form):
    """Random letters of an equation that has a solution: each root solves it, in doubles."""
    rng = np.random.default_rng(0)
    x, z, (a, b, k) = rng.uniform(-3, 3, 500), rng.uniform(-1, 1, 500), rng.uniform(-2, 2, (3, 500))
    c, s = np.cos(x), np.sin(x)
    cases = {
        "Circle": (
            {"A": a, "B": b, "C": a * c + b * s},
            lambda x: [a * np.cos(x) + b * np.sin(x) - (a * c + b * s)],
        ),
        "Line": ({"X": k * c, "Y": k * s}, lambda x: [k * c * np.sin(x) - k * s * np.cos(x)]),
        "Direction": ({"k": k, "X": k * c, "Y": k * s}, lambda x: [np.cos(x) - c, np.sin(x) - s]),
        "Flip": (
            {"k": k, "X": k * c, "Y": k * s},
            lambda x: [np.cos(x) ** 2 - c**2, np.sin(x) ** 2 - s**2],
        ),
        "CosineAndSquare": (
            {"X": c, "S": s * s},
            lambda x: [np.cos(x) - c, np.sin(x) ** 2 - s * s],
        ),
        "Turned": (
            {"U": a, "V": b, "X": a * c - b * s, "Y": a * s + b * c},
            lambda x: [np.cos(x) - c, np.sin(x) - s],
        ),
        "Square": (
            {"M": a, "S": (z + a) ** 2, "Q": 1 + a * a},
            lambda x: [(x + a) ** 2 - (z + a) ** 2],
        ),
        "Sliding": ({"Z": z}, lambda x: [x - z]),
        "Remainder": ({"X": c, "Y": s}, lambda x: [np.cos(x) - c, np.sin(x) - s]),
    }
    letters, residuals = cases[form.__name__]
    for sign in (1.0, -1.0) if form.has_two_roots else (1.0,):
        found, radicand = form.solve(form(None, {}), letters, sign)
        assert np.all(radicand >= -1e-12)
        assert max(np.abs(residual).max() for residual in residuals(found)) < 1e-12


@pytest.mark.parametrize("name", LIBRARY)
def test_nothing_is_used_before_it_is_found(name):
    derivation = inverse_derivation(robot(name))
    chain = derivation.chain
    known = {*chain.lengths, *(chain.names[k] for k in chain.names if k.startswith(("p", "r")))}
    known |= set(chain.values)
    joints: set[int] = set()
    for step in derivation.steps:
        for definition in step.definitions:
            assert names_in([definition.element]) <= known, (step.title, definition.name)
            assert joints_in(definition.element) <= joints, (step.title, definition.name)
            known.add(definition.name)
        if step.form is None:
            continue
        used = [
            x
            for letter, x in step.form.letters.items()
            if (type(step.form).__name__, letter) != ("Flip", "k")
        ]
        assert names_in(used) <= known, step.title
        assert set().union(*map(joints_in, used)) <= joints, step.title
        if step.unknown.joint is None:
            known |= {chain.names["cphi"], chain.names["sphi"]}
        else:
            joints.add(step.unknown.joint)
    assert joints == set(range(derivation.n))


def joints_in(element):
    generators = element.ring.generators
    used = {k for monomial in element.terms for k, exponent in enumerate(monomial) if exponent}
    return {generators[k].joint for k in used if generators[k].kind != "constant"}


def test_the_pose_put_in_is_that_of_the_symbolic_kinematics():
    """Base, table and tool by another route: the product of the textbook's transforms, in numbers."""
    arm = with_tool(
        with_base(library_robot("al5d"), pose((0.1, -0.2, 0.3), euler=(0.2, 0.5, -1.0))),
        pose((0.1, 0, 0.2)),
    )
    q = np.random.default_rng(3).uniform(-2, 2, (20, arm.n))
    derivation, T = inverse_derivation(arm), symbolic_kinematics(arm).T.evaluate(q)
    chain = derivation.chain
    theta = q + np.array([chain.number(offset) for offset in chain.offsets])
    values = chain.ring.values(
        {**dict.fromkeys(chain.names.values(), math.nan), **chain.values}, theta
    )
    ours = np.stack(
        [np.broadcast_to(entry.value(values), 20) for entry in chain.tool_pose[:3].flat], axis=1
    )
    assert np.abs(ours.reshape(20, 3, 4) - T[:, :3]).max() < 1e-14


def test_lengths_get_names_and_a_family_may_hold_by_numbers_alone():
    text = """
format = 1
name = "chance"
convention = "standard"
[parameters]
l1 = 0.3
"""
    rows = [
        ("0.4", "pi/2", "0"),
        ("0.5", "0", "0"),
        ("0", "-pi/2", "0"),
        ("0", "pi/2", "0.4"),
        ("l1 - 0.3", "-pi/2", "0"),
        ("0", "0", "0.1"),
    ]
    for a, alpha, d in rows:
        text += (
            f'[[joint]]\ntype = "revolute"\na = "{a}"\nalpha = "{alpha}"\nd = "{d}"\ntheta = 0\n'
        )
    chance = inverse_derivation(from_toml(text))
    assert chance.family.name == "elbow_wrist" and chance.prove(20)
    assert "only with the values of the parameters" in chance.notes[0]
    puma = inverse_derivation(library_robot("puma560"))
    assert "a2 = 0.4318" in puma.notes[0] and "a2^2" in puma.text()


@pytest.mark.parametrize(
    ("rows", "kinds", "words"),
    [
        (
            [(0, 0.1, 0, 0.5), (0, 0, 0.4, 0), (0, 0, 0, 1.5)],
            "RRR",
            "axes 1 and 2 are at 28.65 degrees and 0 mm apart",
        ),
        ([(0, 0, 0, 0.3)], "R", "one joint alone meets no pose"),
        ([(0, 0, 0, 1.0)] * 7, "RRRRRRR", "7 joints have more freedom than a pose asks for"),
    ],
)
def test_an_arm_without_a_closed_form_says_why(rows, kinds, words):
    with pytest.raises(
        DescriptionError, match=f"no closed form (is known )?for .*{words}.*use arm.ik.*numeric"
    ):
        inverse_derivation(from_dh(rows, kinds=kinds))


def test_a_wrist_whose_axes_miss_says_by_how_much():
    right = math.pi / 2
    rows = [
        (0, 0, 0, right),
        (0, 0, 0.4, 0),
        (0, 0, 0, -right),
        (0, 0.4, 0, right),
        (0, 0.01, 0.002, -right),
        (0, 0, 0, 0),
    ]
    with pytest.raises(DescriptionError) as raised:
        inverse_derivation(from_dh(rows))
    assert "axes 5 and 6 miss each other by 2 mm, axes 4 and 6 meet axis 5 10 mm apart" in str(
        raised.value
    )


def test_an_arm_has_it_in_its_symbolic_kinematics(tmp_path):
    arm = dhkit.Arm.load("puma560")
    assert arm.symbolic.ik is arm.symbolic.ik
    assert (
        repr(arm.symbolic.ik)
        == "<InverseDerivation of puma560: spherical wrist, axes 2 and 3 parallel, 8 steps>"
    )
    assert [path.name for path in arm.export_ik(tmp_path)] == ["puma560_ik.c", "puma560_ik.h"]
    with pytest.raises(ValueError, match="language is 'rust'; expected one of c, python, matlab"):
        arm.export_ik(tmp_path, "rust")
    with pytest.raises(DescriptionError, match="is a file; expected a folder"):
        arm.export_ik(tmp_path / "puma560_ik.c")
