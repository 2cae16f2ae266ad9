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
from typing import Any, BinaryIO, Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks.results import machine, rounded, write_file
from scanweld.errors import InputError, ScanweldError

Unit = Mapping[str, Any]
"""What to measure: a small dict that JSON can hold."""
Result = Mapping[str, Any]
"""What was measured: the same."""

_ROOT = Path(__file__).parents[2]
PACKAGE = "src/scanweld/**/*.py"
_NOT_MEASURING = ("src/scanweld/app", "src/scanweld/fusion")
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
    """Where a study keeps its work, and how many processes do it.

    Attributes:
        out: Folder of the pages; their JSON goes to ``out / "data"``.
        work: Folder of finished units, so that an interrupted study goes on where it stopped.
        workers: Processes.
        quick: Whether a handful of units will do.
        command: What the user typed, for the JSON.
        code: Patterns of the files that measure: units that other code measured do not count.
            ``{table}`` in them stands for the name of the table.
    """

    out: Path
    work: Path
    workers: int
    quick: bool
    command: str
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
        units, code = table.units(self.quick), self._code_digest(table)
        keys = [_key(code, table, unit) for unit in units]
        store = self.work / f"{table.NAME}.jsonl"
        results = _stored(store)
        waiting = {key: unit for key, unit in zip(keys, units, strict=True) if key not in results}
        advance(len(units) - len(waiting), len(units))
        for key, result in self._measured(table, waiting):
            _append(store, key, result)
            results[key] = result
            advance(sum(k in results for k in keys), len(units))
        return [
            Record(unit=unit, result=results[key]) for key, unit in zip(keys, units, strict=True)
        ]

    def write(self, table: Table, records: Sequence[Record]) -> None:
        """Write the records of a table as JSON."""
        document = {
            "format": 1,
            "table": table.NAME,
            "command": self.command,
            "machine": machine(),
            "code": self._code_digest(table),
            "records": [{**record.unit, "result": record.result} for record in records],
        }
        path = self.out / "data" / f"{table.NAME}.json"
        text = json.dumps(rounded(document, _DIGITS), separators=(",", ":"))
        write_file(path, text.replace('},{"', '},\n{"') + "\n")

    def _code_digest(self, table: Table) -> str:
        """Of the code that measures: results of other code are not taken for this one's."""
        patterns = [pattern.replace("{table}", table.NAME) for pattern in self.code]
        paths = {path for pattern in patterns for path in _ROOT.glob(pattern)}
        digest = hashlib.sha256()
        for path in sorted(paths):
            name = path.relative_to(_ROOT).as_posix()
            if not name.startswith(_NOT_MEASURING):
                digest.update(name.encode() + path.read_bytes())
        return digest.hexdigest()[:16]

    def _measured(self, table: Table, waiting: Mapping[str, Unit]) -> Iterator[tuple[str, Result]]:
        """Results as they come, in any order."""
        if self.workers == 1 or len(waiting) < 2:
            for key, unit in waiting.items():
                yield key, _plain(table.measure(unit))
            return
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.workers, mp_context=context) as pool:
            running = {pool.submit(table.measure, unit): key for key, unit in waiting.items()}
            try:
                for future in as_completed(running):
                    key = running[future]
                    try:
                        yield key, _plain(future.result())
                    except ScanweldError:
                        raise
                    except Exception as error:
                        raise RuntimeError(
                            f"{table.NAME}: {dict(waiting[key])}: {error}"
                        ) from error
            finally:
                pool.shutdown(wait=False, cancel_futures=True)


def measured(table: Table, study: Study) -> list[Record]:
    """The records of a table, measured where they are not yet; shows how far it is."""
    columns = (
        TextColumn("{task.description}"),
        *(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(table.NAME, total=None)
        return study.records(
            table, lambda done, total: progress.update(task, completed=done, total=total)
        )


def read_records(out: Path, name: str) -> list[Record]:
    """The records of a table as they were last written to ``out / "data"``.

    Raises:
        FileNotFoundError: If the table was not measured.
    """
    document = json.loads((out / "data" / f"{name}.json").read_text(encoding="utf-8"))
    return [
        Record(unit={k: v for k, v in entry.items() if k != "result"}, result=entry["result"])
        for entry in document["records"]
    ]


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


def _key(code: str, table: Table, unit: Unit) -> str:
    told = json.dumps([code, table.NAME, unit], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()


def _stored(path: Path) -> dict[str, Result]:
    """Finished units by key. A last line that was cut short counts as not finished."""
    results: dict[str, Result] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue
            results[entry["key"]] = entry["result"]
    return results


def _append(path: Path, key: str, result: Result) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        told = json.dumps({"key": key, "result": result}) + "\n"
        file.write(b"\n" * _is_cut_short(file) + told.encode())


def _is_cut_short(file: BinaryIO) -> bool:
    """Whether the last line has no end: what came next would be lost with it."""
    if file.seek(0, os.SEEK_END) == 0:
        return False
    file.seek(-1, os.SEEK_END)
    return file.read() != b"\n"


def _plain(result: Result) -> Result:
    """As JSON will give it back, so that fresh and stored results do not differ."""
    return json.loads(json.dumps(rounded(result, _DIGITS)))
