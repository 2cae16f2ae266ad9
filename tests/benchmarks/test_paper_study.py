"""The study's bookkeeping: kept work, honest floors, clear errors, and a quick run of all of it."""

import json
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from benchmarks.paper import __main__ as command
from benchmarks.paper import methods, real_pairs, table1
from benchmarks.paper.methods import METHODS
from benchmarks.paper.pages import write_page
from benchmarks.paper.views import mesh_of
from benchmarks.study.records import Limit
from benchmarks.study.study import Record, Study, Table, read_records
from tests.data import require_data

OWN_TABLES = ("table1", "real_pairs")
LIBRARIES = sorted({module for entry in METHODS.values() for module in entry.needs})


def page_of(name: str, records: list[Record], out: Path) -> str:
    write_page(name, records, out, quick=True)
    return (out / f"{name}.md").read_text(encoding="utf-8")


class Squares:
    """A table whose units are numbers; it counts how often it measures."""

    NAME: str = "squares"

    def __init__(self, *numbers: int):
        self.numbers = numbers
        self.measured: list[int] = []

    def units(self, quick: bool) -> list[Mapping[str, Any]]:
        return [{"number": n} for n in self.numbers]

    def measure(self, unit: Mapping[str, Any]) -> Mapping[str, Any]:
        self.measured.append(unit["number"])
        if unit["number"] < 0:
            raise ArithmeticError("negative")
        return {"square": unit["number"] ** 2, "third": unit["number"] / 3}


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return Study(
        out=tmp_path / "out", work=tmp_path / "work", workers=1, quick=True, command="test"
    )


def records_of(study: Study, table: Table) -> list[Record]:
    return study.records(table, lambda done, total: None)


def test_finished_units_are_not_measured_again(study: Study):
    first, again = Squares(3, 1, 2), Squares(3, 1, 2)
    records = records_of(study, first)
    assert [r.result["square"] for r in records] == [9, 1, 4]
    assert records_of(study, again) == records
    assert again.measured == []


def test_more_units_measure_only_what_is_new(study: Study):
    records_of(study, Squares(3, 1))
    wider = Squares(1, 5, 3)
    assert [r.result["square"] for r in records_of(study, wider)] == [1, 25, 9]
    assert wider.measured == [5]


def test_what_a_kill_cut_short_is_measured_again_and_then_kept(study: Study):
    records_of(study, Squares(1, 2, 3))
    store = study.work / "squares.jsonl"
    store.write_bytes(store.read_bytes()[:-20])
    resumed, after = Squares(1, 2, 3), Squares(1, 2, 3)
    assert [r.result["square"] for r in records_of(study, resumed)] == [1, 4, 9]
    assert resumed.measured == [3]
    records_of(study, after)
    assert after.measured == []


def test_a_unit_that_fails_leaves_the_finished_ones(study: Study):
    with pytest.raises(ArithmeticError):
        records_of(study, Squares(1, 2, -1, 3))
    mended = Squares(1, 2, 3)
    records_of(study, mended)
    assert mended.measured == [3]


def test_progress_counts_what_was_kept(study: Study):
    records_of(study, Squares(1, 2))
    told: list[tuple[int, int]] = []
    study.records(Squares(1, 2, 3), lambda done, total: told.append((done, total)))
    assert told == [(2, 3), (3, 3)]


def test_records_come_back_from_their_json(study: Study):
    table = Squares(1, 7)
    records = records_of(study, table)
    study.write(table, records)
    assert read_records(study.out, "squares") == records
    document = json.loads((study.out / "data" / "squares.json").read_text())
    assert document["command"] == "test"
    assert document["records"][1] == {"number": 7, "result": {"square": 49, "third": 2.3333}}


def answer(deg: float | None, percent: float | None = 0.1, **more: Any) -> dict[str, Any]:
    return {"deg": deg, "percent": percent, "score": 0.5, "seconds": 1.0, **more}


