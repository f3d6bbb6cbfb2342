"""A lab without pages."""

import pytest

from dhkit import Arm
from dhkit.lab import Lab


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
