"""The documentation says what the results and the code say, and its links lead somewhere."""

import re
from pathlib import Path
from urllib.parse import unquote

import pytest

import scanweld
from benchmarks.blocks import CONSTANT, constant
from scanweld.config import Config
from scanweld.evidence import rivals
from scanweld.evidence.evidence import (
    CONTRADICT_WEIGHT,
    FREE_PATCH_WEIGHT,
    FREE_WEIGHT,
    FRONT_PATCH_WEIGHT,
    GRAZING_WEIGHT,
    MAX_EXCESS,
    MIN_AGREE,
    VIOLATION_WEIGHT,
)
from scanweld.evidence.visibility import AGREE_COSINE, CONTRADICT_COSINE, MIN_FACING
from scanweld.graph.reasons import OUTWEIGHED
from scanweld.graph.refine_graph import MAX_SCORE_LOSS
from scanweld.io.scan_formats.registry import format_rows, formats_markdown
from scanweld.knowledge import turntable
from scanweld.pairs.verdict import MAX_CONTRADICTION
from tests import command_line

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
TEMPLATE = ROOT / "benchmarks/paper/method_template.md"
LINK = re.compile(r"\]\(([^)\s]+)\)")


def test_method_template_names_constants_that_are_there():
    text = TEMPLATE.read_text(encoding="utf-8")
    places = CONSTANT.findall(text)
    assert places and text.count("{{=") == len(places)
    for path in places:
        assert constant(path)


@pytest.mark.parametrize("path", ["heat.keypoints._NO_SUCH", "Config.heat.no_such", "no.such.X"])
def test_unknown_constants_are_refused(path: str):
    with pytest.raises(ValueError, match="no such constant"):
        constant(path)


@pytest.mark.parametrize("path", [*PAGES, TEMPLATE], ids=lambda p: p.name)
def test_links_lead_somewhere(path: Path):
    folder = DOCS if path == TEMPLATE else path.parent
    for link in LINK.findall(path.read_text(encoding="utf-8")):
        if link.startswith(("http://", "https://", "mailto:")):
            continue
        name, _, heading = unquote(link).partition("#")
        target = (folder / name).resolve() if name else path
        assert target.exists(), link
        if heading:
            assert heading in _headings(target), link


def test_formats_page_has_the_table_that_the_command_prints(capsys: pytest.CaptureFixture[str]):
    page = (DOCS / "formats.md").read_text(encoding="utf-8")
    found = re.search(r"<!-- begin: scan-formats -->\n(.*?)\n<!-- end -->", page, re.DOTALL)
    assert found and found[1].strip() == formats_markdown(), formats_markdown()
    assert command_line.scanweld("formats") == 0
    printed = capsys.readouterr().out
    for suffixes, title, kept in format_rows():
        assert suffixes in printed and f"{title}\n    kept besides points: {kept}" in printed


def _headings(page: Path) -> set[str]:
    """What the headings of a page are called in links to them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def test_report_page_gives_the_limits_of_the_code():
    text = " ".join((DOCS / "report.md").read_text(encoding="utf-8").split())
    config = Config()
    assert FREE_WEIGHT == 1.0
    for told in (
        f"n·m > {AGREE_COSINE:g}",
        f"n·m < {CONTRADICT_COSINE:g}",
        f"agree - {VIOLATION_WEIGHT:g} * front - {CONTRADICT_WEIGHT:g} * contradict - free "
        f"- grazing / {1 / GRAZING_WEIGHT:g}",
        f"cosine of incidence > {MIN_FACING:g}",
        f"> {MAX_EXCESS:g}): a part of the object moved",
        f"({FRONT_PATCH_WEIGHT:g} * front_patch + free_patch / {1 / FREE_PATCH_WEIGHT:g}) / agree",
        f"at most {MAX_CONTRADICTION:g}",
        f"agree < {MIN_AGREE:g}",
        f"more than {rivals.RIVAL_ANGLE_DEG:g} degrees or "
        f"{100 * rivals.RIVAL_SHIFT_DIAMETERS:g} % of the diameter away",
        f"The limits of a distinct pose are {rivals.RIVAL_ANGLE_DEG:g} degrees and "
        f"{100 * rivals.RIVAL_SHIFT_DIAMETERS:g} % of the diameter",
        f"turn by more than {turntable.RULE.min_turn_deg:g} degrees",
        f"agree on less than {MIN_AGREE:g}",
        f"more than {MAX_SCORE_LOSS:g} of their mean score",
        f"less than {'twice' if OUTWEIGHED == 2 else OUTWEIGHED} that pair's",
        f"up to `prepare.num_samples` ({config.prepare.num_samples})",
    ):
        assert told in text, told


def test_the_api_page_shows_every_public_name_once():
    shown = re.findall(r"^::: scanweld\.(\w+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(shown) == sorted(scanweld.__all__)
    for name in scanweld.__all__:
        assert name == "Event" or getattr(scanweld, name).__doc__, name
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", scanweld.__version__)
