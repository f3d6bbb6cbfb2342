"""The page without Python: its numbers are Python's, each of its controls works, and it asks nobody for anything."""

# ruff: noqa: E501 - JavaScript in one line

import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acceptance import in_time, sample_size, slow_if
from dhkit import Arm, robots
from dhkit.description import pose, pose_parts
from dhkit.description.table_rows import from_dh, quantity
from dhkit.errors import DescriptionError
from dhkit.lab import Lab
from dhkit.viewer import View
from viewer.pictures import shows_the_arm
from waiting import wait_for

GOLDEN = Path(__file__).with_name("golden_kinematics.json")
"""Poses of tools by Pinocchio, of five states of each arm of the library."""
CLOSE = 1e-12
"""Of entries of poses, m and rad: sums of some twenty products below 10."""
SAVED = 1e-6
"""rad: digits of a saved motion."""
ORDERS = ["XYZ", "ZYX", "ZYZ", "ZXZ", "xyz", "zyx", "zyz", "zxz"]
LARGEST = 1_100_000
"""Bytes of a page without meshes: LAB.md."""
READY = 3.0
"""s until it shows the arm: LAB.md; twice that here, where another test may run beside."""
HOSTILE = '<img src=x onerror="globalThis.hacked=1"></script><!--<script>'


def open_page(chromium, file, width, height):
    """Open an interactive page that has no network."""
    page = chromium.page(width=width, height=height)
    page.call(
        "Network.emulateNetworkConditions",
        offline=True,
        latency=0,
        downloadThroughput=0,
        uploadThroughput=0,
    )
    page.open(f"file://{file}")
    page.until("dhkit.lab?.state.tool && dhkit.lab.state.table")
    return page


def check_errors_and_requests(page):
    """Check that a page has met no error and asked nobody; forget the errors."""
    errors, page.errors = page.errors, []
    assert errors == []
    assert [
        url for url in page.requests if not url.startswith(("file:///", "data:", "blob:"))
    ] == []


@pytest.fixture
def visit(chromium, tmp_path):
    """Return what saves a view's interactive page and opens it; at the end it must have met no error and asked nobody."""
    pages = []

    def make(view, width=1280, height=800, **about):
        file = view.save_html(tmp_path / f"page{len(pages)}.html", interactive=True, **about)
        pages.append(open_page(chromium, file, width, height))
        return pages[-1]

    yield make
    for page in pages:
        page.close()
    for page in pages:
        check_errors_and_requests(page)


@pytest.fixture(scope="module")
def plain_page(chromium, tmp_path_factory):
    """A page of a planar arm for tests of its functions, which change nothing on it."""
    file = View(Arm.load("planar2r").description).save_html(
        tmp_path_factory.mktemp("plain") / "page.html", interactive=True
    )
    page = open_page(chromium, file, 640, 480)
    yield page
    page.close()


@pytest.fixture
def plain(plain_page):
    """That page; at the end it must have met no error and asked nobody."""
    yield plain_page
    check_errors_and_requests(plain_page)


@pytest.fixture(scope="module")
def kept_pages(chromium, tmp_path_factory):
    """Return what opens an arm's interactive page, once, and its first joint values."""
    opened = {}

    def make(name):
        if name not in opened:
            file = View(Arm.load(name).description).save_html(
                tmp_path_factory.mktemp("kept") / f"{name}.html", interactive=True
            )
            page = open_page(chromium, file, 1280, 800)
            opened[name] = page, told(page, "joints.q")
        return opened[name]

    yield make
    for page, _ in opened.values():
        page.close()


@pytest.fixture
def kept_page(kept_pages):
    """Return what resets an arm's page that other tests have used; it must have met no error and asked nobody."""
    used = []

    def make(name):
        page, q = kept_pages(name)
        used.append(page)
        page.evaluate("dhkit.lab.ask('table.reset', {})")
        page.evaluate(f"dhkit.lab.ask('joints.set', {{ q: {json.dumps(q)} }})")
        page.evaluate(
            "dhkit.lab.setUnits({ angle: 'deg', length: 'm' }), dhkit.lab.openPanel('joints')"
        )
        return page

    yield make
    for page in used:
        check_errors_and_requests(page)


