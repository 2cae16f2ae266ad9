"""A table's units of work: measured in processes, kept when done, written as one JSON."""

import hashlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console
from rich.progress import Progress

from benchmarks import results
from benchmarks.results import read_results, rounded, write_file, write_results
from scanweld.errors import InputError, ScanweldError
from scanweld.work.threads import single_threaded_algebra

Unit = Mapping[str, Any]
"""What to measure: a small dict that JSON can hold."""
Result = Mapping[str, Any]
"""What was measured: the same."""

PACKAGE = "src/scanweld/**/*.py"
_NOT_MEASURING = ("src/scanweld/app/", "src/scanweld/fusion/")
_DIGITS = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class Record:
    """A unit and what was measured."""

    unit: Unit
    result: Result


class Table(Protocol):
    """What a study measures: a module or an object."""

    NAME: str

    def units(self, quick: bool) -> list[Unit]:
        """What to measure; a handful, without any data, if quick."""
        ...

    def measure(self, unit: Unit) -> Result:
        """Measure one unit; it runs in a process of its own."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Where a study keeps its work, and how many processes do it."""

    out: Path  # Folder of the pages; their JSON goes to ``out / "data"``
    work: Path  # Of finished units, so that an interrupted study goes on where it stopped
    workers: int  # Processes
    quick: bool  # Whether a handful of units will do
    command: str  # What the user typed, for the JSON
    # Patterns of the files that measure: units that other code measured do not count. ``{table}``
    # in them stands for the name of the table.
    code: tuple[str, ...] = (PACKAGE,)

    def records(self, table: Table, advance: Callable[[int, int], None]) -> list[Record]:
        """Measure what is not measured yet; the records come in the order of the units.

        Args:
            table: Its units and how to measure one.
            advance: Told of (done, total) as units finish.

        Raises:
            ScanweldError: If a unit lacks what the user has to bring.
            RuntimeError: If a unit fails. The finished ones are kept.
        """
        units, code, store = table.units(self.quick), self._code(table), self.work / table.NAME
        told = [json.dumps([code, table.NAME, unit], sort_keys=True) for unit in units]
        keys = [hashlib.sha256(each.encode()).hexdigest() for each in told]
        done = {path.stem: json.loads(path.read_bytes()) for path in store.glob("*.json")}
        waiting = {key: unit for key, unit in zip(keys, units, strict=True) if key not in done}
        advance(len(units) - len(waiting), len(units))
        for key, result in self._measured(table, waiting):
            write_file(store / f"{key}.json", json.dumps(rounded(result, _DIGITS)))
            # As the file will give it back, so that fresh and kept results do not differ.
            done[key] = json.loads((store / f"{key}.json").read_bytes())
            advance(sum(k in done for k in keys), len(units))
        return [Record(unit=unit, result=done[key]) for key, unit in zip(keys, units, strict=True)]

    def write(self, table: Table, records: Sequence[Record]) -> None:
        """Write the records of a table as JSON."""
        rows = [{**record.unit, "result": record.result} for record in records]
        head = {"command": self.command, "table": table.NAME, "code": self._code(table)}
        write_results(self.out / "data" / f"{table.NAME}.json", rows, **head)

    def _code(self, table: Table) -> str:
        return code_digest([pattern.replace("{table}", table.NAME) for pattern in self.code])

    def _measured(self, table: Table, waiting: Mapping[str, Unit]) -> Iterator[tuple[str, Result]]:
        """Results as they come, in any order."""
        if self.workers == 1 or len(waiting) < 2:
            for key, unit in waiting.items():
                yield key, table.measure(unit)
            return
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.workers, mp_context=context) as pool:
            running = {pool.submit(table.measure, unit): key for key, unit in waiting.items()}
            try:
                for future in as_completed(running):
                    key = running[future]
                    try:
                        yield key, future.result()
                    except ScanweldError:
                        raise
                    except Exception as error:
                        raise RuntimeError(f"{table.NAME}: {waiting[key]}: {error}") from error
            finally:
                pool.shutdown(wait=False, cancel_futures=True)


def measured(table: Table, study: Study, *, is_written: bool = False) -> list[Record]:
    """Measure what is not measured yet, in processes of one core each, and show how far it is."""
    # Inherited by the processes, which import their algebra anew.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with single_threaded_algebra(), Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task(table.NAME, total=None)
        records = study.records(
            table, lambda done, total: progress.update(task, completed=done, total=total)
        )
    if is_written:
        study.write(table, records)
    return records


def code_digest(patterns: Sequence[str]) -> str:
    """Of the files of the project that some patterns name.

    Raises:
        ValueError: If a pattern names none: a folder has got another name.
    """
    digest, paths = hashlib.sha256(), set[Path]()
    for pattern in patterns:
        found = set(results.ROOT.glob(pattern))
        if not found:
            raise ValueError(f"{pattern}: no such file; say where that code is now")
        paths |= found
    for path in sorted(paths):
        name = path.relative_to(results.ROOT).as_posix()
        if not name.startswith(_NOT_MEASURING):
            digest.update(name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def read_records(out: Path, name: str) -> list[Record]:
    """The records of a table as they were last written to ``out / "data"``.

    Raises:
        FileNotFoundError: If the table was not measured.
    """
    rows = read_results(out / "data" / f"{name}.json")["records"]
    return [Record(unit=row, result=row.pop("result")) for row in rows]


@contextmanager
def measured_by(command: str) -> Iterator[None]:
    """Where records are read that a command measures.

    Raises:
        InputError: If their file is missing; the message names the command.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise InputError(f"{error.filename}: is missing; measure it first ({command})") from error
