"""The tables and figures of the study, by name."""

from importlib import import_module

from benchmarks.paper.study import Table
from scanweld.errors import InputError

_NAMES = ("table1", "table2", "real_pairs", "features", "ablations", "basins", "figures")


def table_names() -> tuple[str, ...]:
    """All of them, in the order in which they are measured and shown."""
    return _NAMES


def table(name: str) -> Table:
    """The table or figure of this name.

    Raises:
        InputError: If there is none; the message names those that are.
    """
    if name not in _NAMES:
        raise InputError(f"{name}: no such table; there are {', '.join(_NAMES)}")
    return import_module(f"benchmarks.paper.{name}")  # type: ignore[return-value]  # a module with the protocol's functions