def test_an_answer_is_right_by_angle_and_shift():
    limit = Limit(deg=1, percent=2)
    assert limit.holds(answer(0.9, 1.9))
    assert not limit.holds(answer(1.1, 0.1))
    assert not limit.holds(answer(0.1, 2.1))
    assert not limit.holds(answer(None, None))


def test_a_cell_counts_the_right_and_takes_their_median_only():
    told = [answer(0.1), answer(0.3), answer(90.0), answer(None, None)]
    limit = Limit(deg=1, percent=1)
    assert limit.cell(told) == "2/4 0.20"
    assert limit.cell(told[2:]) == "0/2"
    assert limit.cell([]) == ""
    assert limit.cell([*told, answer(4.0)], Limit(deg=5, percent=1)) == "2/5 0.20 (+1)"
    assert limit.cell(told, Limit(deg=5, percent=1)) == "2/4 0.20"
    assert limit.share(told) == 0.5


def pair_record(gap: int, overlap: float, deg: float | None, **changes: Any) -> Record:
    unit = {"object": "bunny", "noise": 0.0, "protocol": "random", "azimuth": 45, "gap": gap}
    told = answer(deg, None if deg is None else 0.1, accepted=False)
    return Record(
        unit={**unit, **changes}, result={"overlap": overlap, "answers": {"default": told}}
    )


def line_with(page: str, text: str) -> str:
    """The one line of a page that holds a text."""
    [line] = [line for line in page.splitlines() if text in line]
    return line


def test_the_floors_pass_where_they_are_met(tmp_path: Path):
    records = [pair_record(gap, 0.5, 0.1) for gap in (10, 90)]
    page = page_of("table1", [*records, pair_record(110, 0.2, 1.5)], tmp_path)
    assert "| < 1°, < 1 % | 2/2 | 100 % | pass |" in line_with(
        page, "bunny, any start, to 90°, no noise"
    )
    assert "| < 2°, < 1 % | 1/1 | 95 % | pass |" in line_with(page, "beyond 90°, overlap from 0.15")
    assert "FAIL" not in page
    assert (tmp_path / "table1.png").stat().st_size > 5000


def test_a_pair_below_the_floor_fails_and_is_named(tmp_path: Path):
    far = [pair_record(110, 0.12, 0.1, azimuth=a) for a in range(4)]
    page = page_of(
        "table1", [pair_record(90, 0.5, 1.1), *far, pair_record(120, 0.12, None)], tmp_path
    )
    assert "| 0/1 | 100 % | **FAIL** |" in line_with(page, "bunny, any start, to 90°, no noise")
    assert "| 4/5 | 80 % | pass |" in line_with(page, "beyond 90°, overlap 0.10-0.15")
    assert "| 0.50 | 1.1°, 0.1 % | no |" in line_with(page, "bunny, 45° and 135°")
    assert "no answer" in line_with(page, "bunny, 45° and 165°")


def test_the_papers_numbers_stand_only_beside_its_gaps(tmp_path: Path):
    some = [pair_record(gap, 0.5, 0.1) for gap in (30, 60)]
    assert "the paper: M-ICC" not in page_of("table1", some, tmp_path)
    every = [pair_record(gap, 0.5, 0.1) for gap in range(10, 100, 10)]
    page = page_of("table1", every, tmp_path)
    assert line_with(page, "the paper: M-ICC").count("< 1") == 6
    assert line_with(page, "scanweld, any start").count("< 1") == 9


