"""The front door: a value, shared freely; every method leads somewhere."""

import copy
import inspect
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import dhkit
from dhkit import Arm


@pytest.mark.parametrize("name", dhkit.robots())
def test_an_arm_is_a_value(name):
    arm = Arm.load(name)
    assert arm.fk(np.zeros(arm.n)).shape == (4, 4)
    arm.model  # noqa: B018 - what is cached must not get into copies
    for other in (
        pickle.loads(pickle.dumps(arm)),
        copy.copy(arm),
        copy.deepcopy(arm),
        Arm(arm.description),
    ):
        assert other == arm
        assert hash(other) == hash(arm)
        assert np.array_equal(other.fk(np.ones(arm.n)), arm.fk(np.ones(arm.n)))
    assert arm != Arm.load("planar2r" if name != "planar2r" else "planar3r")
    assert arm != name


def test_ten_threads_may_use_one_arm():
    arm = Arm.load("puma560").with_tool(dhkit.pose((0, 0, 0.1)))  # nothing computed yet
    q = np.random.default_rng(0).uniform(-3, 3, (200, 6))

    def work(_):
        return (
            arm.fk(q),
            arm.jacobian(q),
            arm.frames(q),
            arm.model.nq,
            str(arm.dh),
            arm.verify(3).ok,
        )

    with ThreadPoolExecutor(10) as pool:
        results = list(pool.map(work, range(20)))
    for result in results:
        assert all(np.array_equal(a, b) for a, b in zip(result[:3], results[0][:3], strict=True))
        assert result[3:] == (6, results[0][4], True)


