"""Pages that benchmarks write say what their records say."""

from pathlib import Path

import pytest
from jinja2 import UndefinedError

from benchmarks import pages
from benchmarks.blocks import BLOCK, TEMPLATES, grid
from benchmarks.paper import method
from benchmarks.paper.__main__ import TABLES
from benchmarks.paper.pages import write_index, write_page
from benchmarks.study.study import read_records
from scanweld.errors import InputError
from scanweld.evidence.evidence import MIN_AGREE

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAPER = DOCS / "paper"


@pytest.mark.parametrize(
    "name", ["../README.md", "benchmarks.md", "model.md", "formats.md", "depth.md", "video.md"]
)
def test_measured_parts_are_those_of_the_results(name: str):
    text = (DOCS / name).read_text(encoding="utf-8")
    assert BLOCK.findall(text)
    assert pages.rewritten(text) == text, "run python -m benchmarks.pages"


def test_every_measured_part_stands_somewhere():
    text = "".join(path.read_text(encoding="utf-8") for path in pages.PAGES)
    assert {name for _, name, _ in BLOCK.findall(text)} == {*pages.BLOCKS, pages.TABLE_OF_FORMATS}


def test_method_is_what_its_template_and_the_results_make():
    committed = (DOCS / "method.md").read_text(encoding="utf-8")
    assert committed == method.method_text(PAPER), "run python -m benchmarks.paper --pages"


def test_a_template_refuses_to_leave_a_number_out():
    page = TEMPLATES.from_string("{{=evidence.evidence.MIN_AGREE}} {{ told.number }}")
    assert page.render(told={"number": 3}) == f"{MIN_AGREE:g} 3"
    with pytest.raises(UndefinedError, match="number"):
        page.render(told={})


def test_a_missing_result_is_told_in_one_line(tmp_path: Path):
    with pytest.raises(InputError, match=r"^\S+: is missing; measure it first \(.*\)$"):
        method.method_text(tmp_path, tmp_path)


# The page of the figures draws them, which takes too long here and needs the meshes.
@pytest.mark.parametrize("name", [name for name in TABLES if name != "figures"])
def test_pages_of_the_study_are_those_of_its_results(name: str, tmp_path: Path):
    made = write_page(name, read_records(PAPER, name), tmp_path, quick=False)
    committed = (PAPER / f"{name}.md").read_text(encoding="utf-8")
    assert committed == made, "run python -m benchmarks.paper --pages"


def test_the_index_lists_the_pages_that_stand(tmp_path: Path):
    (tmp_path / "basins.md").write_text("")
    write_index(TABLES, tmp_path)
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert text.endswith("\n\n- [Basins of convergence](basins.md)\n")


def test_a_grid_leaves_empty_rows_out():
    rows, columns = {"one": 1, "none": 0}, {"twice": 2, "thrice": 3}
    text = grid("n", rows, columns, lambda row, column: str(row * column) if row else "")
    assert text == "| n | twice | thrice |\n| --- | --- | --- |\n| one | 2 | 3 |\n"
