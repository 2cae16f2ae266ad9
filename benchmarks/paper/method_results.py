"""The JSON behind the numbers of docs/method.md."""

import json
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.paper.study import Record, read_records
from scanweld.errors import InputError

OTHERS = Path(__file__).parents[2] / "docs/data"


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


def _missing(error: FileNotFoundError, remedy: str) -> InputError:
    return InputError(f"{error.filename}: is missing; measure it first ({remedy})")
