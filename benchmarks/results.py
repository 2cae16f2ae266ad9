"""Results of the benchmarks: JSON with the command that made it, one record a line."""

import json
import os
import platform
import shlex
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scanweld.io.atomic import write_whole

DATA = Path(__file__).parents[1] / "docs/data"
"""Results that stand in the documentation."""
_DIGITS = 6


def write_results(path: Path, records: Sequence[dict[str, Any]]) -> None:
    """Write records, floats to a few significant digits, beside how they came about."""
    head = {
        "format": 2,
        "command": shlex.join(["python", f"benchmarks/{Path(sys.argv[0]).name}", *sys.argv[1:]]),
        "version": version("scanweld"),
        "machine": machine(),
    }
    lines = ",\n".join(json.dumps(_rounded(record)) for record in records)
    path.parent.mkdir(parents=True, exist_ok=True)
    text = f'{json.dumps(head, indent=1)[:-2]},\n "records": [\n{lines}\n]}}\n'
    write_whole(path, text.encode())


def machine() -> str:
    """What measured, in words."""
    return f"{os.cpu_count()} cores, Python {platform.python_version()}"


def read_results(path: Path) -> dict[str, Any]:
    """The document that ``write_results`` wrote: its records and what stands beside them."""
    return json.loads(path.read_text(encoding="utf-8"))


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}")
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return value
