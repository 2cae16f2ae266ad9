"""Telling the user on stderr how far a run is: bars on a terminal, else lines."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from scanweld.progress import Progress, silent


@contextmanager
def reporting(*, quiet: bool = False, verbose: bool = False) -> Iterator[Progress]:
    """Show the library's log and progress on stderr for as long as the context lasts.

    Args:
        quiet: Warnings only, no progress.
        verbose: Details for whoever looks for a fault.

    Yields:
        What a run calls as it goes on.
    """
    console = Console(stderr=True)
    handler = _handler(console)
    logger = logging.getLogger("scanweld")
    level = logging.WARNING if quiet else logging.DEBUG if verbose else logging.INFO
    logger.addHandler(handler)
    logger.setLevel(level)
    try:
        if quiet or not console.is_terminal:
            yield silent
        else:
            with _bars(console) as bars:
                yield Drawing(bars)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)


class Drawing:
    """A bar for each stage, added when the stage is first heard of."""

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}
        self._totals: dict[str, int] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Move the stage's bar; a stage that counts items keeps their number to its end."""
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage)
        most = self._totals[stage] = max(total, self._totals.get(stage, 0))
        self._bars.update(self._tasks[stage], completed=most if done == total else done, total=most)


def _handler(console: Console) -> logging.Handler:
    if console.is_terminal:
        return RichHandler(console=console, show_time=False, show_path=False, show_level=False)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("scanweld: %(message)s"))
    return handler


def _bars(console: Console) -> Bars:
    columns = (TextColumn("{task.description:<10}"), BarColumn(), MofNCompleteColumn())
    return Bars(*columns, TimeElapsedColumn(), console=console, transient=True)
