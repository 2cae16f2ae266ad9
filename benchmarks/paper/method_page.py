"""docs/method.md from its template: what was measured comes from JSON, what is set from the code.

In the template ``{{name}}`` is a number of ``method_numbers``, ``{{=heat.keypoints._ALIKE}}`` a
constant of the package, and ``{{=Config.heat.num_modes}}`` a default setting.
"""

import re
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from benchmarks.paper.method_numbers import NUMBERS
from benchmarks.paper.method_results import Results
from scanweld.config import Config
from scanweld.io.atomic import write_whole

TEMPLATE = Path(__file__).with_name("method_template.md")
PLACE = re.compile(r"\{\{(=?)([\w. -]+)\}\}")


def write_method(study: Path) -> None:
    """Write method.md beside the folder of the study's pages.

    Raises:
        InputError: If a result is missing.
    """
    write_whole(study.parent / "method.md", method_text(Results(study)).encode())


def method_text(results: Results) -> str:
    """The page.

    Raises:
        InputError: If a result is missing.
        ValueError: If the template asks for a number that nobody computes, or leaves one out.
    """
    template = TEMPLATE.read_text(encoding="utf-8")
    asked = {name for equals, name in PLACE.findall(template) if not equals}
    if asked != set(NUMBERS):
        unknown, unused = sorted(asked - set(NUMBERS)), sorted(set(NUMBERS) - asked)
        raise ValueError(f"{TEMPLATE.name}: unknown numbers {unknown}, unused numbers {unused}")
    return PLACE.sub(lambda f: constant(f[2]) if f[1] else NUMBERS[f[2]](results), template)


def constant(path: str) -> str:
    """A constant of the package as text: ``room.module.NAME``, or a field of ``Config``.

    Raises:
        ValueError: If there is none.
    """
    try:
        value: Any = _setting(path) if path.startswith("Config.") else _named(path)
    except (ImportError, AttributeError, IndexError) as error:
        raise ValueError(f"{TEMPLATE.name}: {path}: no such constant") from error
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
