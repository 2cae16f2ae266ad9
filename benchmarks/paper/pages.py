"""Markdown of the study: tables, pages and their index."""

from collections.abc import Iterable, Sequence

from benchmarks.paper.study import Record, Study, Table
from benchmarks.paper.tables import table, table_names
from scanweld.io.atomic import write_whole

_INDEX = """# The paper, reproduced and surpassed

The tables and figures of the published method (PA-HKS and MM-ICC) beside those of the default
method and of other tools; `make paper` measures them all again. Each page prints the command that
wrote it, and the records behind it lie in `data/` as JSON. They name
the code that was measured by a digest: until `make paper` has run again, the figures of the
default method are of that code, not of a later one.

"""


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def write_page(one: Table, records: Sequence[Record], study: Study) -> None:
    """Write the page of a table: title, command, and what the table says of its records."""
    study.out.mkdir(parents=True, exist_ok=True)
    command = f"python -m benchmarks.paper --only {one.NAME}" + (" --quick" if study.quick else "")
    head = f"# {one.TITLE}\n\n`{command}` wrote this page and [the records](data/{one.NAME}.json) "
    body = one.page(records, study.out)
    write_whole(study.out / f"{one.NAME}.md", f"{head}behind it.\n\n{body}".encode())


def write_index(study: Study) -> None:
    """Write the list of the pages that stand."""
    lines = [
        f"- [{table(name).TITLE}]({name}.md)\n"
        for name in table_names()
        if (study.out / f"{name}.md").exists()
    ]
    write_whole(study.out / "README.md", (_INDEX + "".join(lines)).encode())


def percent(share: float) -> str:
    """A share as a whole percentage."""
    return f"{100 * share:.0f} %"
