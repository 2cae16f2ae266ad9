"""Work over scans and pairs on a cluster: dask.distributed does all of it.

The same bytes come out whatever the cluster, because a piece of work depends on its item and its
parts alone and results come back in the items' order. Everything that a task needs, the parts too,
stands in the scheduler's graph: where a worker dies, the others do again what was lost with it.
"""

import asyncio
import importlib
import logging
import platform
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from types import TracebackType
from typing import Any, Self, TypeVar

from threadpoolctl import threadpool_limits

from scanweld.compiled.source import code_digest
from scanweld.errors import InputError
from scanweld.work.runners import Shared

Item = TypeVar("Item")
Result = TypeVar("Result")

CONNECT_SECONDS = 10
WAIT_SECONDS = 60
"""How long a cluster may be without workers: those that died may be replaced."""
_LIBRARIES = ("numba", "numpy", "scipy")
"""Another version of these may round differently."""


class VersionError(InputError):
    """A worker that would not work out the same as we would."""


class Cluster:
    """A cluster by the address of its scheduler, as a context.

    Args:
        address: As ``tcp://host:8786``.

    Raises:
        InputError: If dask is not installed, the scheduler cannot be reached, it has no workers, or
            these have other versions than this process.
    """

    def __init__(self, address: str) -> None:
        try:
            dask, distributed = map(importlib.import_module, ("dask", "distributed"))
        except ImportError as error:
            raise InputError(
                "a cluster takes dask.distributed: pip install 'scanweld[cluster]'"
            ) from error
        # The parts are in the graph, which dask warns of; why they are, stands above.
        dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"})
        # Its client would print a page where the scheduler is lost, which we say in a line.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        self._address = address
        self._lost = (OSError, asyncio.CancelledError, distributed.client.FutureCancelledError)
        self._killed: type[Exception] = distributed.KilledWorker
        try:
            self._client: Any = distributed.Client(address, timeout=CONNECT_SECONDS)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            raise InputError(
                f"{address}: no scheduler can be reached there ({_in_brief(error)}); start one by "
                "'dask scheduler', or leave out --scheduler"
            ) from error
        self._parts: dict[str, Any] = {}
        try:
            self._check_workers()
        except BaseException:
            self._client.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._parts.clear()
        self._client.close()

    def map(
        self,
        function: Callable[..., Result],
        items: Sequence[Item],
        shared: Shared[Item] | None = None,
    ) -> Iterator[Result]:
        """See ``Runner``.

        Raises:
            InputError: If the scheduler is lost, a piece of work kills every worker, or none is
                left.
        """
        ours = versions()
        left = deque(
            self._client.submit(_call, ours, function, item, *self._held(shared, item), pure=False)
            for item in items
        )
        try:
            while left:
                yield self._result(left.popleft())
        except self._lost as error:
            raise InputError(
                f"{self._address}: the scheduler was lost; run again, and what is finished is not "
                "done again"
            ) from error
        except self._killed as error:
            raise InputError(
                f"{self._address}: several workers died of the same piece of work "
                f"({_in_brief(error)}); give them more memory"
            ) from error
        finally:
            left.clear()  # what nobody waits for is not done

    def _result(self, future: Any) -> Any:
        """The result of a piece of work, once it is there."""
        without_workers = 0
        while without_workers < WAIT_SECONDS:
            try:
                return future.result(timeout=1)
            except TimeoutError:
                if future.done():
                    return future.result()
                has_workers = bool(self._client.scheduler_info()["workers"])
                without_workers = 0 if has_workers else without_workers + 1
        raise InputError(
            f"{self._address}: all workers of the cluster are gone; start some by 'dask worker "
            f"{self._address}' and run again: what is finished is not done again"
        )

    def _held(self, shared: Shared[Item] | None, item: Item) -> list[Any]:
        """The parts that an item needs, on the cluster; each is sent once."""
        if shared is None:
            return []
        held = []
        for k in shared.of(item):
            name = shared.names[k]
            if name not in self._parts:
                # A task and not scattered data: that would be lost with the worker that has it.
                key = f"part-{name}"
                self._parts[name] = self._client.submit(_same, shared.parts[k], key=key)
            held.append(self._parts[name])
        return held

    def _check_workers(self) -> None:
        try:
            theirs: Mapping[str, Any] = self._client.run(versions, on_error="return")
        except self._lost as error:
            raise InputError(f"{self._address}: {_in_brief(error)}") from error
        if not theirs:
            raise InputError(
                f"{self._address}: the cluster has no workers; start one by "
                f"'dask worker {self._address}'"
            )
        for worker, found in sorted(theirs.items()):
            if isinstance(found, BaseException):
                raise VersionError(f"{worker}: scanweld cannot be used there: {_in_brief(found)}")
            _check(found, versions(), worker)


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """What has to be the same here and there, for the results to be."""
    libraries = ((name, version(name)) for name in _LIBRARIES)
    python = ".".join(platform.python_version_tuple()[:2])
    return (
        ("scanweld", version("scanweld")),
        ("scanweld's code", code_digest()[:12]),
        ("python", python),
        *libraries,
    )


def _check(theirs: Sequence[tuple[str, str]], ours: Sequence[tuple[str, str]], worker: str) -> None:
    """Raise VersionError where versions differ."""
    here = dict(ours)
    told = [f"{name} {has}, not {here[name]}" for name, has in theirs if has != here.get(name)]
    if told:
        raise VersionError(f"worker {worker} has {'; '.join(told)}: install the same there as here")


def _call(
    expected: Sequence[tuple[str, str]], function: Callable[..., Result], item: Any, *parts: Any
) -> Result:
    """What a worker does: also one that has come since the check at the start."""
    _check(versions(), expected, platform.node())
    _single_threaded()
    return function(item, *parts)


@cache
def _single_threaded() -> object:
    """As ``single_threaded_algebra``, for as long as the worker lives."""
    return threadpool_limits(limits=1)


def _same(part: Result) -> Result:
    return part


def _in_brief(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
