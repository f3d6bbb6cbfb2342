"""Exit statuses of the command."""

from enum import IntEnum


class ExitStatus(IntEnum):
    """What the command returns to the shell."""

    FINE = 0
    NO = 1
    """The answer is no: not verified, answer wrong, unreachable."""
    UNUSABLE = 2
    """Unusable input; one line on stderr says what and where."""
    INTERRUPTED = 130
    """Ctrl-C: 128 and the number of SIGINT, as shells have it."""
    READER_GONE = 141
    """The reader of the output went away: 128 and the number of SIGPIPE, as shells have it."""
