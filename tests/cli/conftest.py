"""What tests of the command share."""

import pytest


class AtOnce:
    """A timer that does not wait."""

    def __init__(self, seconds, function):
        self.start = function

    def cancel(self):
        pass

    def is_alive(self):
        return False


@pytest.fixture
def bar_at_once(monkeypatch):
    """Show the progress bar from the start, as to somebody who looks at a terminal."""
    monkeypatch.setattr("dhkit.cli.progress.threading.Timer", AtOnce)
    monkeypatch.setattr("_pytest.capture.CaptureIO.isatty", lambda stream: True)  # of capsys
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
