"""Markdown of templates: whole pages, and measured parts of pages between their marks.

In a template ``{{=heat.keypoints._ALIKE}}`` is a constant of the package and
``{{=Config.heat.num_modes}}`` a default setting; everything else is Jinja's. A table is a ``grid``
whose cell stands in the template::

    {% call(row, column) grid("heading", rows, columns) %}{{ row }} at {{ column }}{% endcall %}
"""

import re
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.ext import Extension

from scanweld.config import Config

BLOCK = re.compile(r"(<!-- begin: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
CONSTANT = re.compile(r"\{\{=([\w. -]+)\}\}")
"""A constant of the code in a template, before Jinja sees it."""


def rewritten(text: str, block: Callable[[str], str]) -> str:
    """A page with each of its measured parts as ``block`` writes the part of that name."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{block(found[2])}\n{found[3]}", text)


def rendered(template: str, **values: object) -> str:
    """The Markdown that a template makes of some values.

    Raises:
        ValueError: If a constant of the package is not there.
        jinja2.UndefinedError: If a value is not there.
    """
    return TEMPLATES.get_template(f"{template}.md.j2").render(values)


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


class _Constants(Extension):
    def preprocess(self, source: str, name: str | None, filename: str | None = None) -> str:
        return CONSTANT.sub(lambda found: constant(found[1]), source)


def grid(
    corner: str,
    rows: Mapping[str, Any] | Sequence[str],
    columns: Mapping[str, Any],
    caller: Callable[[Any, Any], str],
) -> str:
    """A table in Markdown with a cell for every row and column; rows without any text are left out.

    Args:
        corner: Heading of the rows' titles; with a ``|`` where titles have one, of two columns.
        rows: What each row is about, by its title; or the titles alone.
        columns: The same of the columns.
        caller: The text where a row and a column meet.
    """
    named = rows if isinstance(rows, Mapping) else {row: row for row in rows}
    lines = [[corner, *columns], ["---"] * (corner.count("|") + 1 + len(columns))]
    for title, row in named.items():
        cells = [caller(row, column).strip() for column in columns.values()]
        lines += [[title, *cells]] if any(cells) else []
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def percent(share: float, digits: int = 0) -> str:
    """A share as a percentage."""
    return f"{100 * share:.{digits}f} %"


def judged(text: object, is_met: bool) -> str:
    """A cell, marked where a floor is missed."""
    return str(text) if is_met else f"**{text} FAIL**"


def floored(
    value: float | None, digits: int, floor: float | None = None, *, at_least: bool = False
) -> str:
    """A number, and in brackets the floor that it is held to, if it has one."""
    if value is None or floor is None:
        return judged("-" if value is None else f"{value:.{digits}f}", floor is None)
    return judged(f"{value:.{digits}f} ({floor:g})", value >= floor if at_least else value <= floor)


TEMPLATES = Environment(
    loader=FileSystemLoader([Path(__file__).with_name(name) for name in ("templates", "paper")]),
    extensions=[_Constants],
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
TEMPLATES.globals.update(judged=judged, floored=floored, grid=grid)
TEMPLATES.filters.update(
    flat=lambda lists: [each for some in lists for each in some],
    mean=lambda values: np.mean(list(values)),
    median=lambda values, axis=None: np.nanmedian(list(values), axis=axis),
    percent=percent,
    quantile=lambda values, q: np.quantile(list(values), q),
    total=lambda rows: np.sum(rows, axis=0),
)
