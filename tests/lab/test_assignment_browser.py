"""Assignments in a headless Chromium: tabs, goals and texts."""

# ruff: noqa: E501 - JavaScript in one line

import json
import os
from pathlib import Path

import pytest

from bad_assignments import GOOD
from dhkit.lab import Assignment
from dhkit.lab.assignment_form import PANELS
from lab.test_assignment import EXAMPLES, met
from waiting import wait_for

HOSTILE = "<img src=x onerror=window.hacked=1>"


@pytest.fixture
def visit(chromium, begin):
    """Return what opens a lab with an assignment and a page on it, checked at the end."""
    pages = []

    def make(assignment, **size):
        lab = begin(assignment)
        page = chromium.page(**({"width": 1280, "height": 800} | size))
        pages.append(page)
        page.open(lab.url)
        page.until(
            "globalThis.dhkit?.lab?.state.control && dhkit.lab.state.task !== undefined && dhkit.lab.state.own !== undefined"
        )
        return lab, page

    yield make
    for page in pages:
        errors = page.errors
        page.close()
        assert errors == []


TABS = "[...document.querySelectorAll('#lab .tabs button')].filter(b => b.offsetWidth).map(b => b.id.slice(4))"
WORDS = "[...document.querySelectorAll('.tasks details')].map(d => [...d.querySelectorAll('.word')].map(w => w.textContent))"


def sheets(tmp_path):
    """Return where pictures go: DHKIT_SHEETS, or the test's own folder."""
    folder = Path(os.environ.get("DHKIT_SHEETS", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def test_a_person_does_a_goal_of_the_example(visit, tmp_path):
    lab, page = visit(Assignment.read(EXAMPLES[1]))
    assert page.evaluate(TABS) == [
        "task",
        "joints",
        "tool",
        "motion",
        "table",
        "control",
        "transforms",
    ]
    assert page.evaluate("document.getElementById('panel-task').hidden") is False
    assert (
        page.evaluate("document.querySelector('#panel-task h2').textContent")
        == "The PUMA simulator in four steps"
    )
    assert page.evaluate("[...document.querySelectorAll('.tasks details')].map(d => d.open)") == [
        True,
        False,
        False,
        False,
    ]
    assert page.evaluate(WORDS) == [["to do"] * count for count in (2, 2, 4, 3)]
    page.click("document.querySelector('.tasks details:nth-child(2) summary')")
    page.click(
        "[...document.querySelectorAll('.tasks button')].find(b => b.offsetWidth && /DH table/.test(b.textContent))"
    )
    assert page.evaluate("document.getElementById('panel-table').hidden") is False
    page.click("document.getElementById('tab-joints')")
    slider = "document.querySelector('#lab [aria-label=\"waist\"]')"
    x, y = page.centre(slider)
    page.drag([(x, y), (x + 20, y), (x + 60, y)])
    wait_for(lambda: lab.desk.q[0] > 0.1)
    page.click("document.querySelector('#lab [aria-label=\"waist, value\"]')")
    page.write("90")
    page.until("/^Done: Links 1 to 6/.test(document.querySelector('#lab .message').textContent)")
    page.click("document.getElementById('tab-task')")
    assert page.evaluate(WORDS)[0] == ["done", "to do"]
    assert page.evaluate("document.querySelector('.goals .met .sign').textContent") == "✓"
    assert (
        page.evaluate("document.querySelector('#panel-task .facts').textContent")
        == "1 of 15 points, 1 of 11 goals"
    )
    for scheme in ("light", "dark"):
        page.scheme(scheme)
        page.settle()
        page.screenshot(sheets(tmp_path) / f"task-{scheme}.png")
    page.click("document.getElementById('tab-motion')")
    page.open(lab.url)  # loaded anew it stays at the panel that was open, and shows what was done
    page.until("globalThis.dhkit?.lab?.state.task && dhkit.lab.state.own !== undefined")
    assert page.evaluate("document.getElementById('panel-motion').hidden") is False
    assert page.evaluate(WORDS)[0] == ["done", "to do"]
    page.click("document.getElementById('tab-task')")
    page.click(
        "[...document.querySelectorAll('#panel-task button')].find(b => b.textContent === 'Reset')"
    )
    page.until(f"({WORDS})[0][0] === 'to do'")
    assert met(lab) == [False] * 11


def test_texts_are_texts_and_the_order_of_states_does_not_matter(visit, read, open_lab):
    hostile = GOOD.replace('"some words"', json.dumps(f"{HOSTILE}\n\nb & c")).replace(
        '"T"', json.dumps(HOSTILE)
    )
    hostile = hostile.replace('"one"', json.dumps(HOSTILE)).replace('"a"', json.dumps(HOSTILE))
    _, page = visit(read(hostile))
    texts = "[...document.querySelectorAll('.tasks p')].map(p => p.textContent)"
    assert page.evaluate(texts) == [HOSTILE, "b & c"]
    for place in ("#panel-task h2", ".goals li span:nth-child(2)"):
        assert page.evaluate(f"document.querySelector({json.dumps(place)}).textContent") == HOSTILE
    page.images_have_failed()
    assert page.evaluate(
        "[document.querySelectorAll('img').length, globalThis.hacked ?? null]"
    ) == [0, None]
    told = (
        "(names => { const { task } = dhkit.lab.state, own = { file: 'mine.py', functions: [] };"
        " for (const name of names) dhkit.lab.take({ name, data: { task, own }[name] }); })"
    )
    for names in (["task", "own"], ["own", "task"]):
        page.evaluate(f"{told}({names})")
        assert page.evaluate(TABS) == ["task", "joints", "motion"]
    page.evaluate(
        "dhkit.lab.take({ name: 'task', data: { ...dhkit.lab.state.task, panels: null } })"
    )
    assert page.evaluate(TABS) == ["task", *PANELS]
    page.evaluate("dhkit.lab.take({ name: 'task', data: null })")
    assert page.evaluate(TABS) == [*PANELS]
    assert page.evaluate("document.getElementById('panel-joints').hidden") is False
