"""The panels of dynamics, workspace, transforms and answers in a headless Chromium, driven as a person does."""

# ruff: noqa: E501 - JavaScript in one line

import base64
import json

import numpy as np
import pytest
from scipy.io import savemat

from dhkit import Arm
from dhkit.description import pose
from lab.controls import button, labelled, panel, set_joints

PRINTED = 5.1e-5
"""Half of the last digit of an entry of M, and rounding."""
HALF_A_DIGIT = 5.1e-4
"""Half of the last digit of a vertex on the page, m, and rounding."""
HALF_A_DIGIT_OF_A_LENGTH = 5.1e-5
"""The same of a length in the unit of the page, m."""
TORQUE = 5.1e-3
"""N m: the same of a torque."""
HOSTILE = '<img src=x onerror="globalThis.hacked=1">'


def texts(page, selector):
    return page.evaluate(
        f"[...document.querySelectorAll({json.dumps(selector)})].map(e => e.textContent)"
    )


@pytest.mark.parametrize("name", ["puma560", "stanford"])
def test_dynamics_shows_the_numbers_of_the_state_and_formulas(open_page, name):
    lab, page = open_page(name)
    lab.answer("joints.named", {"name": "nominal"})
    panel(page, "dynamics")
    arm = lab.desk.arm
    for q in (lab.desk.q, lab.desk.q + 0.1):
        set_joints(lab, page, q.tolist())
        M, g = arm.mass_matrix(q), arm.gravity_torque(q)
        page.until(
            f"Math.abs(Number(document.querySelector('#panel-dynamics td button')?.textContent) - {M[0, 0]}) < {PRINTED}"
        )
        shown = np.reshape([float(x) for x in texts(page, "#panel-dynamics td button")], M.shape)
        assert np.abs(shown - M).max() < PRINTED
        torques = [float(text.split()[0]) for text in texts(page, "#panel-dynamics .bar .value")]
        assert np.abs(np.array(torques) - g).max() < TORQUE
    page.click(labelled("M22"))
    page.until("document.querySelector('#panel-dynamics .entry math')")
    assert texts(page, "#panel-dynamics .entry math")[0].startswith("M22=")
    page.click(button("Velocity ellipsoid"))
    page.until("dhkit.stage.overlays.layers.ellipsoids.group.children.length === 1")
    page.click(button("Velocity ellipsoid"))
    page.until("dhkit.stage.overlays.layers.ellipsoids.group.children.length === 0")


def test_torques_are_those_of_the_motion_or_the_controller_that_moves_the_arm(open_page):
    lab, page = open_page("planar2r")
    heading = "document.querySelector('#panel-dynamics h2').textContent"
    panel(page, "dynamics")
    page.until(f"{heading} === 'Gravity torques'")
    lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": [0.9, -0.4]}, "duration": 1.0})
    page.until("dhkit.player.active && dhkit.lab.state.motion")
    page.evaluate("dhkit.player.pause(), dhkit.player.seek(0.5)")
    page.until(f"{heading} === 'Torques of the motion'")
    tau = lab._motions.motion.tau(0.5)
    value = "parseFloat(document.querySelector('#panel-dynamics .bar .value').textContent)"
    page.until(f"Math.abs({value} - {tau[0]}) < {2 * TORQUE}")
    lab.answer("motion.clear", {})
    lab.answer("control.start", {"controller": "pd"})
    page.until(f"{heading} === 'Torques of the controller'")
    lab.answer("control.stop", {})
    page.until(f"{heading} === 'Gravity torques'")


