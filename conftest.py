"""Doctests, README's among them, run in a scratch folder with docs/ in it: what they write is gone with it."""

from pathlib import Path

import pytest
from _pytest.doctest import DoctestItem


@pytest.fixture(autouse=True)
def _doctests_write_elsewhere(request, tmp_path, monkeypatch):
    if isinstance(request.node, DoctestItem):
        (tmp_path / "docs").symlink_to(Path(__file__).resolve().parent / "docs")
        monkeypatch.chdir(tmp_path)
