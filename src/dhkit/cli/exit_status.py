"""Exit statuses of the command."""

from enum import IntEnum


class ExitStatus(IntEnum):
    """Exit status of the command."""

    FINE = 0
    NO = 1
    """The answer is no: a robot is not verified, an answer is wrong, a pose is out of reach."""
    UNUSABLE = 2
    """The input is unusable; one line on stderr says what is wrong, and where."""
    INTERRUPTED = 130
    """Ctrl-C: 128 plus the number of SIGINT, as in shells."""
    READER_GONE = 141
    """The reader of the output has gone: 128 plus the number of SIGPIPE, as in shells."""