def test_limits_of_torques_are_marked_on_both_sides_where_they_are_in_the_scale(kept_page):
    lab, page = kept_page("puma560")
    panel(page, "dynamics")
    page.until("document.querySelectorAll('#panel-dynamics .bar').length === 6")
    set_joints(lab, page, [0.2, 0.3, -0.3, 0.4, 0.7, 0.2])
    g = lab.desk.arm.gravity_torque(lab.desk.q)
    limit = lab.desk.arm.description.numbers.effort / np.abs(g).max()
    page.until(
        f"Math.abs(parseFloat(document.querySelectorAll('#panel-dynamics .bar .value')[1].textContent) - {g[1]}) < {TORQUE}"
    )
    marks = page.evaluate(
        "[...document.querySelectorAll('#panel-dynamics .bar')]"
        ".map(bar => [...bar.querySelectorAll('b')].map(b => b.hidden ? null : parseFloat(b.style.left)))"
    )
    for share, places in zip(limit, marks, strict=True):
        if share > 1:
            assert places == [None, None]
        else:
            assert places == pytest.approx([50 - 50 * share, 50 + 50 * share], abs=0.1)
    assert any(limit <= 1)
    assert not page.evaluate("document.querySelector('#panel-dynamics .key').hidden")


def test_the_mass_matrix_of_seven_joints_fits_the_panel(kept_page):
    _, page = kept_page("panda")
    panel(page, "dynamics")
    page.until("document.querySelectorAll('#panel-dynamics td button').length === 49")
    assert page.evaluate(
        "[...document.querySelectorAll('#panel-dynamics .wide, #panel-dynamics td button, #panel-dynamics .bar button')]"
        ".every(e => e.scrollWidth <= e.clientWidth + 1)"
    )


def test_an_arm_without_masses_says_what_to_do(open_page):
    _, page = open_page(Arm.from_dh([[0, 0.4, 0, "pi/2"], [0, 0, 0.3, 0]]))
    panel(page, "dynamics")
    page.until(
        "document.querySelector('#panel-dynamics .note').textContent.includes('assume uniform links')"
    )
    page.until(
        "document.querySelector('#panel-dynamics .facts').textContent.includes('manipulability')"
    )


def test_the_workspace_is_drawn_and_the_distance_is_live(kept_page):
    lab, page = kept_page("planar2r")
    panel(page, "workspace")
    page.choose(labelled("Workspace"), "points")
    page.until("dhkit.stage.overlays.layers.points.group.children.length === 1")
    page.until(
        "document.querySelector('#panel-workspace .note').textContent.startsWith('10,000 points')"
    )
    l1, l2 = lab.desk.arm.description.numbers.a
    for q in ([0.3, 0.4], [1.0, 2.0]):
        set_joints(lab, page, q)
        radius = float(np.linalg.norm(lab.desk.arm.fk(q)[:3, 3]))
        distance = min(
            l1 + l2 - radius, abs(radius - abs(l1 - l2)) if abs(l1 - l2) > 1e-6 else np.inf
        )
        page.until(
            f"Math.abs(parseFloat(document.querySelector('#panel-workspace .distance').textContent) - {distance}) < {HALF_A_DIGIT_OF_A_LENGTH}"
        )
    page.evaluate("dhkit.lab.setUnits({ length: 'mm' })")
    assert texts(page, "#panel-workspace .distance")[0].startswith(f"{1000 * distance:.1f} mm from")
    page.choose(labelled("Workspace"), "none")
    page.until("dhkit.stage.overlays.layers.points.group.children.length === 0")


