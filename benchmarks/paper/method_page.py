"""docs/method.md from its template: what was measured comes from JSON, what is set from the code.

In the template ``{{name}}`` is a number of ``method_numbers``, ``{{=heat.keypoints._ALIKE}}`` a
constant of the package, and ``{{=Config.heat.num_modes}}`` a default setting.
"""

import json
import re
from functools import cache
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from benchmarks.paper.study import Record, read_records
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.io.atomic import write_whole

TEMPLATE = Path(__file__).with_name("method_template.md")
OTHERS = Path(__file__).parents[2] / "docs/data"
PLACE = re.compile(r"\{\{(=?)([\w. -]+)\}\}")


class Results:
    """The JSON behind the numbers: of the study, and of the other benchmarks.

    Args:
        study: Where the study's pages are, and in ``data`` below their records.
        others: Where the records of the other benchmarks are.
    """

    def __init__(self, study: Path, others: Path = OTHERS) -> None:
        self._study, self._others = study, others
        self.table = cache(self._table)
        self.data = cache(self._data)

    def _table(self, name: str) -> list[Record]:
        """Records of a table of the study.

        Raises:
            InputError: If it was not measured.
        """
        try:
            return read_records(self._study, name)
        except FileNotFoundError as error:
            raise _missing(error, f"python -m benchmarks.paper --only {name}") from error

    def _data(self, name: str) -> list[dict[str, Any]]:
        """Records of one of the other benchmarks.

        Raises:
            InputError: If it was not measured.
        """
        path = self._others / f"{name}.json"
        try:
            return json.loads(path.read_text(encoding="utf-8"))["records"]
        except FileNotFoundError as error:
            raise _missing(error, "make benchmarks") from error


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
    from benchmarks.paper.method_numbers import NUMBERS

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


def _missing(error: FileNotFoundError, remedy: str) -> InputError:
    return InputError(f"{error.filename}: is missing; measure it first ({remedy})")