def table(arm):
    """Return an arm's table as the page has it."""
    n = arm.description.numbers
    rows = [
        {
            "kind": "P" if n.prismatic[i] else "R",
            "theta": n.theta[i],
            "d": n.d[i],
            "a": n.a[i],
            "alpha": n.alpha[i],
        }
        for i in range(arm.n)
    ]
    return {
        "convention": arm.description.convention.value,
        "rows": rows,
        "base": n.T_world_base.ravel().tolist(),
        "tool": n.T_last_tool.ravel().tolist(),
    }


def in_page(page, arm, states):
    """Return frames and tool, shape (N, n + 2, 4, 4), as the page's kinematics give them."""
    found = page.evaluate(
        f"""import("dhkit/offline/kinematics.js").then(({{ Kinematics }}) => {{
          const kinematics = new Kinematics({json.dumps(table(arm))});
          return {json.dumps(states.tolist())}.map(q => kinematics.frames(q));
        }})"""
    )
    return np.reshape(found, (len(states), arm.n + 2, 4, 4))


def random_arm(rng):
    """Return an arm of either convention with slides, right angles and odd ones, a base and a tool."""
    n = int(rng.integers(1, 8))
    angles = [0.0, "pi/2", "-pi/2", "pi", "pi/6"]
    rows = [
        [
            angles[rng.integers(5)] if rng.random() < 0.5 else float(rng.uniform(-3, 3)),
            float(rng.uniform(-1, 1)),
            float(rng.uniform(-1, 1)) if rng.random() < 0.6 else 0.0,
            angles[rng.integers(5)] if rng.random() < 0.7 else float(rng.uniform(-3, 3)),
        ]
        for _ in range(n)
    ]
    kinds = "".join(rng.choice(["R", "R", "P"], n))
    arm = Arm(from_dh(rows, kinds=kinds, convention=str(rng.choice(["standard", "modified"]))))
    return arm.with_tool(pose(rng.uniform(-0.2, 0.2, 3), euler=rng.uniform(-1, 1, 3)))