@pytest.mark.slow
def test_a_box_is_turned_and_moved_step_by_step(open_page):
    _, page = open_page("puma560")
    panel(page, "transforms")
    page.until("dhkit.lab.state.solid.vertices.length === 8")
    page.click(labelled("amount of step 1"))
    page.write("45°")
    page.click(button("Add a step"))
    page.choose(labelled("kind of step 2"), "move")
    page.choose(labelled("axis of step 2"), "y")
    page.click(labelled("amount of step 2"))
    page.write("0.5")
    page.click(button("Apply step by step"))
    page.until("document.querySelectorAll('#panel-transforms .step li').length === 2")
    T = pose(euler=(np.pi / 4, 0, 0), order="ZYX") @ pose((0, 0.5, 0))
    own = "dhkit.lab.panels.find(p => p.name === 'transforms').panel"
    page.until(f"{own}.T.every((x, i) => Math.abs(x - {T.ravel().tolist()}[i]) < 1e-12)")
    assert texts(page, "#panel-transforms .step math")[3].startswith("T2=T1")
    assert "T1−1p" in "".join(texts(page, "#panel-transforms .step math")).replace(" ", "")
    # Numbers stand at the vertices, where the page projects them.
    labels = page.evaluate(f"{own}.labels.labels.length")
    assert labels == 8
    after = page.evaluate(
        "[...document.querySelectorAll('#panel-transforms tbody tr')].map(r => [...r.cells].slice(4).map(c => Number(c.textContent)))"
    )
    vertices = np.array(page.evaluate("dhkit.lab.state.solid.vertices"))
    difference = np.array(after) - (vertices @ T[:3, :3].T + T[:3, 3])
    assert np.abs(difference).max() < HALF_A_DIGIT
    page.click("document.querySelector('#panel-transforms input[type=checkbox]')")
    assert page.evaluate("dhkit.stage.nodes.every(node => !node.visible)")
    panel(page, "joints")
    assert page.evaluate(f"dhkit.stage.nodes.every(node => node.visible) && !{own}.group.visible")
    panel(page, "transforms")
    page.click(labelled("amount of step 1"))
    page.write("many")
    page.click(button("Apply step by step"))
    page.until("document.querySelector('#lab .message').textContent.startsWith('step 1: amount')")


def test_an_answer_is_judged_on_the_page(kept_page):
    _, page = kept_page("planar2r")
    panel(page, "answers")
    assert "m1, m2" in texts(page, "#panel-answers .hint")[0]
    page.evaluate(f"{labelled('Answer')}.value = 'M22 = m2*l2^2/3\\ng2 = m2*g*l2*c2/2'")
    page.click(button("Judge"))
    page.until("document.querySelectorAll('#panel-answers article').length === 2")
    assert texts(page, "#panel-answers h3") == ["M22: correct", "g2: wrong"]
    assert page.evaluate("document.querySelectorAll('#panel-answers article math').length") == 3
    assert "angle" in texts(page, "#panel-answers .diagnosis")[0]
    page.evaluate(f"{labelled('Answer')}.value = {json.dumps(f'V = {HOSTILE}')}")
    page.click(button("Judge"))
    page.until("document.querySelectorAll('#panel-answers article').length === 1")
    assert texts(page, "#panel-answers h3") == ["V: unreadable"]
    assert texts(page, "#panel-answers .verdict") == ["0 of 1 right"]
    assert page.evaluate("document.querySelectorAll('img').length") == 0
    assert page.evaluate("globalThis.hacked ?? null") is None


def test_a_long_sum_is_broken_before_its_signs_into_lines_that_fit(kept_page):
    _, page = kept_page("planar2r")
    panel(page, "answers")
    terms = "<mo>+</mo>".join(
        f"<mn>{k}.2345678</mn><msub><mi>c</mi><mn>{k}</mn></msub>" for k in range(1, 9)
    )
    text = f"<math><mrow><mo>\u2212</mo>{terms}</mrow></math>"
    width = 250
    lines, whole, widths = page.evaluate(
        f"import('./lab/formula.js').then(({{ formula, formulaLines }}) => {{ const text = {json.dumps(text)};"
        f" const box = document.createElement('div'); box.className = 'entry'; box.append(...formulaLines(text, {width}));"
        " document.getElementById('panel-answers').append(box); const lines = [...box.children];"
        " const found = [lines.map(e => e.textContent), formula(text).textContent, lines.map(e => e.getBoundingClientRect().width)];"
        " box.remove(); return found; })"
    )
    assert len(lines) > 1
    assert "".join(lines) == whole
    assert all(line.startswith("+") for line in lines[1:])
    assert max(widths) <= width


def test_formulas_take_over_mathematics_alone(kept_page):
    _, page = kept_page("planar2r")
    hostile = "<math><mi href='javascript:globalThis.hacked=1' style='color:red'>x</mi><script xmlns='http://www.w3.org/1999/xhtml'>globalThis.hacked=1</script></math>"
    found = page.evaluate(
        f"import('./lab/formula.js').then(({{ formula }}) => {{ const e = formula({json.dumps(hostile)}); document.body.append(e); return [e.outerHTML, formula('<math><mi>'), formula('')]; }})"
    )
    assert "href" not in found[0]
    assert "style" not in found[0]
    assert "<script" not in found[0]
    assert found[1:] == [None, None]
    assert page.evaluate("globalThis.hacked ?? null") is None


