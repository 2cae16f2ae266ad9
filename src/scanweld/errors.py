"""What scanweld raises, and with what a command leaves: bad input and bad use, no failed pair."""

from collections.abc import Sequence
from enum import IntEnum

MAX_NAMED = 5
"""Things that a sentence names, at most."""


class ExitCode(IntEnum):
    """What a command tells the shell; ``USAGE`` holds facts that cannot be about these scans."""

    GOOD = 0
    ERROR = 1
    USAGE = 2
    NOT_GOOD = 3
    INTERRUPTED = 130


class ScanweldError(Exception):
    """Something that the user can put right; the message is one line that says how."""


class ReadError(ScanweldError):
    """A file that cannot be read as a scan, a mesh or a set of poses."""


class WriteError(ScanweldError):
    """An output that cannot be written."""


class ConfigError(ScanweldError):
    """A setting that is unknown or out of its range."""


class KnowledgeError(ScanweldError):
    """Something given beforehand that cannot be meant: about no scan, or against itself."""


class BudgetError(ScanweldError):
    """A budget of memory that is no size, or too little for the scans."""


class InputError(ScanweldError):
    """Too little, or nothing, to work on."""


def some_of(words: Sequence[str]) -> str:
    """The first few of what a message names, and how many more there are."""
    left = len(words) - MAX_NAMED
    return ", ".join(words[:MAX_NAMED]) + (f" and {left} more" if left > 0 else "")
