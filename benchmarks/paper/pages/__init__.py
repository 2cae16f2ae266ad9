"""Pages of the study: for each a template, and a module of what the template asks for."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from benchmarks.paper import settings
from benchmarks.paper.methods import missing_modules
from benchmarks.study.pages import rendered
from benchmarks.study.study import Record
from scanweld.io.atomic import write_whole

FOLDER = Path(__file__).parent


def write_page(name: str, records: Sequence[Record], out: Path, *, quick: bool) -> str:
    """Write the page of a table of the study, and the pictures on it; what it says.

    The template sees ``records`` and all names of the settings, of the module that measures the
    table, and of the one that tells of it, whose ``draw(records, out)`` draws the pictures.
    """
    out.mkdir(parents=True, exist_ok=True)
    measuring, telling = (import_module(f"benchmarks.paper{at}.{name}") for at in ("", ".pages"))
    if hasattr(telling, "draw"):
        telling.draw(records, out)
    command = f"python -m benchmarks.paper --only {name}" + (" --quick" if quick else "")
    told = {
        "wrote": f"`{command}` wrote this page and [the records](data/{name}.json) behind it.",
        "missing": sorted(missing_modules()) if quick else [],
        "records": records,
    }
    values = vars(settings) | vars(measuring) | vars(telling) | told
    text = rendered(FOLDER / f"{name}.md", values).rstrip() + "\n"
    write_whole(out / f"{name}.md", text.encode())
    return text


def write_index(names: Sequence[str], out: Path) -> None:
    """Write the list of the pages that stand."""
    titles = {name: _title(name) for name in names if (out / f"{name}.md").exists()}
    text = rendered(FOLDER / "README.md", {"titles": titles})
    write_whole(out / "README.md", text.encode())


def _title(name: str) -> str:
    template = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    return template.partition("\n")[0].removeprefix("# ")