@pytest.mark.parametrize("sizes", [[(390, 844)], [(768, 800), (1280, 720)]], ids=["small", "large"])
def test_every_panel_fits_and_names_its_controls(open_page, sizes):
    """Whether the readout is open is decided once, by the size of the page that is loaded."""
    _, page = open_page("puma560", width=sizes[0][0], height=sizes[0][1])
    for size in sizes:
        page.resize(*size)
        for name in ("dynamics", "workspace", "transforms", "answers"):
            where = f"{name} at {size}"
            page.evaluate(f"document.getElementById('tab-{name}').click()")
            page.settle()
            assert page.evaluate(
                f"document.getElementById('panel-{name}').scrollWidth <= document.getElementById('panel-{name}').clientWidth + 1"
            ), where
            unnamed = page.evaluate(
                f"[...document.querySelectorAll('#panel-{name} :is(input, select, button, textarea)')]"
                ".filter(e => e.offsetWidth && !(e.ariaLabel || e.textContent.trim() || e.labels?.length)).map(e => e.outerHTML)"
            )
            assert unnamed == [], where
            assert page.evaluate("document.documentElement.scrollWidth") <= size[0], where
    assert Arm.load("puma560").n == page.evaluate(
        "document.querySelectorAll('#panel-dynamics .bar').length"
    )


def test_a_target_out_of_reach_stays_in_the_fields_until_it_is_in_reach(kept_page):
    lab, page = kept_page("planar2r")
    set_joints(lab, page, [np.pi / 2, 0.0])
    panel(page, "tool")
    page.click(button("Move the tool by a target"))
    page.until("dhkit.lab.state.target?.reached")
    page.click(labelled("x of the tool"))
    page.write("0.5")
    page.until("dhkit.lab.state.target && !dhkit.lab.state.target.reached")
    assert page.evaluate(
        f"[{labelled('x of the tool')}.value, {labelled('x of the tool')}.getAttribute('aria-invalid')]"
    ) == [
        "0.50000",
        "true",
    ]
    page.click(labelled("y of the tool"))
    page.write("0.3")
    page.until("dhkit.lab.state.target.reached")
    assert np.abs(lab.desk.arm.fk(lab.desk.q)[:2, 3] - [0.5, 0.3]).max() < 1e-6
    page.until(f"{labelled('x of the tool')}.getAttribute('aria-invalid') === 'false'")


def test_what_is_said_of_a_target_is_not_said_of_another_state(open_page):
    lab, page = open_page("stanford")
    lab.answer("joints.named", {"name": "ready"})
    panel(page, "tool")
    page.click(button("Move the tool by a target"))
    page.until("dhkit.lab.state.target?.reached")
    lab.answer("joints.named", {"name": "nominal"})
    note = "document.querySelector('#panel-tool .note').textContent"
    page.until(f"{note}.startsWith('the tool is not at the target')")
    assert "singular" not in page.evaluate(note)


def test_columns_of_a_mat_file_are_chosen(open_page, tmp_path):
    lab, page = open_page("planar2r")
    t = np.linspace(0.0, 1.0, 11)
    q = np.column_stack([0.2 * t, 0.1 * t])
    savemat(tmp_path / "log.mat", {"log": np.column_stack([t, q, q])})
    content = base64.b64encode((tmp_path / "log.mat").read_bytes()).decode()
    panel(page, "motion")
    field = labelled("File with a motion")
    page.evaluate(
        f"""(() => {{
          const data = Uint8Array.from(atob("{content}"), letter => letter.charCodeAt(0));
          const files = new DataTransfer();
          files.items.add(new File([data], "log.mat"));
          {field}.files = files.files;
          {field}.dispatchEvent(new Event("change"));
        }})()"""
    )
    page.until(f"{labelled('Joint values')}.offsetWidth")
    values = page.evaluate(f"[...{labelled('Joint values')}.options].map(option => option.value)")
    assert values == ["log(:,2:3)", "log(:,4:5)"]
    page.click(button("Read these"))
    page.until("dhkit.lab.state.motion")
    assert np.allclose(lab._motions.motion.q(0.5), [0.1, 0.05])
    page.until(f"!{labelled('Joint values')}.offsetWidth")  # the answer comes after the state


