"""Who carries out work over scans and pairs: threads of this process, or a cluster."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from scanweld.work.threads import map_in_order

Item = TypeVar("Item")
ItemAgainst = TypeVar("ItemAgainst", contravariant=True)
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Shared(Generic[ItemAgainst]):
    """What is large, and what many items need some of: the scans of pairs.

    Attributes:
        parts: By number.
        names: Of each part: a hash of its content. What has the same name is sent once only.
        of: The numbers of the parts that an item needs.
    """

    parts: Mapping[int, Any]
    names: Mapping[int, str]
    of: Callable[[ItemAgainst], Sequence[int]]


class Runner(Protocol):
    """Applies functions to items."""

    def map(
        self,
        function: Callable[..., Result],
        items: Sequence[Item],
        shared: Shared[Item] | None = None,
    ) -> Iterator[Result]:
        """Results in the items' order, as they become ready.

        Args:
            function: Called with an item and the parts that it needs, in their order. It depends on
                nothing else, and can be pickled.
            items: Small, unless nothing is shared.
            shared: The parts.
        """
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Threads:
    """Threads of this process.

    Attributes:
        workers: How many.
    """

    workers: int

    def map(
        self,
        function: Callable[..., Result],
        items: Sequence[Item],
        shared: Shared[Item] | None = None,
    ) -> Iterator[Result]:
        """See ``Runner``."""

        def call(item: Item) -> Result:
            parts = () if shared is None else (shared.parts[k] for k in shared.of(item))
            return function(item, *parts)

        return map_in_order(call, items, self.workers)
