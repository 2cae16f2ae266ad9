"""Work over scans and pairs: the same results in the same order, whatever the number of workers."""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")

ROW = 8
"""Short pieces of work that a thread takes at once: to hand one over takes some 50 microseconds."""


def num_workers(asked: int | None) -> int:
    """How many workers to use: as asked, else one for each core this process may run on."""
    if asked is not None:
        return max(1, asked)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def single_threaded_algebra() -> AbstractContextManager[object]:
    """Pin BLAS and its like to one thread: sums then come out alike at any number of workers."""
    return threadpool_limits(limits=1)


def map_in_rows(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[Result]:
    """The same of many short pieces of work: a thread takes some in a row."""
    if workers == 1:
        yield from map(function, items)
        return
    rows = [items[k : k + ROW] for k in range(0, len(items), ROW)]
    for results in map_in_order(lambda row: [function(item) for item in row], rows, workers):
        yield from results


def map_in_order(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[Result]:
    """Results of a function over items, in the items' order, as they become ready.

    Threads suffice: the compiled kernels, where the time goes, run without the interpreter's lock.
    """
    if workers == 1 or len(items) < 2:
        yield from map(function, items)
        return
    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from pool.map(function, items)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def map_ahead(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[Result]:
    """The same for results that are large: only as many are worked out ahead as there are workers.

    One worker is who asks for them.
    """
    if workers == 1:
        yield from map(function, items)
        return
    coming: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(workers - 1) as pool:
        try:
            for item in items:
                coming.append(pool.submit(function, item))
                if len(coming) == workers:
                    yield coming.popleft().result()
            while coming:
                yield coming.popleft().result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
