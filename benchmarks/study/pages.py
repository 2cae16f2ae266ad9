"""Pages in Markdown: templates of prose, filled with numbers, and tables described as data."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

from jinja2 import Environment, StrictUndefined

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
    rows: Mapping[str, R] | Mapping[tuple[str, ...], R],
    columns: Mapping[str, C],
    cell: Callable[[R, C], str],
) -> str:
    """A table in Markdown with a cell for every row and column; rows without any text are left out.

    Args:
        corner: Heading of the rows' titles; several where rows have several.
        rows: What each row is about, by its title.
        columns: The same of the columns.
        cell: The text where a row and a column meet.
    """
    kept = []
    for titles, row in rows.items():
        cells = [cell(row, column) for column in columns.values()]
        if any(cells):
            kept.append((*_several(titles), *cells))
    return markdown_table((*_several(corner), *columns), kept)


def _several(titles: str | tuple[str, ...]) -> tuple[str, ...]:
    return (titles,) if isinstance(titles, str) else titles


def percent(share: float) -> str:
    """A share as a whole percentage."""
    return f"{100 * share:.0f} %"


def rendered(template: Path, values: Mapping[str, Any]) -> str:
    """A template with its constants and values filled in.

    ``{{=heat.keypoints._ALIKE}}`` is a constant of the package, ``{{=Config.heat.num_modes}}`` a
    default setting; everything else is Jinja's.

    Raises:
        ValueError: If a constant is not there.
        jinja2.UndefinedError: If a value is not there.
    """
    text = CONSTANT.sub(lambda found: constant(found[1]), template.read_text(encoding="utf-8"))
    jinja = Environment(
        undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True, lstrip_blocks=True
    )
    jinja.filters["percent"] = percent
    return jinja.from_string(text).render(values)


def constant(path: str) -> str:
    """A constant of the package as text: ``room.module.NAME``, or a field of ``Config``.

    Raises:
        ValueError: If there is none.
    """
    try:
        value = _setting(path) if path.startswith("Config.") else _named(path)
    except (ImportError, AttributeError, IndexError) as error:
        raise ValueError(f"{path}: no such constant") from error
    return f"{value:g}" if isinstance(value, float) else str(value)


def _setting(path: str) -> Any:
    value: Any = Config()
    for name in path.split(".")[1:]:
        value = value[int(name)] if name.isdigit() else getattr(value, name)
    return value


def _named(path: str) -> Any:
    *names, last = path.split(".")
    if last.isdigit():
        return resolve_name(f"scanweld.{'.'.join(names)}")[int(last)]
    return resolve_name(f"scanweld.{path}")
