"""A lab without pages."""

import pytest

from dhkit import Arm
from dhkit.lab import Assignment, Lab


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
        page.until("globalThis.dhkit?.lab?.state.control && dhkit.lab.state.table && dhkit.lab.state.waypoints")
        return lab, page

    yield make
    for page, url in pages:
        own = url.removeprefix("http://").split("/")[0]
        hosts = {address.split("/")[2] for address in page.requests if not address.startswith(("data:", "blob:"))}
        errors = page.errors
        page.close()
        assert errors == []
        assert hosts == {own}


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
