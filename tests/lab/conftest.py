"""Labs without pages, and with one."""

import json

import pytest

from dhkit import Arm
from dhkit.lab import Assignment, Lab
from lab.test_requests import states

COMPLETE = (
    "globalThis.dhkit?.lab?.state.control && dhkit.lab.state.table && dhkit.lab.state.waypoints"
)
"""Whether a page has been told everything, as JavaScript."""


@pytest.fixture
def open_lab():
    """Return what opens labs, each closed at the end."""
    opened = []

    def make(name):
        lab = Lab(name if isinstance(name, Arm) else Arm.load(name))
        opened.append(lab)
        return lab

    yield make
    for lab in opened:
        lab.close()


@pytest.fixture
def open_page(chromium, open_lab):
    """Return what opens a lab and a page on it, checked at the end: no error, and no request to anyone else."""
    pages = []

    def make(name, **size):
        lab = open_lab(name)
        page = chromium.page(**({"width": 1280, "height": 800} | size))
        pages.append((page, lab.url))
        page.open(lab.url)
        page.until(COMPLETE)
        return lab, page

    yield make
    for page, _ in pages:
        page.close()
    for page, url in pages:
        check_errors_and_requests(page, url)


def check_errors_and_requests(page, url):
    """Check that a page has met no error, which it forgets, and made no request to anyone else."""
    errors, page.errors = page.errors, []
    assert errors == []
    hosts = {
        address.split("/")[2]
        for address in page.requests
        if not address.startswith(("data:", "blob:"))
    }
    assert hosts == {url.removeprefix("http://").split("/")[0]}


@pytest.fixture(scope="module")
def kept_pages(chromium):
    """Return what opens a lab and a page on it, once for each arm of a module, and the first joint values."""
    opened = {}

    def make(name):
        if name not in opened:
            lab, page = Lab(Arm.load(name)), chromium.page(width=1280, height=800)
            opened[name] = lab, page, lab.desk.q.tolist()
            page.open(lab.url)
            page.until(COMPLETE)
        return opened[name]

    yield make
    for lab, page, _ in opened.values():
        page.close()
        lab.close()


@pytest.fixture
def kept_page(kept_pages):
    """Return what resets a lab of an arm and a page that other tests have used; checked at the end like others.

    It is for tests of joints, tool, table, motions and what is computed beside them; what runs or is locked has a lab
    of its own.
    """
    used = []

    def make(name):
        lab, page, q = kept_pages(name)
        used.append((lab, page))
        for request in ("motion.cancel", "motion.clear", "tool.clear", "waypoints.clear"):
            lab.answer(request, {})
        if states(lab)["table"]["changed"]:
            lab.answer("table.reset", {})
        lab.answer("joints.set", {"q": q})
        page.until(
            "(({ joints, target, motion, table, waypoints }) => !target && !motion && !table.changed"
            f" && !waypoints.length && JSON.stringify(joints.q) === JSON.stringify({json.dumps(q)}))(dhkit.lab.state)"
        )
        page.resize(1280, 800)
        page.evaluate(
            "dhkit.lab.setUnits({ angle: 'deg', length: 'm' }), dhkit.lab.openPanel('joints'),"
            " dhkit.lab.message.hidden = true"
        )
        page.settle()
        return lab, page

    yield make
    for lab, page in used:
        check_errors_and_requests(page, lab.url)


@pytest.fixture
def read(tmp_path):
    """Return what reads an assignment of a text."""

    def make(text):
        file = tmp_path / "task.toml"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return Assignment.read(file)

    return make


@pytest.fixture
def begin():
    """Return what opens labs with an assignment, each closed at the end."""
    opened = []

    def make(assignment, **options):
        lab = Lab(assignment.arm, assignment=assignment, **options)
        opened.append(lab)
        return lab

    yield make
    for lab in opened:
        lab.close()