def test_its_kinematics_are_those_of_python_in_random_states_of_all_kinds_of_arms(plain):
    rng = np.random.default_rng(12)
    arms = [Arm.load(name) for name in robots()] + [random_arm(rng) for _ in range(28)]
    each, worst = max(1, sample_size(1000) // len(arms)), 0.0
    for arm in arms:
        q = rng.uniform(-math.pi, math.pi, (each, arm.n))
        expected = np.concatenate([arm.frames(q), arm.fk(q)[:, None]], axis=1)
        worst = max(worst, float(np.abs(in_page(plain, arm, q) - expected).max()))
    print(
        f"kinematics of the page: {worst:.1e} from Python's in {each * len(arms)} states of {len(arms)} arms"
    )
    assert worst < CLOSE


def test_its_kinematics_and_those_of_python_are_those_of_pinocchio(plain):
    golden = json.loads(GOLDEN.read_text())
    assert sorted(golden) == sorted(robots())
    for name, (states, poses) in golden.items():
        arm, q = Arm.load(name), np.array(states)
        assert np.abs(arm.fk(q) - poses).max() < CLOSE
        assert np.abs(in_page(plain, arm, q)[:, -1] - poses).max() < CLOSE


def test_its_euler_angles_are_those_of_python(plain):
    arm, rng = Arm.load("puma560"), np.random.default_rng(3)
    q = np.concatenate(
        [rng.uniform(-3, 3, (30, 6)), np.zeros((1, 6)), np.full((1, 6), math.pi / 2)]
    )
    T = arm.fk(q)
    for order in ORDERS:
        found = plain.evaluate(
            f"""import("dhkit/offline/kinematics.js").then(({{ euler }}) =>
              {json.dumps(T.reshape(-1, 16).tolist())}.map(T => euler(T, {json.dumps(order)})))"""
        )
        apart = np.remainder(found - pose_parts(T, order=order)[1] + math.pi, 2 * math.pi) - math.pi
        assert np.abs(apart).max() < CLOSE


@pytest.mark.parametrize(
    "texts",
    [
        ["pi/2", "-pi/2", "90*deg", "17*inch", "2*(17 + 3/10)*inch", "-2^2", "2**-1", "sqrt(2)/2", "atan2(1, -1)", "1e-3", "abs(-2)", "sin(pi)*1e6", "cos(90*deg)", "tan(45*deg)", "4^0.5"],
        ["", "1 +", "(1", "1)", "2 3", "pi pi", "foo", "sin(1, 2)", "constructor", "__proto__", "x.y", "1/0", "()", "alert(1)", "tan(90*deg)", "1/cos(90*deg)", "pi/tan(90*deg)-2", "2^0.3", "2^65"],
    ],
)  # fmt: skip
def test_its_entries_mean_what_they_mean_in_python(plain, texts):
    found = plain.evaluate(
        f"""import("dhkit/offline/expressions.js").then(({{ value }}) => {json.dumps(texts)}.map(text => {{
          try {{ return value(text); }} catch (error) {{ return String(error.message); }}
        }}))"""
    )
    for text, value in zip(texts, found, strict=True):
        try:
            expected = float(quantity("entry", text, {}))
        except DescriptionError:
            assert isinstance(value, str), text
            assert value
            continue
        assert abs(value - expected) < 1e-15 * max(1.0, abs(expected)), text


def test_deep_and_long_entries_are_refused_at_once(plain):
    for text in ("(" * 900 + "1" + ")" * 90, "-" * 999 + "1", "1+" * 100_000 + "1"):
        said = plain.evaluate(
            f"""import("dhkit/offline/expressions.js").then(({{ value }}) => {{
              try {{ value({json.dumps(text)}); return "accepted"; }} catch (error) {{ return error.constructor.name + error.message; }}
            }})"""
        )
        assert said.startswith("Error")
        assert "more than 50" in said or "at most 1000" in said


def labelled(label):
    return f"document.querySelector({json.dumps(f'#lab [aria-label={json.dumps(label)}]')})"


def button(text):
    return (
        "[...document.querySelectorAll('#lab button')]"
        f".find(b => b.offsetWidth && b.textContent.trim().startsWith({json.dumps(text)}))"
    )


def tab(page, name):
    # A click on the panel that is open hides it.
    if (
        page.evaluate(f"document.getElementById('tab-{name}').getAttribute('aria-selected')")
        != "true"
    ):
        page.click(f"document.getElementById('tab-{name}')")


def write(page, label, text):
    page.click(labelled(label))
    page.write(text)


def told(page, name):
    return page.evaluate(f"dhkit.lab.state.{name}")


def tool_is(page, arm):
    """Check the tool's pose and the drawn tool against the API, at the joint values on show."""
    q = np.array(told(page, "joints.q"))
    T = arm.fk(q)
    assert np.abs(np.reshape(told(page, "tool.T"), (4, 4)) - T).max() < 1e-9
    drawn = page.evaluate("dhkit.stage.nodes.at(-1).position.toArray()")
    assert np.abs(drawn - T[:3, 3]).max() < 1e-6
    return q


@pytest.mark.parametrize(
    "name",
    ["puma560", *(slow_if(True, name) for name in ("stanford", "panda", "cobra600"))],
)
def test_joints_tool_and_table_follow_every_control(kept_page, name):
    arm = Arm.load(name)
    page = kept_page(name)
    tab(page, "joints")
    names = [joint.name for joint in arm.description.joints]
    for i, joint in enumerate(names):
        slides, before = arm.description.numbers.prismatic[i], told(page, "joints.q")
        page.evaluate(f"{labelled(joint)}.focus()")
        page.press("ArrowRight")
        page.press("ArrowUp", 8)
        moved = np.array(told(page, "joints.q")) - before
        assert moved[i] == pytest.approx(11e-3 if slides else math.radians(11), abs=1e-9)
        assert np.abs(np.delete(moved, i)).max(initial=0) == 0
    write(page, f"{names[1]}, value", "12.5")
    assert told(page, "joints.q")[1] == pytest.approx(
        math.radians(12.5) if arm.description.kinds[1] == "R" else 12.5
    )
    tool_is(page, arm)
    for configuration in ("random", "zero"):
        page.click(button(configuration))
        q = tool_is(page, arm)
        numbers = arm.description.numbers
        assert (configuration == "zero" and not q.any()) or (
            (numbers.lower <= q) & (q <= numbers.upper)
        ).all()

    tab(page, "tool")
    for order in ("ZYZ", "xyz"):
        page.choose(labelled("Convention of Euler angles"), order)
        assert (
            np.abs(np.array(told(page, "tool.euler")) - pose_parts(arm.fk(q), order=order)[1]).max()
            < 1e-9
        )
    assert page.evaluate(
        "[...document.querySelectorAll('#panel-tool input')].every(x => x.readOnly)"
    )
    assert "0." in page.evaluate("document.querySelector('#panel-tool math').textContent")

    tab(page, "table")
    write(page, "a of row 2", "17*inch")
    edited = with_entry(arm, 1, "a", "17*inch")
    tool_is(page, edited)
    write(page, "alpha of row 2", "90*deg +")
    assert page.evaluate(f"{labelled('alpha of row 2')}.getAttribute('aria-invalid')") == "true"
    tool_is(page, edited)
    page.click(button("Undo"))
    page.choose(
        labelled("Convention"),
        "modified" if arm.description.convention.value == "standard" else "standard",
    )
    other = "modified" if arm.description.convention.value == "standard" else "standard"
    switched = Arm(replace(edited.description, convention=type(arm.description.convention)(other)))
    tool_is(page, switched)
    page.click(button("Undo"))
    tool_is(page, edited)
    page.click(button("Redo"))
    tool_is(page, switched)
    page.click(button("Reset"))
    tool_is(page, arm)
    page.click(labelled(f"row 1, {names[0]}: show its four transforms"))
    A = page.evaluate("document.querySelectorAll('#panel-table .step li').length")
    assert A == 4
    page.click("document.querySelector('#panel-table button[aria-pressed]')")
    assert page.evaluate(
        "!document.getElementById('labels').hidden && dhkit.stage.triads.some(t => t?.visible)"
    )


def with_entry(arm, row, column, text):
    joints = list(arm.description.joints)
    joints[row] = replace(joints[row], shapes=(), **{column: quantity(column, text, {})})
    return Arm(replace(arm.description, joints=tuple(joints)))


@pytest.mark.parametrize("name", ["stanford", "panda"])
def test_the_steps_of_a_row_are_those_of_the_lab(kept_page, name):
    with Lab(Arm.load(name)) as lab:
        q = np.random.default_rng(1).uniform(-1, 1, lab.desk.arm.n)
        lab.answer("joints.set", {"q": q.tolist()})
        page = kept_page(name)
        page.evaluate(f"dhkit.lab.ask('joints.set', {{ q: {json.dumps(q.tolist())} }})")
        for row in range(lab.desk.arm.n):
            ours, theirs = (
                lab.answer("table.steps", {"row": row}),
                page.evaluate(f"dhkit.lab.ask('table.steps', {{ row: {row} }})"),
            )
            assert [step["title"] for step in ours["steps"]] == [
                step["title"] for step in theirs["steps"]
            ]
            for one, other in zip(ours["steps"], theirs["steps"], strict=True):
                assert np.abs(np.subtract(one["T"], other["T"])).max() < CLOSE
            assert np.abs(np.subtract(ours["A"], theirs["A"])).max() < CLOSE


def test_an_edited_arm_has_the_labels_that_python_gives_it(kept_page):
    arm = Arm.load("puma560")
    page = kept_page("puma560")
    page.evaluate("dhkit.lab.ask('table.edit', { row: 5, column: 'd', text: '0.1' })")
    edited = with_entry(arm, 5, "d", "0.1")
    from dhkit.viewer.scene import frame_labels

    expected = [label.text for label in frame_labels(edited.description)]
    assert (
        page.evaluate("[...document.querySelectorAll('#labels span')].map(s => s.textContent)")
        == expected
    )


@pytest.mark.slow
def test_motions_are_listed_played_and_drawn_with_their_curves(visit):
    arm = Arm.load("puma560")
    q = np.array(arm.configurations["ready"])
    motions = {"there": arm.quintic(q, q + 0.5, 2.0), "back": ([0.0, 1.0], [q + 0.5, q])}
    page = visit(View(arm.description), motions=motions)
    page.until("dhkit.player.active")
    assert told(page, "motion.name") == "there"
    tab(page, "recorded")
    page.press(" ") if told(page, "motion") is None else None
    page.until("document.querySelectorAll('#dock .plot canvas').length === 3")
    page.evaluate("dhkit.player.pause(), dhkit.player.seek(1.0)")
    middle = motions["there"].q(1.0)
    assert (
        np.abs(
            np.array(page.evaluate("dhkit.stage.nodes.at(-1).position.toArray()"))
            - arm.fk(middle)[:3, 3]
        ).max()
        < 1e-4
    )
    page.click(button("back"))
    assert told(page, "motion.name") == "back"
    page.until("document.querySelectorAll('#dock .plot canvas').length >= 2")
    page.evaluate("dhkit.player.pause(), dhkit.player.seek(0)")
    assert (
        np.abs(
            np.array(page.evaluate("dhkit.stage.nodes.at(-1).position.toArray()"))
            - arm.fk(q + 0.5)[:3, 3]
        ).max()
        < 1e-5
    )
    # A slider ends a motion where it is, and the table carries it over to another arm.
    tab(page, "joints")
    page.evaluate(f"{labelled('waist')}.focus()")
    page.press("ArrowRight")
    assert (
        np.abs(
            np.array(told(page, "joints.q")) - (q + 0.5) - [math.radians(1), 0, 0, 0, 0, 0]
        ).max()
        < SAVED
    )
    assert not page.evaluate("dhkit.player.active")
    page.evaluate("dhkit.lab.ask('table.edit', { row: 1, column: 'a', text: '0.6' })")
    page.evaluate("dhkit.lab.ask('motion.play', { index: 1 })")
    page.evaluate("dhkit.player.pause(), dhkit.player.seek(1)")
    tip = with_entry(arm, 1, "a", "0.6").fk(q)[:3, 3]
    assert (
        np.abs(np.array(page.evaluate("dhkit.stage.nodes.at(-1).position.toArray()")) - tip).max()
        < 1e-5
    )


def test_texts_are_texts_and_end_no_script(visit):
    view = View(Arm.load("planar2r").description)
    view.ghosts([[0.1, 0.2]], names=[HOSTILE])
    motions = {HOSTILE: ([0.0, 1.0], [[0.0, 0.0], [1.0, 1.0]])}
    page = visit(
        view,
        title=HOSTILE,
        caption=f"one\n{HOSTILE}",
        links={HOSTILE: "other.html"},
        motions=motions,
    )
    assert page.evaluate("document.title") == HOSTILE
    said = page.evaluate(
        "[...document.querySelectorAll('#panel-about p, #panel-about li, #panel-about a')].map(e => e.textContent)"
    )
    assert said.count(HOSTILE) >= 3
    assert page.evaluate("document.querySelectorAll('img').length") == 0
    assert page.evaluate("globalThis.hacked ?? null") is None


def test_it_is_small_and_ready_soon(visit, tmp_path):
    view = View(Arm.load("planar2r").description)
    size = view.save_html(tmp_path / "size.html", interactive=True).stat().st_size
    start = time.perf_counter()
    page = visit(view)
    took = time.perf_counter() - start
    print(f"interactive page without meshes: {size} bytes, ready in {took:.1f} s")
    assert size < LARGEST
    in_time(took, 2 * READY)
    assert page.evaluate("dhkit.lab.state.tool.xyz.length") == 3


CUT = """(() => {
  const panels = document.querySelector('#lab .panels').getBoundingClientRect();
  return [...document.querySelectorAll('#lab button, #lab input, #lab select, #lab a, #tools button, #player button')]
    .filter(e => e.offsetWidth && !e.closest('.tabs'))
    .map(e => [e.ariaLabel || e.textContent.trim(), e.getBoundingClientRect()])
    .filter(([, box]) => box.left < -0.5 || box.right > innerWidth + 0.5 || (box.left < panels.right && box.right > panels.right + 0.5 && box.bottom > panels.top && box.top < panels.bottom))
    .map(([name]) => name);
})()"""
UNNAMED = (
    "[...document.querySelectorAll('input, select, button, summary')]"
    ".filter(e => e.offsetWidth && !(e.ariaLabel || e.textContent.trim() || e.labels?.length)).map(e => e.outerHTML)"
)


@pytest.mark.parametrize(
    "sizes", [[(390, 844)], [(768, 1024), (1280, 800)]], ids=["small", "large"]
)
def test_nothing_is_cut_off_and_all_is_named(visit, sizes):
    """Whether the readout is open is decided once, by the size of the page that is loaded."""
    arm = Arm.load("puma560")
    q = np.array(arm.configurations["ready"])
    page = visit(View(arm.description), *sizes[0], motions={"up": ([0, 1], [q, q + 0.3])}, caption="A caption.", links={"equations": "e.html"})  # fmt: skip
    page.evaluate("dhkit.player.pause()")
    for size in sizes:
        page.resize(*size)
        for name in ("about", "joints", "tool", "table", "recorded"):
            page.evaluate(f"document.getElementById('tab-{name}').click()")
            page.settle()
            where = f"{name} at {size}"
            assert page.evaluate(CUT) == [], where
            assert page.evaluate(UNNAMED) == [], where
            assert page.evaluate("document.documentElement.scrollWidth") <= size[0], where


def test_it_works_in_a_sandboxed_frame_as_notebooks_have_it(chromium, signal_arm, tmp_path):
    import html as markup

    text = View(signal_arm).html(interactive=True)
    page = chromium.page()
    frame = f'<iframe sandbox="allow-scripts" srcdoc="{markup.escape(text)}" style="width:860px;height:640px"></iframe>'
    (tmp_path / "frame.html").write_text(f"<!doctype html><body data-ready=1>{frame}")
    page.call("Page.navigate", url=f"file://{tmp_path}/frame.html")
    wait_for(lambda: shows_the_arm(page.screenshot()), f"the arm ({page.errors})")
    page.close()
    assert page.errors == []


@pytest.mark.parametrize(
    ("links", "error"),
    [
        ({"x": "javascript:void(globalThis.hacked=1)"}, ValueError),
        ({"x": " java\nscript:alert(1)"}, ValueError),
        ({"x": "data:text/html,x"}, ValueError),
        ({"x": "file:///etc/passwd"}, ValueError),
        ({"x": 1}, TypeError),
        ({"x": None}, TypeError),
    ],
)
def test_links_lead_to_pages_alone(links, error):
    view = View(Arm.load("planar2r").description)
    with pytest.raises(error, match="links"):
        view.html(interactive=True, links=links)


def test_relative_and_web_addresses_are_links(visit):
    links = {
        "a": "other.html",
        "b": "a/b.html#c",
        "c": "https://example.org/x:y",
        "d": "mailto:a@b.org",
        "e": "?q=a:b",
    }
    page = visit(View(Arm.load("planar2r").description), links=links, caption="links")
    assert page.evaluate(
        "[...document.querySelectorAll('#panel-about a')].map(a => a.getAttribute('href'))"
    ) == list(links.values())


def test_a_long_motion_and_a_short_excess_are_told():
    from dhkit.viewer.interactive import _motion_state

    arm = Arm.load("planar2r")
    t = np.linspace(0, 40, 40001)
    q = np.zeros((40001, 2))
    q[20010:20030, 0] = 1e3
    assert _motion_state(arm.description, "spike", (t, q))["excess"] is not None
    t = np.linspace(0, 36000, 360001)
    state = _motion_state(arm.description, "long", (t, np.c_[np.sin(2 * np.pi * t / 60), 0 * t]))
    assert np.ptp(np.array(state["q"])[:, 0]) > 1.9
    assert state["step"] == pytest.approx(6.0)


def test_entries_that_nobody_changed_are_not_read_again(visit):
    arm = Arm(
        from_dh(
            [(0, 0, 0.3, 0), (0, 0, "abs(l1)", 0)],
            order=("theta", "d", "a", "alpha"),
            parameters={"l1": -0.4},
        )
    )
    page = visit(View(arm.description))
    assert page.evaluate("dhkit.lab.ask('table.edit', { row: 0, column: 'a', text: '0.5' })") == {
        "error": None
    }
    tool_is(page, with_entry(arm, 0, "a", "0.5"))
    # A good entry counts also where it was typed while another was bad.
    page.evaluate("dhkit.lab.ask('table.edit', { row: 0, column: 'a', text: 'x' })")
    page.evaluate("dhkit.lab.ask('table.edit', { row: 1, column: 'd', text: '0.2' })")
    page.evaluate("dhkit.lab.ask('table.edit', { row: 0, column: 'a', text: '0.6' })")
    tool_is(page, with_entry(with_entry(arm, 0, "a", "0.6"), 1, "d", "0.2"))
