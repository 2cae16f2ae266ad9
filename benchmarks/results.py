"""Results of the benchmarks: JSON with the command that made it, one record a line."""

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scanweld.io.atomic import write_whole

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
DATA = DOCS / "data"
"""Results that stand in the documentation."""

Json = dict[str, Any]


def write_results(path: Path, records: Sequence[Json], **more: str) -> None:
    """Write records, floats to a few significant digits, beside how they came about, and more."""
    head = {
        **{"format": 2, "command": command_line(f"benchmarks.{Path(sys.argv[0]).stem}")},
        **{"commit": commit(), "version": version("scanweld"), "machine": machine()},
        **more,
    }
    lines = ",\n".join(json.dumps(rounded(record, 6), separators=(",", ":")) for record in records)
    write_file(path, f'{json.dumps(head, indent=1)[:-2]},\n "records": [\n{lines}\n]}}\n')


def read_results(path: Path) -> Json:
    """The document that was written: its records and what stands beside them."""
    return json.loads(path.read_text(encoding="utf-8"))


def how_measured(document: Json) -> str:
    """A sentence's beginning: the command, the machine and, where it is known, the commit."""
    commit = f", at commit {document['commit']}" if document.get("commit") else ""
    return f"`{document['command']}`, on {document['machine']}{commit}"


def write_file(path: Path, text: str) -> None:
    """Write a file whole, and the folder that it is in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text.encode())


def command_line(module: str) -> str:
    """The command that the user typed."""
    return shlex.join(["python", "-m", module, *sys.argv[1:]])


def machine() -> str:
    """What measured, in words."""
    return f"{os.cpu_count()} cores, Python {platform.python_version()}"


def commit() -> str | None:
    """The commit that measures, marked if files differ from it; None outside of a repository."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def rounded(value: Any, digits: int) -> Any:
    """Floats to a few significant digits, at any depth."""
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if isinstance(value, Mapping):
        return {key: rounded(item, digits) for key, item in value.items()}
    return [rounded(item, digits) for item in value] if isinstance(value, list | tuple) else value
