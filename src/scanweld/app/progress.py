"""Telling the user how far a run is: bars on a terminal, else lines; or JSON for programs."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, ProgressColumn, Task, TaskID, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars
from rich.text import Text

from scanweld.app.json_lines import event_line
from scanweld.work.progress import (
    Event,
    Progress,
    ScanRefused,
    StageAdvanced,
    StageFinished,
    silent,
)


@contextmanager
def reporting(
    *, quiet: bool = False, verbose: bool = False, as_json: bool = False
) -> Iterator[Progress]:
    """Show the library's log and progress for as long as the context lasts.

    Args:
        quiet: Warnings only, no progress.
        verbose: Details for whoever looks for a fault.
        as_json: Events on stdout as JSON, a line each; stderr then has warnings only. Else
            everything goes to stderr.

    Yields:
        What a run calls as it goes on.
    """
    console = Console(stderr=True)
    # Bars stay when their stage is done, and say what its line in the log would; so does JSON.
    usual = logging.WARNING if as_json or console.is_terminal else logging.INFO
    level = logging.WARNING if quiet else logging.DEBUG if verbose else usual
    with _logging(console, level):
        if as_json:
            yield lambda event: typer.echo(event_line(event))
        elif quiet:
            yield silent
        elif console.is_terminal:
            with bars_on(console) as bars:
                yield Drawing(bars)
        else:
            yield _write_refusal


class Drawing:
    """A bar for each stage, and above them a line for each scan that is refused.

    Args:
        bars: On which they are drawn.
    """

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def __call__(self, event: Event) -> None:
        """Draw what has happened."""
        if isinstance(event, ScanRefused):
            self._bars.console.print(refusal(event), markup=False, highlight=False)
            return
        if event.stage not in self._tasks:
            self._tasks[event.stage] = self._bars.add_task(event.stage, total=None, counted="")
        task = self._tasks[event.stage]
        if isinstance(event, StageAdvanced):
            self._bars.update(task, completed=event.done, total=event.total)
        elif isinstance(event, StageFinished):
            told = ", ".join(f"{key} {value}" for key, value in event.counts.items())
            self._bars.update(task, completed=1, total=1, counted=told)


class Count(ProgressColumn):
    """How many of a stage's items are done; what it counted, once it is finished."""

    def render(self, task: Task) -> Text:
        """The column's text."""
        if task.finished:
            return Text(task.fields["counted"])
        if task.total is None:
            return Text("")
        many = f", {task.speed:.0f}/s" if task.speed is not None and task.speed >= 2 else ""
        return Text(f"{task.completed:.0f}/{task.total:.0f}{many}")


def bars_on(console: Console) -> Bars:
    """Bars with counts and the time left; of finished stages the time that they took."""
    times = TimeRemainingColumn(elapsed_when_finished=True)
    columns = (TextColumn("{task.description:<10}"), BarColumn(bar_width=30), times, Count())
    return Bars(*columns, console=console)


def refusal(event: ScanRefused) -> str:
    """One line."""
    return f"refused {event.scan}: {event.reason}"


def _write_refusal(event: Event) -> None:
    """Stages already have their lines in the log."""
    if isinstance(event, ScanRefused):
        typer.echo(f"scanweld: {refusal(event)}", err=True)


@contextmanager
def _logging(console: Console, level: int) -> Iterator[None]:
    handler = _handler(console)
    logger = logging.getLogger("scanweld")
    logger.addHandler(handler)
    logger.setLevel(level)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)


def _handler(console: Console) -> logging.Handler:
    if console.is_terminal:
        return RichHandler(console=console, show_time=False, show_path=False, show_level=False)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("scanweld: %(message)s"))
    return handler
