"""What tests of files share: bytes damaged by chance, and complaints in one line."""

import pytest
from hypothesis import strategies as st

from dhkit.errors import DescriptionError

LONGEST = 700  # characters of a complaint


def check_damaged(draw, read, path):
    """Check that a file with damaged or missing bytes is read, or refused in one line.

    Parameters
    ----------
    draw
        Hypothesis's.
    read
        Called with the path; anything but a DescriptionError fails the test.
    path
        A good file, which is overwritten.
    """
    content = bytearray(path.read_bytes())
    for _ in range(draw(st.integers(1, 4))):
        content[draw(st.integers(0, len(content) - 1))] = draw(st.integers(0, 255))
    path.write_bytes(
        content[: draw(st.integers(0, len(content)))] if draw(st.booleans()) else content
    )
    try:
        read(path)
        message = ""
    except DescriptionError as error:
        message = str(error)
    assert "\n" not in message
    assert len(message) < LONGEST


def check_refused(read, path, complaint):
    """Check that a file is refused in one line that begins with its name and matches a complaint."""
    with pytest.raises(DescriptionError, match=complaint) as error:
        read(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)
