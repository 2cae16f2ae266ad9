"""The bookkeeping of a run: stages timed and counted, finished work kept and found again."""

import hashlib
import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from scanweld.compiled.source import code_digest
from scanweld.config import Section
from scanweld.work.progress import Cache, Progress, StageAdvanced, telling
from scanweld.work.runners import Runner, Shared, Threads
from scanweld.work.threads import map_in_order

try:
    import resource
except ImportError:  # Windows
    resource = None

logger = logging.getLogger(__name__)

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, slots=True)
class StageReport:
    """Time and memory of a stage, and what it counted.

    Attributes:
        seconds: Wall time.
        peak_mb: Peak resident memory of the process at the stage's end; 0 where the system does not
            tell.
        counts: What was counted, such as {"pairs": 45, "accepted": 25}.
    """

    seconds: float
    peak_mb: float
    counts: Mapping[str, int | float] = field(default_factory=dict)


@dataclass(kw_only=True, slots=True)
class Stages:
    """Runs a pipeline's stages one after the other.

    Attributes:
        workers: Threads that work over scans and pairs.
        cache: Where finished work is kept.
        progress: Told what happens.
        runner: Carries out the work over scans and pairs; threads of this process if None.
        reports: Time, memory and counts of the stages so far.
    """

    workers: int
    cache: Cache
    progress: Progress
    runner: Runner | None = None
    reports: dict[str, StageReport] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[dict[str, int | float]]:
        """Time a stage; what is put into the yielded dict is reported as its counts."""
        start = time.perf_counter()
        with telling(self.progress, name) as counts:
            yield counts
        seconds = time.perf_counter() - start
        if name in self.reports:
            seconds += self.reports[name].seconds
        self.reports[name] = StageReport(seconds=seconds, peak_mb=peak_memory_mb(), counts=counts)
        told = ", ".join(f"{key} {value}" for key, value in counts.items())
        logger.info("%s: %s (%.1f s)", name, told, seconds)

    def each(
        self,
        name: str,
        function: Callable[..., Result],
        items: Sequence[Item],
        key: Callable[[Item], str] | None = None,
        then: Callable[[Item, Result], None] | None = None,
        shared: Shared[Item] | None = None,
    ) -> list[Result]:
        """Apply a function to every item, in parallel, and tell of each that is done.

        Args:
            name: Of the stage.
            function: What is to be done. It can be pickled, and takes an item and its shared parts.
            items: With what.
            key: Of an item's work; if given, finished work is kept and found again.
            then: Called with each item and its result, in order, as soon as that is there.
            shared: What many items need some of.
        """
        results = []
        for item, result in zip(items, self.done(function, items, key, shared), strict=True):
            results.append(result)
            if then is not None:
                then(item, result)
            self.progress(StageAdvanced(stage=name, done=len(results), total=len(items)))
        return results

    def done(
        self,
        function: Callable[..., Result],
        items: Sequence[Item],
        key: Callable[[Item], str] | None = None,
        shared: Shared[Item] | None = None,
    ) -> Iterator[Result]:
        """The results of ``each`` one after the other: found again, or worked out and kept."""
        runner = self.runner or Threads(workers=self.workers)
        if key is None:
            yield from runner.map(function, items, shared)
            return
        names = [key(item) for item in items]
        found = list(map_in_order(self.cache.get, names, self.workers))
        left = [item for item, kept in zip(items, found, strict=True) if kept is None]
        with closing(runner.map(function, left, shared)) as fresh:  # type: ignore[type-var]
            for name, kept in zip(names, found, strict=True):
                if kept is not None:
                    yield kept  # type: ignore[misc]  # what put() kept under the same key
                    continue
                result = next(fresh)
                self.cache.put(name, result)
                yield result


def work_key(stage: str, *parts: str | float | Section) -> str:
    """A hex key of a piece of work: the stage, its input's hashes, its settings, and our code."""
    told = [code_digest(), stage]
    told += [part.model_dump_json() if isinstance(part, Section) else repr(part) for part in parts]
    return hashlib.sha256("\n".join(told).encode()).hexdigest()


def peak_memory_mb() -> float:
    """Peak resident memory of this process so far; 0 where the system does not tell."""
    if resource is None:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)
