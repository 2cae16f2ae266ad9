"""Pages of the study: for each a template of prose, and a module that computes what fills it."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from benchmarks.study.pages import rendered
from benchmarks.study.study import Record
from scanweld.io.atomic import write_whole

FOLDER = Path(__file__).parent


class Page(Protocol):
    """What a module of this folder offers."""

    def values(self, records: Sequence[Record], out: Path) -> Mapping[str, Any]:
        """What fills the template of its name; its pictures go into the folder ``out``."""
        ...


def write_page(name: str, records: Sequence[Record], out: Path, *, quick: bool) -> None:
    """Write the page of a table of the study, and the pictures on it."""
    out.mkdir(parents=True, exist_ok=True)
    page: Page = import_module(f"{__name__}.{name}")  # type: ignore[assignment]  # a module
    command = f"python -m benchmarks.paper --only {name}" + (" --quick" if quick else "")
    wrote = f"`{command}` wrote this page and [the records](data/{name}.json) behind it."
    missing = sorted({module for r in records for module in r.unit.get("missing", ())})
    values = {"wrote": wrote, "missing": missing, **page.values(records, out)}
    text = rendered(FOLDER / f"{name}.md", values).rstrip() + "\n"
    write_whole(out / f"{name}.md", text.encode())


def write_index(names: Sequence[str], out: Path) -> None:
    """Write the list of the pages that stand."""
    titles = {name: _title(name) for name in names if (out / f"{name}.md").exists()}
    text = rendered(FOLDER / "README.md", {"titles": titles})
    write_whole(out / "README.md", text.encode())


def _title(name: str) -> str:
    template = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    return template.partition("\n")[0].removeprefix("# ")
