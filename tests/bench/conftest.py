"""No figure is judged in these tests: garbage stays where it is, and a millisecond tells as much as a second."""

from types import SimpleNamespace

import pytest

from dhkit.bench import Mode, rounds


@pytest.fixture(autouse=True)
def short_rounds(monkeypatch):
    """Each call is timed for a moment; among the objects of all tests collecting garbage takes half a second."""
    monkeypatch.setattr(rounds, "MIN_TIMING", 1e-4)
    monkeypatch.setattr(rounds, "BUDGET", dict.fromkeys(Mode, 1e-3))
    nothing = dict.fromkeys(("collect", "disable", "enable"), lambda: None)
    monkeypatch.setattr(rounds, "gc", SimpleNamespace(isenabled=lambda: True, **nothing))