def test_real_pairs_are_counted_by_overlap(tmp_path: Path):
    def record(overlap: float, default: float, other: float) -> Record:
        made = pair_record(60, overlap, None)
        answers = {"default": answer(default, accepted=overlap > 0.2), "gicp": answer(other)}
        return Record(unit=made.unit, result={"overlap": overlap, "answers": answers})

    records = [record(0.3, 0.1, 4.0), record(0.16, 6.0, 9.0), record(0.12, 3.0, 90.0)]
    page = page_of("real_pairs", records, tmp_path)
    from_015 = line_with(page, "- Overlap from 0.15")
    assert "right in 1 of 2 pairs; of the others GICP does best, 1 of 2." in from_015
    from_005 = line_with(page, "- Overlap 0.05-0.15")
    assert from_005.endswith("right in 1 of 1 pairs; no other method is right in any.")
    assert "vouches for 1 answers; 0 are wrong" in page
    rows = [line for line in page.splitlines() if line.startswith("| scanweld | ")]
    assert rows[0] == "| scanweld | 1/1 0.10 | 0/1 | 1/1 3.00 |"
    assert rows[1] == "| scanweld | 1/1 0.10 | 0/1 | 0/1 |"


def test_shares_of_matches_are_pooled_over_the_azimuths(tmp_path: Path):
    def record(azimuth: int, **matches: float) -> Record:
        made = pair_record(40, 0.5, 0.1, protocol="identity", azimuth=azimuth)
        return Record(unit=made.unit, result={**made.result, "matches": matches})

    one = record(0, keypoints=20, matched=10, right=2, by_chance=0.5)
    other = record(45, keypoints=30, matched=30, right=2, by_chance=1.5)
    page = page_of("table1", [one, other], tmp_path)
    assert line_with(page, "| 40° | 25 |").startswith("| 40° | 25 | 20.0 | 10 % | 5 % |")


def test_the_units_of_table_1_are_those_that_were_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(table1, "need_all", lambda names: None)
    monkeypatch.setattr(table1, "mesh_of", lambda name: None)
    units = table1.units(False)
    assert len({json.dumps(unit, sort_keys=True) for unit in units}) == len(units)
    clean = [unit for unit in units if not unit["noise"]]
    assert {unit["gap"] for unit in clean} == set(range(10, 130, 10))
    assert len(clean) == 2 * 2 * 8 * 12
    for unit in units:
        names = table1.methods_of(unit)
        assert set(names) <= set(METHODS)
        assert {"m-icc", "mm-icc", "paper"} <= set(names)
        if unit["protocol"] == "random":
            assert {"default", "fpfh-ransac"} <= set(names)
    with_cpd = [unit for unit in units if "cpd" in table1.methods_of(unit)]
    assert {unit["azimuth"] for unit in with_cpd} == {0, 90}
    assert not any(unit["noise"] for unit in with_cpd)


def test_real_pairs_come_with_their_overlap(monkeypatch: pytest.MonkeyPatch):
    require_data("stanford-bunny/overlaps.csv")
    require_data("stanford-dragon/overlaps.csv")
    monkeypatch.setattr(real_pairs, "need_all", lambda names: None)
    units = real_pairs.units(False)
    assert sum(unit["object"] == "bunny" for unit in units) == 45
    assert all(unit["gap"] < 121 for unit in units if unit["object"] == "dragon")
    assert any(0.10 <= unit["overlap"] < 0.15 for unit in units)


def test_missing_libraries_leave_their_methods_out_of_a_quick_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    for module in LIBRARIES:
        monkeypatch.setitem(sys.modules, module, None)
    for table in (table1, real_pairs):
        unit = table.units(True)[0]
        assert unit["missing"] == LIBRARIES
    left = methods.without(METHODS, LIBRARIES)
    assert "default" in left
    assert "gicp" not in left
    page = page_of("table1", [pair_record(30, 0.5, 0.1, missing=["open3d"])], tmp_path)
    assert "left out: open3d" in page


Refusal = Callable[..., str]


@pytest.fixture
def refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Refusal:
    """Run the command in vain; gives the one line that it says."""

    def run(*arguments: str) -> str:
        words = ["paper", "--out", str(tmp_path / "out"), "--workers", "1", *arguments]
        monkeypatch.setattr(sys, "argv", words)
        assert command.main() == 2
        lines = [line for line in capsys.readouterr().err.splitlines() if "error" in line]
        assert len(lines) == 1
        assert not (tmp_path / "out").exists()
        return lines[0]

    return run


