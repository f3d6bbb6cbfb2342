"""Doctests, README's among them, run in a scratch folder with docs/ in it: what they write is gone with it."""

from pathlib import Path

import pytest
from _pytest.doctest import DoctestItem


@pytest.fixture(autouse=True)
def _doctests_write_elsewhere(request):
    if isinstance(request.node, DoctestItem):
        # Asked for here: a folder for each of 9,000 tests takes a minute.
        tmp_path = request.getfixturevalue("tmp_path")
        (tmp_path / "docs").symlink_to(Path(__file__).resolve().parent / "docs")
        request.getfixturevalue("monkeypatch").chdir(tmp_path)
