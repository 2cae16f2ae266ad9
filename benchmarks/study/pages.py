"""Pages in Markdown: templates that tell and tabulate what functions make of records.

In a template ``{{=heat.keypoints._ALIKE}}`` is a constant of the package and
``{{=Config.heat.num_modes}}`` a default setting; everything else is Jinja's. A table is a ``grid``
whose cell stands in the template::

    {% call(row, column) grid("heading", rows, columns) %}{{ row }} at {{ column }}{% endcall %}
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

import numpy as np
from jinja2 import Environment, StrictUndefined

from benchmarks.study.records import (
    answers,
    beyond,
    grouped,
    of,
    overlap_title,
    overlapping,
    up_to,
    values_of,
)
from scanweld.config import Config

R = TypeVar("R")
C = TypeVar("C")

CONSTANT = re.compile(r"\{\{=([\w. -]+)\}\}")
"""A constant of the code in a template, before Jinja sees it."""


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def grid(
    corner: str | tuple[str, ...],
    rows: Mapping[str, R] | Mapping[tuple[str, ...], R] | Sequence[str],
    columns: Mapping[str, C],
    caller: Callable[[R, C], str],
) -> str:
    """A table in Markdown with a cell for every row and column; rows without any text are left out.

    Args:
        corner: Heading of the rows' titles; several where rows have several.
        rows: What each row is about, by its title; or the titles alone.
        columns: The same of the columns.
        caller: The text where a row and a column meet.
    """
    named: Mapping[Any, Any] = rows if isinstance(rows, Mapping) else {row: row for row in rows}
    kept = []
    for titles, row in named.items():
        cells = [caller(row, column).strip() for column in columns.values()]
        if any(cells):
            kept.append((*_several(titles), *cells))
    return markdown_table((*_several(corner), *columns), kept)


def _several(titles: str | tuple[str, ...]) -> tuple[str, ...]:
    return (titles,) if isinstance(titles, str) else titles


def percent(share: float, digits: int = 0) -> str:
    """A share as a percentage."""
    return f"{100 * share:.{digits}f} %"


_JINJA = Environment(
    undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True, lstrip_blocks=True
)
_JINJA.filters |= {"percent": percent}
_JINJA.filters |= {"mean": lambda x: np.mean(list(x)), "median": lambda x: np.median(list(x))}
_HELPERS = (grid, answers, beyond, grouped, of, overlap_title, overlapping, up_to, values_of)
_JINJA.globals |= {function.__name__: function for function in _HELPERS}


def rendered(template: Path, values: Mapping[str, Any]) -> str:
    """A template with its constants and values filled in.

    Raises:
        ValueError: If a constant is not there.
        jinja2.UndefinedError: If a value is not there.
    """
    text = CONSTANT.sub(lambda found: constant(found[1]), template.read_text(encoding="utf-8"))
    return _JINJA.from_string(text).render(values)


def constant(path: str) -> str:
    """A constant of the package as text: ``room.module.NAME``, or a field of ``Config``.

    Raises:
        ValueError: If there is none.
    """
    try:
        value = _constant(path)
    except (ImportError, AttributeError, IndexError) as error:
        raise ValueError(f"{path}: no such constant") from error
    return f"{value:g}" if isinstance(value, float) else str(value)


def _constant(path: str) -> Any:
    names, _, last = path.rpartition(".")
    if last.isdigit():
        return _constant(names)[int(last)]
    if path.startswith("Config."):
        return attrgetter(path.removeprefix("Config."))(Config())
    return resolve_name(f"scanweld.{path}")
