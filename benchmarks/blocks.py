"""Parts of pages: Markdown of the templates in templates/, between <!-- begin: NAME --> marks."""

import re
from collections.abc import Callable
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

BLOCK = re.compile(r"(<!-- begin: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)


def rewritten(text: str, block: Callable[[str], str]) -> str:
    """A page with each of its measured parts as ``block`` writes the part of that name."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{block(found[2])}\n{found[3]}", text)


def rendered(template: str, **values: object) -> str:
    """The Markdown that a template makes of some values."""
    return _TEMPLATES.get_template(f"{template}.md.j2").render(values)


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


_TEMPLATES.globals.update(judged=judged, floored=floored)
