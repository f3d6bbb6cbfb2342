"""`dhkit simulate`, `compare` and `play`: the same runs as in Python, files of them, and one line for bad input."""

import json
import re

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from dhkit import Arm, FrictionCompensation, Payload, PDGravity, SimulationResult
from dhkit.cli import main
from dhkit.cli.simulation_settings import chosen_motion
from dhkit.viewer import View
from dhkit.viewer.session import Slot
from viewer.messages import decode_animation

ARM = Arm.load("planar2r")
ENDS = ("--from", "0.1", "0.2", "--to", "0.5", "-0.3", "--duration", "1")


@pytest.fixture
def dhkit(capsys):
    """Run a command; return its status, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main(tuple(map(str, arguments)))
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


def test_a_run_is_that_of_python_and_its_files_hold_it(dhkit, tmp_path):
    files = [tmp_path / name for name in ("run.npz", "run.png", "run.html")]
    options = (
        "--controller",
        "pd-gravity",
        "--bandwidth",
        15,
        "--friction",
        "stiction",
        "--compensate",
    )
    status, out, _ = dhkit(
        "simulate",
        "planar2r",
        *ENDS,
        *options,
        "-o",
        files[0],
        "--figure",
        files[1],
        "--html",
        files[2],
        "--json",
    )
    assert status == 0
    motion = ARM.quintic([0.1, 0.2], [0.5, -0.3], 1.0)
    control = FrictionCompensation(PDGravity.tuned(ARM, bandwidth=15))
    mine = ARM.simulate(control, motion, friction=True)
    facts = json.loads(out)
    assert facts["peak_error_rad"] == mine.peak_error.tolist() and facts["failure"] is None
    assert facts["files"] == [str(files[0]), str(files[2]), str(files[1])]
    loaded = SimulationResult.load(files[0])
    assert np.array_equal(loaded.q, mine.q) and np.array_equal(loaded.tau, mine.tau)
    with Image.open(files[1]) as image:
        assert image.size[0] > 600
    assert files[2].stat().st_size > 100_000


def test_a_payload_is_known_unless_it_is_said_not_to_be(dhkit):
    errors = {}
    for unmodelled in ((), ("--unmodelled",)):
        load = ("--payload", "0.2", "@", "0", "0", "0.1", *unmodelled)
        status, out, _ = dhkit("simulate", "planar2r", *ENDS, *load, "--json")
        assert status == 0
        errors[unmodelled] = max(json.loads(out)["peak_error_rad"])
    assert errors[("--unmodelled",)] > 20 * errors[()]


@pytest.mark.slow
def test_text_names_joints_tool_and_energy(dhkit):
    status, out, _ = dhkit(
        "simulate", "stanford", "--controller", "pid", "--degrees", "--duration", "2.5"
    )
    assert status == 0
    assert "stanford: pid, 1000 Hz" in out and "2.5 s simulated in" in out
    assert len(re.findall(r"[\d.e-]+ +°", out)) == 5 and len(re.findall(r"[\d.e-]+ +m ", out)) == 1
    assert "tool: largest error" in out and "of the energy turned over" in out
    status, out, _ = dhkit(
        "simulate",
        "planar2r",
        "--controller",
        "none",
        "--continuous",
        *ENDS,
        "--push",
        "0",
        "5",
        "0",
        "@",
        "0.05",
        "0.1",
    )
    assert status == 0 and "planar2r: none, continuous" in out
    assert not re.search(r"pushes 0 J", out)


def test_a_run_that_fails_is_status_1_and_keeps_what_there_was(dhkit, tmp_path, monkeypatch):
    def failing(*arguments):
        called = iter(range(20))
        return lambda t, q, qd, setpoint: np.zeros(2) if next(called) < 19 else np.full(2, np.nan)

    monkeypatch.setattr("dhkit.cli.simulation_settings.make_controller", failing)
    path = tmp_path / "run.npz"
    status, out, err = dhkit("simulate", "planar2r", *ENDS, "-o", path, "--json")
    assert status == 1
    assert "returned [nan, nan] at 0.019 s" in json.loads(out)["failure"]
    assert err.startswith("dhkit: the controller returned") and err.count("\n") == 1
    assert len(SimulationResult.load(path).t) == 19


@pytest.mark.slow
def test_motions_come_from_files_of_dhkit_and_from_elsewhere(dhkit, tmp_path):
    motion = ARM.quintic([0.1, 0.2], [0.5, -0.3], 1.0)
    times = np.linspace(0, 1, 101)
    ours = [motion.save(tmp_path / f"ours{suffix}") for suffix in (".npz", ".mat", ".csv", ".yaml")]
    savemat(tmp_path / "theirs.mat", {"tout": times, "q": np.degrees(motion.q(times))})
    rows = np.column_stack([times, np.degrees(motion.q(times))])
    lines = ["time,shoulder,elbow", *(",".join(map(str, row)) for row in rows.tolist())]
    (tmp_path / "theirs.csv").write_text("\n".join(lines) + "\n")
    savemat(tmp_path / "simulink.mat", {"tout": times, "angles": motion.q(times)})
    status, out, err = dhkit(
        "simulate",
        "planar2r",
        "--motion",
        tmp_path / "simulink.mat",
        "--columns",
        "q=angles",
        "--json",
    )
    assert status == 0 and json.loads(out)["duration_s"] == pytest.approx(1.0), err
    status, _, err = dhkit("simulate", "planar2r", "--motion", tmp_path / "simulink.mat")
    assert status == 2 and "columns={'q': ...}" in err
    for path in (*ours, tmp_path / "theirs.mat", tmp_path / "theirs.csv"):
        degrees = ("--degrees",) if path.stem == "theirs" else ()
        status, out, err = dhkit("simulate", "planar2r", "--motion", path, *degrees, "--json")
        assert status == 0, err
        assert json.loads(out)["duration_s"] == pytest.approx(1.0)
        said = json.loads(out)
        assert (
            max(np.radians(said["peak_error_deg"]) if degrees else said["peak_error_rad"]) < 1e-3
        ), path


def test_without_a_motion_every_joint_moves():
    for name in ("puma560", "planar2r", "stanford", "cart_pendulum", "panda"):
        arm = Arm.load(name)
        motion, _ = chosen_motion(arm, None, None, None, None, False)
        assert motion.duration >= 2 and np.all(motion.q(0.0) != motion.q(motion.duration))


@pytest.mark.slow
def test_compare_prints_a_table_and_draws_it(dhkit, tmp_path):
    figure = tmp_path / "compared.png"
    status, out, _ = dhkit("compare", "planar2r", *ENDS, "--figure", figure)
    assert status == 0
    for name in (
        "pd",
        "pid",
        "pd-gravity",
        "feed-forward",
        "computed-torque",
        "operational-space",
        "adaptive",
        "lqr",
    ):
        assert re.search(rf"^{name} ", out, re.MULTILINE), name
    assert figure.stat().st_size > 10_000
    status, out, _ = dhkit("compare", "planar2r", *ENDS, "--controllers", "pid, lqr", "--json")
    facts = json.loads(out)
    assert list(facts["controllers"]) == ["pid", "lqr"] and not facts["failures"]


def test_play_writes_pages_of_motions_and_simulations(dhkit, tmp_path, monkeypatch):
    shown, save = [], View.save_html

    def spy(view, path, **about):
        shown.append(view._state[Slot.MOTION])
        return save(view, path, **about)

    monkeypatch.setattr(View, "save_html", spy)
    motion = ARM.quintic([0.1, 0.2], [0.5, -0.3], 1.0)
    run = ARM.simulate(PDGravity.tuned(ARM), motion)
    for path in (
        motion.save(tmp_path / "motion.npz"),
        run.save(tmp_path / "run.csv"),
        run.save(tmp_path / "run.mat"),
    ):
        page = path.with_suffix(".html")
        status, out, err = dhkit("play", "planar2r", path, "--html", page)
        assert status == 0, err
        assert out == f"wrote {page}\n" and page.stat().st_size > 100_000
        assert decode_animation(shown[-1]) is not None


BAD = {
    "no such controller": (
        ("simulate", "planar2r", "--controller", "pidd"),
        "controller is 'pidd'; expected pd, pid,",
    ),
    "no such friction": (
        ("simulate", "planar2r", "--friction", "some"),
        "--friction: found 'some'; expected none, stiction",
    ),
    "a width of 0": (("simulate", "planar2r", "--friction", "-1"), "--friction: width is -1.0"),
    "no payload": (("simulate", "planar2r", "--unmodelled"), "--unmodelled: found no --payload"),
    "a push of two numbers": (
        ("simulate", "planar2r", "--push", "1", "2", "@", "0", "1"),
        "--push: 2 values; expected 3",
    ),
    "a push without a time": (
        ("simulate", "planar2r", "--push", "1", "2", "3"),
        "--push: found '1 2 3'; expected",
    ),
    "a file and a goal": (
        ("simulate", "planar2r", "--motion", "x.npz", "--to", "0", "0"),
        "--motion: found --from, --to",
    ),
    "no such file": (("simulate", "planar2r", "--motion", "x.npz"), "x.npz"),
    "a start of another arm": (
        ("simulate", "planar2r", "--from", "1", "2", "3"),
        "3 values of --from; expected 2",
    ),
    "no columns": (
        ("simulate", "planar2r", "--motion", "x.mat", "--columns", "tout"),
        "--columns: found 'tout'",
    ),
    "a rate of 0": (
        ("simulate", "planar2r", "--rate", "0"),
        "rate is 0.0; expected a positive number",
    ),
    "a bandwidth of 0": (("simulate", "planar2r", "--bandwidth", "0"), "bandwidth is 0.0"),
    "noise in continuous time": (
        ("simulate", "planar2r", "--continuous", "--noise", "1e-3"),
        "expected a rate in Hz",
    ),
    "a result of another suffix": (
        ("simulate", "planar2r", "-o", "run.txt"),
        "run.txt: ends in '.txt'; expected .npz",
    ),
    "a file for a folder": (
        ("simulate", "planar2r", "-o", "/dev/null/run.npz"),
        "/dev/null: a file; expected a folder",
    ),
    "no such controllers": (("compare", "planar2r", "--controllers", "pid,x"), "controller is 'x'"),
    "no motion to play": (("play", "planar2r", "x.png"), "x.png: found suffix '.png'"),
    "no robot": (("simulate", "robbie"), "robbie"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_status_2(name, dhkit, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, message = BAD[name]
    status, out, err = dhkit(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("dhkit: ") and err.count("\n") == 1 and message in err
    assert not list(tmp_path.iterdir())


def test_a_motion_of_another_arm_or_a_simulation_is_no_motion(dhkit, tmp_path):
    puma = Arm.load("puma560")
    path = puma.quintic(np.zeros(6), np.full(6, 0.1), 1.0).save(tmp_path / "puma.npz")
    status, _, err = dhkit("simulate", "planar2r", "--motion", path)
    assert status == 2 and "trajectory was made for the robot puma560" in err
    path = ARM.simulate(None, duration=0.01, q0=[0.1, 0.2]).save(tmp_path / "run.npz")
    status, _, err = dhkit("simulate", "planar2r", "--motion", path)
    assert status == 2 and "a dhkit simulation; expected a trajectory" in err


@pytest.mark.slow
def test_a_motion_brings_its_payload(dhkit, tmp_path):
    arm = Arm.load("planar2r")
    load = Payload(1.2, (0.02, 0, 0))
    path = arm.plan([0, 0], [1.0, 0.5], intervals=24, payload=load).save(tmp_path / "loaded.npz")
    status, out, err = dhkit("simulate", "planar2r", "--motion", path, "--json")
    assert status == 0, err
    known = json.loads(out)["peak_error_rad"]
    assert json.loads(
        dhkit("simulate", "planar2r", "--motion", path, "--payload", "1.2 @ 0.02 0 0", "--json")[1]
    )["peak_error_rad"] == pytest.approx(known)
    unknown = json.loads(
        dhkit("simulate", "planar2r", "--motion", path, "--unmodelled", "--json")[1]
    )
    assert max(unknown["peak_error_rad"]) > 10 * max(known)