@pytest.mark.slow
def test_a_motion_is_saved_as_a_video(open_page):
    lab, page = open_page("planar2r")
    panel(page, "motion")
    lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": [0.5, 0.8]}, "duration": 1.0})
    page.until("dhkit.lab.state.motion && dhkit.player.active")
    page.evaluate(
        """(() => {
          let content = null;
          URL.createObjectURL = blob => { content = blob.arrayBuffer(); return "#"; };
          HTMLAnchorElement.prototype.click = async function () {
            const bytes = new Uint8Array(await content);
            globalThis.saved = [this.download, bytes.length, [...bytes.slice(0, 4)]];
          };
        })()"""
    )
    page.click(button("Video"))
    page.until("globalThis.saved")
    name, size, head = page.evaluate("globalThis.saved")
    assert name == "planar2r-motion.webm"
    assert bytes(head) == b"\x1aE\xdf\xa3"  # EBML
    assert size > 5_000
    page.until("!dhkit.player.playing")


def test_on_a_phone_the_chosen_tab_is_in_view_and_the_player_is_not_covered(open_page):
    lab, page = open_page("puma560", width=390, height=844)
    lab.answer(
        "motion.plan", {"kind": "quintic", "goal": {"q": (0.9 * lab.desk.q + 0.01).tolist()}}
    )
    page.until("dhkit.lab.state.motion && !document.getElementById('player').hidden")
    for name in ("transforms", "joints", "control"):
        page.evaluate(f"dhkit.lab.openPanel('{name}')")
        page.settle()
        left, right = page.evaluate(
            f"(({{ left, right }}) => [left, right])(document.getElementById('tab-{name}').getBoundingClientRect())"
        )
        assert left >= -1
        assert right <= 391
    boxes = page.evaluate(
        "['#dock header > button', '#player', '#world', '#lab'].map(s => document.querySelector(s).getBoundingClientRect())"
        ".map(({ left, top, right, bottom }) => [left, top, right, bottom])"
    )
    for k, (left, top, right, bottom) in enumerate(boxes):
        for other in boxes[k + 1 :]:
            assert right <= other[0] or other[2] <= left or bottom <= other[1] or other[3] <= top


def test_the_scene_has_shadows_once_it_is_at_rest(kept_page):
    lab, page = kept_page("puma560")
    page.until("dhkit.stage.fine")
    assert page.evaluate("dhkit.stage.key.castShadow && dhkit.stage.floor.visible")
    set_joints(lab, page, (lab.desk.q + 0.05).tolist())
    page.until("!dhkit.stage.fine")
    page.until("dhkit.stage.fine")
    assert page.evaluate("dhkit.stage.key.castShadow")


def test_the_axes_of_the_world_and_the_grid_are_explained(kept_page):
    _, page = kept_page("puma560")
    assert texts(page, "#world small") == ["grid 0.2 m"]
    page.evaluate("dhkit.lab.setUnits({ length: 'mm' })")
    assert texts(page, "#world small") == ["grid 200 mm"]
    page.evaluate("dhkit.stage.look('top')")
    page.settle()
    widths, heights = page.evaluate(
        "['width', 'height'].map(side => [...document.querySelectorAll('#world i')].map(e => e.getBoundingClientRect()[side]))"
    )
    # x points to the right, y up and z at the camera; a line is 2.4 px thick.
    assert (widths[0], heights[1]) == pytest.approx((24, 24), abs=0.5)
    assert max(heights[0], widths[1], widths[2], heights[2]) < 3
    page.evaluate("dhkit.stage.resetCamera()")