def test_nothing_in_an_arm_can_be_changed():
    arm = Arm.load("puma560")
    with pytest.raises(ValueError, match="read-only"):
        arm.configurations["ready"][0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        arm.description.numbers.a[0] = 1.0
    with pytest.raises(AttributeError):
        arm.description.name = "other"
    with pytest.raises(AttributeError):
        arm.name = "other"
    with pytest.raises(AttributeError, match="cannot be changed"):
        arm.other = 1


@pytest.mark.slow
def test_the_pinocchio_model_is_one_object_that_nothing_else_uses():
    arm = Arm.load("planar2r")
    assert arm.model is arm.model
    arm.model.gravity.linear = np.zeros(3)
    arm.model.inertias[1].mass = 100.0
    assert np.array_equal(arm.model.gravity.linear, np.zeros(3))
    assert np.array_equal(arm.pinocchio_model().gravity.linear, arm.description.numbers.gravity)
    for other in (pickle.loads(pickle.dumps(arm)), copy.copy(arm), copy.deepcopy(arm)):
        assert other == arm
        assert np.array_equal(other.model.gravity.linear, arm.description.numbers.gravity)
    assert arm.verify(10).ok
    motion = arm.plan([0, 0], [1.0, 0.5], intervals=24)
    assert motion.report.certificate.ok
    assert np.array_equal(
        motion.tau(0.1), Arm.load("planar2r").plan([0, 0], [1.0, 0.5], intervals=24).tau(0.1)
    )


def test_limits_names_and_files(tmp_path):
    arm = Arm.load("puma560")
    assert arm.joint_names[:2] == ("waist", "shoulder")
    assert np.array_equal(arm.limits.velocity, arm.description.numbers.velocity)
    slower = arm.with_limits(velocity=0.5, lower=[-1] * 6, upper=np.full(6, 2.0), torque=np.inf)
    assert slower.limits.velocity.tolist() == [0.5] * 6
    assert (slower.limits.lower[0], slower.limits.upper[5], slower.limits.torque[1]) == (
        -1,
        2,
        np.inf,
    )
    assert slower.description.joints[0].bodies == arm.description.joints[0].bodies
    assert arm.with_limits(lower=-np.inf, upper=np.inf).description.joints[0].limits is None
    for wrong in (
        {"lower": 2.0, "upper": 1.0},
        {"upper": np.inf},
        {"velocity": -1.0},
        {"lower": np.nan},
    ):
        with pytest.raises(dhkit.DhkitError, match=r"joint 1 \(waist\): "):
            arm.with_limits(**wrong)
    with pytest.raises(
        ValueError, match=r"velocity has shape \(2,\); expected \(6,\) or one number"
    ):
        arm.with_limits(velocity=[1, 2])
    files = arm.save(tmp_path / "puma.toml")
    assert files[0] == tmp_path / "puma.toml"
    assert len(files) > 1
    again = Arm.load(tmp_path / "puma.toml")
    assert np.array_equal(again.mass_matrix([0.1] * 6), arm.mass_matrix([0.1] * 6))
    with pytest.raises(dhkit.DhkitError, match=r"ends in \.toml"):
        arm.save(tmp_path / "puma.yaml")


def test_an_arm_without_meshes_is_saved_as_one_file(tmp_path):
    arm = Arm.from_dh([(0, 0.3, 0.5, "pi/2"), (0, 0, 0.4, 0)], name="bare")
    assert arm.save(tmp_path / "new" / "bare.toml") == (tmp_path / "new" / "bare.toml",)
    assert np.array_equal(
        Arm.load(tmp_path / "new" / "bare.toml").fk([0.1, 0.2]), arm.fk([0.1, 0.2])
    )


def test_a_table_may_have_limits_and_bodies():
    rod = {
        "mass": "m",
        "com": ("-l/2", 0, 0),
        "inertia": ((0, 0, 0), (0, "m*l^2/12", 0), (0, 0, "m*l^2/12")),
    }
    arm = Arm.from_dh(
        [(0, 0, "l", 0), (0, 0, 0.3, 0)],
        angle="deg",
        limits=[(-90, 90), None],
        bodies=[rod, dhkit.description.Body(dhkit.expressions.exact(2))],
        parameters={"l": 0.5, "m": 3},
    )
    assert arm.limits.upper.tolist() == [np.pi / 2, np.inf]
    assert arm.mass_matrix([0.0, 0.0])[1, 1] == pytest.approx(2 * 0.3**2)
    assert arm.mass_matrix([0.0, 0.0])[0, 0] == pytest.approx(3 * 0.25 / 3 + 2 * 0.8**2)
    for wrong, said in (
        ({"limits": [(0, 1)]}, "limits: 1 entries; expected 2"),
        ({"limits": [(0, 1, 2), None]}, "limits of joint 1: found"),
        ({"limits": ["ab", None]}, "limits of joint 1: found"),
        ({"bodies": [3, None]}, "body of link 1: found 3; expected a Body"),
        ({"bodies": [{"mass": 1, "moi": 2}, None]}, "body of link 1"),
        ({"bodies": [{"mass": 1, "com": (0, 0)}, None]}, "com has 2 numbers"),
        (
            {"bodies": [{"mass": 1, "inertia": ((1, 2, 0), (0, 1, 0), (0, 0, 1))}, None]},
            "symmetric 3x3",
        ),
        (
            {"bodies": [{"mass": 1, "inertia": {"x": 1}}, None]},
            "found x; expected a symmetric 3x3 matrix",
        ),
        ({"bodies": [{"mass": 1, "inertia": [1, 2, 3, 4, 5, 6]}, None]}, "or entries xx, yy, zz"),
    ):
        with pytest.raises(dhkit.DhkitError, match=said):
            Arm.from_dh([(0, 0, 1, 0), (0, 0, 1, 0)], **wrong)


def test_arms_come_from_the_library_from_files_and_from_tables(tmp_path):
    from dhkit.description import write_robot

    arm = Arm.load("planar2r")
    write_robot(arm.description, tmp_path / "mine.toml")
    assert Arm.load(tmp_path / "mine.toml") == arm
    assert Arm.load(str(tmp_path / "mine.toml")) == arm
    assert Arm.from_dh([(0, 0, 1, 0)]).n == 1
    with pytest.raises(dhkit.DescriptionError, match="no such file"):
        Arm.load(tmp_path / "none.toml")
    with pytest.raises(dhkit.ModelError, match="No such file"):
        Arm.load("arm.urdf")


def test_new_arms_leave_the_old_one_alone():
    arm = Arm.load("planar3r")
    before = pickle.dumps(arm)
    assert arm.lock({0: 0.1}).n == 2
    assert (
        arm.with_payload(1.0, (0.1, 0, 0)).description.numbers.mass[2]
        > arm.description.numbers.mass[2]
    )
    assert arm.with_parameters(l1=2).description.numbers.a[0] == 2
    assert arm.with_uniform_links([1, 2, 3]).description.numbers.mass.tolist() == [1, 2, 3]
    assert (
        arm.with_base(dhkit.pose((1, 0, 0))).fk(np.zeros(3))[0, 3] == arm.fk(np.zeros(3))[0, 3] + 1
    )
    assert pickle.dumps(arm) == before
    assert repr(arm) == "<Arm planar3r: RRR, standard DH>"
    held = (
        Arm.load("puma560").with_payload(2.0).with_payload(0.5).with_tool(dhkit.pose((0, 0, 0.1)))
    )
    assert (
        repr(held) == "<Arm puma560: RRRRRR, standard DH, tool at (0, 0, 0.1) m, carrying 2.5 kg>"
    )
    assert (
        "carrying 2.5 kg" in held._repr_html_() and "l1 = 0.5" in Arm.load("planar2r")._repr_html_()
    )
    assert "<table>" in arm._repr_html_()
    assert arm.urdf().startswith("<?xml")
    assert arm.jacobian_dot(np.zeros(3), np.ones(3), frame="tool").shape == (6, 3)


def test_a_star_import_gives_names_and_no_packages():
    names = {}
    exec("from dhkit import *", names)
    assert {"Arm", "plot", "PlanningError", "__version__"} <= set(names)
    assert not [name for name, one in names.items() if inspect.ismodule(one)]
    assert dhkit.control.__name__ == "dhkit.control"


def test_the_public_names_are_there():
    assert set(dhkit.__all__) <= set(dir(dhkit))
    for name in dhkit.__all__:
        assert getattr(dhkit, name) is not None
    with pytest.raises(AttributeError, match="attribute nothing"):
        dhkit.nothing  # noqa: B018


def test_inertias_are_given_as_robot_files_give_them():
    def arm(inertia):
        return Arm.from_dh(
            [(0, 0, 0.4, 0)], kinds="R", name="rod", bodies=[{"mass": 1, "inertia": inertia}]
        )

    assert arm({"xx": 0.01, "yy": 0.02, "xy": 0.001}) == arm(
        [[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0]]
    )
