"""How a run tells what it is doing, and where it keeps what it has done."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True, kw_only=True, slots=True)
class StageStarted:
    """A stage begins."""

    stage: str


@dataclass(frozen=True, kw_only=True, slots=True)
class StageAdvanced:
    """So many of a stage's items are done; stages of one piece never say so."""

    stage: str
    done: int
    total: int


@dataclass(frozen=True, kw_only=True, slots=True)
class StageFinished:
    """A stage ends, after so many seconds, with what it counted, such as {"pairs": 45}."""

    stage: str
    seconds: float
    counts: Mapping[str, int | float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanRefused:
    """A scan cannot be read, cannot take part, or finds no place; told once for each scan."""

    scan: str
    reason: str


Event = StageStarted | StageAdvanced | StageFinished | ScanRefused
Progress = Callable[[Event], None]
"""Called as work goes on, from the thread that asked for it; the library itself never prints."""


def silent(event: Event) -> None:
    """Progress that nobody looks at."""


@contextmanager
def telling(progress: Progress, stage: str) -> Iterator[dict[str, int | float]]:
    """Tell of a stage's start and its end, with what is put into the yielded dict as its counts.

    The end is told even where the stage fails, so that who shows progress can close its bar.
    """
    counts: dict[str, int | float] = {}
    start = time.perf_counter()
    progress(StageStarted(stage=stage))
    try:
        yield counts
    finally:
        progress(StageFinished(stage=stage, seconds=time.perf_counter() - start, counts=counts))


class Cache(Protocol):
    """Keeps finished work under a key made of its input's content and its settings."""

    def get(self, key: str) -> object | None:
        """What was kept under the key, or None."""
        ...

    def put(self, key: str, value: object) -> None:
        """Keep a value under the key; after this it survives an interruption."""
        ...


class NoCache:
    """Keeps nothing."""

    def get(self, key: str) -> object | None:
        """Nothing was kept."""
        return None

    def put(self, key: str, value: object) -> None:
        """Forget the value."""
