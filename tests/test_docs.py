"""The documentation says what the results and the code say, and its links lead somewhere."""

import importlib
import re
import sys
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote

import pytest

import scanweld
from benchmarks.blocks import BLOCK
from benchmarks.paper import ablations, method_reasons
from benchmarks.paper.method_numbers import NUMBERS
from benchmarks.paper.method_page import PLACE, TEMPLATE, constant, method_text
from benchmarks.paper.method_results import Results
from benchmarks.paper.pages import write_page
from benchmarks.paper.study import Study, read_records
from benchmarks.paper.tables import table, table_names
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.evidence import rivals
from scanweld.evidence.evidence import CONTRADICT_WEIGHT, FREE_WEIGHT, MIN_AGREE, VIOLATION_WEIGHT
from scanweld.evidence.visibility import AGREE_COSINE, CONTRADICT_COSINE
from scanweld.graph.reasons import OUTWEIGHED
from scanweld.graph.refine_graph import MAX_SCORE_LOSS
from scanweld.knowledge import turntable

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")
MEASURED = [DOCS / "method.md", DOCS / "paper"]
"""What stands in the repository only once the study was made."""


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch):
    """The script benchmarks/pages.py, imported from its own folder as scripts are."""
    folder = ROOT / "benchmarks"
    monkeypatch.syspath_prepend(str(folder))
    yield importlib.import_module("pages")
    for name, module in list(sys.modules.items()):
        if getattr(module, "__file__", None) and Path(str(module.__file__)).parent == folder:
            del sys.modules[name]


@pytest.mark.parametrize(
    "path", [ROOT / "README.md", DOCS / "benchmarks.md", DOCS / "model.md"], ids=lambda p: p.name
)
def test_measured_parts_are_those_of_the_results(path: Path, pages: ModuleType):
    text = path.read_text(encoding="utf-8")
    assert BLOCK.findall(text)
    try:
        again = pages.rewritten(text)
    except FileNotFoundError as error:
        pytest.skip(f"no results yet: {error.filename}")
    assert again == text, "run python benchmarks/pages.py"


def test_every_measured_part_stands_somewhere(pages: ModuleType):
    text = "".join(path.read_text(encoding="utf-8") for path in pages.PAGES)
    assert {name for _, name, _ in BLOCK.findall(text)} == set(pages.BLOCKS)


def test_method_template_names_numbers_and_constants_that_are_there():
    places = PLACE.findall(TEMPLATE.read_text(encoding="utf-8"))
    assert {name for equals, name in places if not equals} == set(NUMBERS)
    for equals, path in places:
        assert not equals or constant(path)
    assert TEMPLATE.read_text(encoding="utf-8").count("{{") == len(places)


def test_reasons_ask_for_variants_that_the_ablations_measure():
    assert set(method_reasons._CONTOURS.values()) <= set(ablations.contours.VARIANTS)
    assert set(method_reasons._HEAT.values()) <= set(ablations.heat.VARIANTS)
    assert set(method_reasons._COARSE.values()) <= set(ablations.coarse.VARIANTS)
    assert set(method_reasons._SCORES.values()) <= set(ablations.search.SCORES)
    terms = {ablations.terms.ALONE, *ablations.terms.WEIGHTS}
    assert set(method_reasons._TERMS.values()) <= terms


def test_method_is_what_its_template_and_the_results_make(tmp_path: Path):
    for path in ("heat.keypoints._NO_SUCH", "Config.heat.no_such", "no.such.X"):
        with pytest.raises(ValueError, match="no such constant"):
            constant(path)
    with pytest.raises(InputError, match=r"^\S+: is missing; measure it first \(.*\)$"):
        method_text(Results(tmp_path, tmp_path))
    try:
        text = method_text(Results(DOCS / "paper"))
    except InputError as error:
        pytest.skip(f"no results yet: {error}")
    committed = (DOCS / "method.md").read_text(encoding="utf-8")
    assert committed == text, "run python -m benchmarks.paper --pages"


# The page of the figures draws them, which takes too long here and needs the meshes.
@pytest.mark.parametrize("name", [name for name in table_names() if name != "figures"])
def test_pages_of_the_study_are_those_of_its_results(name: str, tmp_path: Path):
    try:
        records = read_records(DOCS / "paper", name)
    except FileNotFoundError as error:
        pytest.skip(f"no results yet: {error.filename}")
    study = Study(out=tmp_path, work=tmp_path, workers=1, quick=False, command="")
    write_page(table(name), records, study)
    made = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    committed = (DOCS / f"paper/{name}.md").read_text(encoding="utf-8")
    assert committed == made, "run python -m benchmarks.paper --pages"


@pytest.mark.parametrize("path", [*PAGES, TEMPLATE], ids=lambda p: p.name)
def test_links_lead_somewhere(path: Path):
    folder = DOCS if path == TEMPLATE else path.parent
    for link in LINK.findall(path.read_text(encoding="utf-8")):
        if link.startswith(("http://", "https://", "mailto:")):
            continue
        name, _, heading = unquote(link).partition("#")
        target = (folder / name).resolve() if name else path
        if not target.exists() and _is_measured(target):
            continue
        assert target.exists(), link
        if heading:
            assert heading in _headings(target), link


def _is_measured(target: Path) -> bool:
    """Whether a page or picture is missing because the study was not made."""
    measured = any(target == place or place in target.parents for place in MEASURED)
    return measured and not all((DOCS / f"paper/data/{n}.json").exists() for n in table_names())


def _headings(page: Path) -> set[str]:
    """What the headings of a page are called in links to them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def test_report_page_gives_the_limits_of_the_code():
    text = " ".join((DOCS / "report.md").read_text(encoding="utf-8").split())
    assert pytest.approx(1 / 3) == FREE_WEIGHT
    angle, shift = rivals.RIVAL_ANGLE_DEG, 100 * rivals.RIVAL_SHIFT_DIAMETERS
    for told in (
        f"n·m > {AGREE_COSINE:g}",
        f"n·m < {CONTRADICT_COSINE:g}",
        f"agree - {VIOLATION_WEIGHT:g} * front - {CONTRADICT_WEIGHT:g} * contradict - free / 3",
        f"agree < {MIN_AGREE:g}",
        f"more than {angle:g} degrees or {shift:g} % of the diameter away",
        f"The limits of a distinct pose are {angle:g} degrees and {shift:g} % of the diameter",
        f"turn by more than {turntable.MIN_TURN_DEG:g} degrees",
        f"agree on less than {MIN_AGREE:g}",
        f"more than {MAX_SCORE_LOSS:g} of their mean score",
        f"less than {'twice' if OUTWEIGHED == 2 else OUTWEIGHED} that pair's",
        f"up to `prepare.num_samples` ({Config().prepare.num_samples})",
    ):
        assert told in text, told


def test_the_api_page_shows_every_public_name_once():
    shown = re.findall(r"^::: scanweld\.(\w+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(shown) == sorted(scanweld.__all__)
    for name in scanweld.__all__:
        assert name == "Event" or getattr(scanweld, name).__doc__, name
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", scanweld.__version__)