def test_an_unknown_table_is_named_with_those_that_are(refused: Refusal):
    line = refused("--only", "tabel1")
    assert "tabel1: no such table" in line
    assert "table1" in line
    assert "real_pairs" in line


@pytest.mark.parametrize("name", OWN_TABLES)
def test_missing_data_name_the_variable(
    name: str, refused: Refusal, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setenv("SCANWELD_DATA", str(tmp_path / "nowhere"))
    for table in (table1, real_pairs):
        monkeypatch.setattr(table, "need_all", lambda names: None)
    mesh_of.cache_clear()
    line = refused("--only", name)
    assert "nowhere" in line
    assert "SCANWELD_DATA" in line


@pytest.mark.parametrize("name", OWN_TABLES)
def test_a_missing_library_names_the_extra(
    name: str, refused: Refusal, monkeypatch: pytest.MonkeyPatch
):
    for module in LIBRARIES:
        monkeypatch.setitem(sys.modules, module, None)
    line = refused("--only", name)
    assert any(module in line for module in LIBRARIES)
    assert "pip install 'scanweld[bench]'" in line


def test_pages_of_what_was_not_measured_say_so(refused: Refusal):
    assert "measure it first" in refused("--pages", "--only", "table1")


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a quick study of everything, without data and without open3d."""
    out = tmp_path_factory.mktemp("quick") / "paper"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SCANWELD_DATA", "/nowhere")
        run_quick(out, patch)
    return out


def run_quick(out: Path, patch: pytest.MonkeyPatch) -> None:
    words = ["paper", "--quick", "--out", str(out), "--workers", "1"]
    patch.setattr(sys, "argv", words)
    assert command.main() == 0


def test_a_quick_study_writes_all_pages(quick: Path):
    index = (quick / "README.md").read_text(encoding="utf-8")
    for name in command.TABLES:
        page = (quick / f"{name}.md").read_text(encoding="utf-8")
        assert f"({name}.md)" in index
        assert f"python -m benchmarks.paper --only {name} --quick" in page
        assert " nan" not in page
    for name in OWN_TABLES:
        assert (quick / f"{name}.png").stat().st_size > 5000
        answers = [record.result["answers"] for record in read_records(quick, name)]
        assert answers
        assert all({"m-icc", "mm-icc", "paper", "default"} <= set(each) for each in answers)
        assert all(Limit(deg=1, percent=1).holds(each["default"]) for each in answers)
    assert "FAIL" not in (quick / "table1.md").read_text(encoding="utf-8")
    assert "stand in" in (quick / "real_pairs.md").read_text(encoding="utf-8")


def test_a_study_goes_on_where_it_was_stopped(
    quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    work, out = quick.parent / ".paper.work", tmp_path / "paper"
    shutil.copytree(work, tmp_path / ".paper.work")
    store = tmp_path / ".paper.work" / "table1.jsonl"
    kept = store.read_bytes()
    store.write_bytes(kept[:-30])
    words = ["paper", "--quick", "--only", "table1", "real_pairs", "--out", str(out)]
    monkeypatch.setattr(sys, "argv", [*words, "--workers", "1"])
    assert command.main() == 0
    other = "real_pairs.jsonl"
    assert (tmp_path / ".paper.work" / other).read_bytes() == (work / other).read_bytes()
    lines, before = store.read_bytes().splitlines(), kept.splitlines()
    assert lines[:-2] == before[:-1]
    assert json.loads(lines[-1])["key"] == json.loads(before[-1])["key"]
    assert _without_seconds(out) == _without_seconds(quick)


def _without_seconds(out: Path) -> list[Mapping[str, Any]]:
    """What a study found in Table 1, but for what it cost."""
    found = [record.result["answers"] for record in read_records(out, "table1")]
    return [
        {name: {**answer, "seconds": 0.0} for name, answer in answers.items()} for answers in found
    ]
