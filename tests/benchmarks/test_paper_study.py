"""The study's bookkeeping: kept work, honest floors, clear errors, and a quick run of all of it."""

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from benchmarks.paper import __main__ as command
from benchmarks.paper import real_pairs, table1
from benchmarks.paper.methods import METHODS
from benchmarks.paper.pages import write_page
from benchmarks.paper.views import mesh_of
from benchmarks.study.records import Limit
from benchmarks.study.study import Record, Study, Table, read_records
from tests.data import require_data

OWN_TABLES = ("table1", "real_pairs")
LIBRARIES = sorted({module for entry in METHODS.values() for module in entry.needs})


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


def test_only_what_is_not_finished_is_measured(study: Study):
    records = records_of(study, Squares(3, 1))
    again, wider = Squares(3, 1), Squares(1, 5, 3)
    assert records_of(study, again) == records and again.measured == []
    told: list[tuple[int, int]] = []
    found = study.records(wider, lambda done, total: told.append((done, total)))
    assert [r.result["square"] for r in found] == [1, 25, 9]
    assert wider.measured == [5] and told == [(2, 3), (3, 3)]


def test_a_unit_that_fails_leaves_the_finished_ones(study: Study):
    with pytest.raises(ArithmeticError):
        records_of(study, Squares(1, 2, -1, 3))
    mended = Squares(1, 2, 3)
    records_of(study, mended)
    assert mended.measured == [3]


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


def test_answers_are_right_by_angle_and_shift_and_cells_count_them():
    limit, wider = Limit(deg=1, percent=2), Limit(deg=5, percent=2)
    assert limit.holds(answer(0.9, 1.9))
    for wrong in (answer(1.1, 0.1), answer(0.1, 2.1), answer(None, None)):
        assert not limit.holds(wrong)
    told = [answer(0.1), answer(0.3), answer(90.0), answer(None, None)]
    assert limit.cell(told) == "2/4 0.20"
    assert limit.cell(told[2:]) == "0/2"
    assert limit.cell([]) == ""
    assert limit.cell([*told, answer(4.0)], wider) == "2/5 0.20 (+1)"
    assert limit.cell(told, wider) == "2/4 0.20"
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


def test_floors_pass_or_fail_and_name_the_pairs_that_miss_them(tmp_path: Path):
    met = [*(pair_record(gap, 0.5, 0.1) for gap in (10, 90)), pair_record(110, 0.2, 1.5)]
    page = write_page("table1", met, tmp_path, quick=True)
    near, far = "bunny, any start, to 90°, no noise", "beyond 90°, overlap"
    assert "| < 1°, < 1 % | 2/2 | 100 % | pass |" in line_with(page, near)
    assert "| < 2°, < 1 % | 1/1 | 95 % | pass |" in line_with(page, f"{far} from 0.15")
    assert "FAIL" not in page
    some = [pair_record(110, 0.12, 0.1, azimuth=a) for a in range(4)]
    missed = [pair_record(90, 0.5, 1.1), *some, pair_record(120, 0.12, None)]
    page = write_page("table1", missed, tmp_path, quick=True)
    assert "| 0/1 | 100 % | **FAIL** |" in line_with(page, near)
    assert "| 4/5 | 80 % | pass |" in line_with(page, f"{far} 0.10-0.15")
    assert "| 0.50 | 1.1°, 0.1 % | no |" in line_with(page, "bunny, 45° and 135°")
    assert "no answer" in line_with(page, "bunny, 45° and 165°")


def test_the_papers_numbers_stand_only_beside_its_gaps(tmp_path: Path):
    def page(gaps: range) -> str:
        records = [pair_record(gap, 0.5, 0.1) for gap in gaps]
        return write_page("table1", records, tmp_path, quick=True)

    assert "the paper: M-ICC" not in page(range(30, 90, 30))
    assert line_with(page(range(10, 100, 10)), "the paper: M-ICC").count("< 1") == 6
    assert line_with(page(range(10, 100, 10)), "scanweld, any start").count("< 1") == 9


def test_real_pairs_are_counted_by_overlap(tmp_path: Path):
    def record(overlap: float, default: float, other: float) -> Record:
        answers = {"default": answer(default, accepted=overlap > 0.2), "gicp": answer(other)}
        return Record(unit={"object": "bunny"}, result={"overlap": overlap, "answers": answers})

    records = [record(0.3, 0.1, 4.0), record(0.16, 6.0, 9.0), record(0.12, 3.0, 90.0)]
    page = write_page("real_pairs", records, tmp_path, quick=True)
    from_015 = line_with(page, "- Overlap from 0.15")
    assert "right in 1 of 2 pairs; of the others GICP does best, 1 of 2." in from_015
    from_005 = line_with(page, "- Overlap 0.05-0.15")
    assert from_005.endswith("right in 1 of 1 pairs; no other method is right in any.")
    assert "vouches for 1 answers; 0 are wrong" in page
    rows = [line for line in page.splitlines() if line.startswith("| scanweld | ")]
    assert rows[0] == "| scanweld | 1/1 0.10 | 0/1 | 1/1 3.00 |"
    assert rows[1] == "| scanweld | 1/1 0.10 | 0/1 | 0/1 |"


def test_the_units_are_those_that_were_asked_for(monkeypatch: pytest.MonkeyPatch):
    require_data("stanford-dragon/overlaps.csv")
    for table in (table1, real_pairs):
        monkeypatch.setattr(table, "need_all", lambda names: None)
    monkeypatch.setattr(table1, "mesh_of", lambda name: None)
    units = table1.units(False)
    assert len({json.dumps(unit, sort_keys=True) for unit in units}) == len(units)
    clean = [unit for unit in units if not unit["noise"]]
    assert {unit["gap"] for unit in clean} == set(range(10, 130, 10))
    assert len(clean) == 2 * 2 * 8 * 12
    for unit in units:
        names = set(table1.methods_of(unit))
        assert {"m-icc", "mm-icc", "paper"} <= names <= set(METHODS)
        assert unit["protocol"] == "identity" or {"default", "fpfh-ransac"} <= names
    with_cpd = [unit for unit in units if "cpd" in table1.methods_of(unit)]
    assert {(unit["azimuth"], unit["noise"]) for unit in with_cpd} == {(0, 0.0), (90, 0.0)}
    real = real_pairs.units(False)
    assert sum(unit["object"] == "bunny" for unit in real) == 45
    assert all(unit["gap"] < 121 for unit in real if unit["object"] == "dragon")


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
        [line] = [line for line in capsys.readouterr().err.splitlines() if "error" in line]
        assert not (tmp_path / "out").exists()
        return line

    return run


def test_what_is_missing_is_named(
    refused: Refusal, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    line = refused("--only", "tabel1")
    assert "tabel1: no such table" in line and "real_pairs" in line
    assert "measure it first" in refused("--pages", "--only", "table1")
    monkeypatch.setenv("SCANWELD_DATA", str(tmp_path / "nowhere"))
    mesh_of.cache_clear()
    with monkeypatch.context() as patch:
        for table in (table1, real_pairs):
            patch.setattr(table, "need_all", lambda names: None)
        for name in OWN_TABLES:
            line = refused("--only", name)
            assert "nowhere" in line and "SCANWELD_DATA" in line
    for module in LIBRARIES:
        monkeypatch.setitem(sys.modules, module, None)
    for name in OWN_TABLES:
        line = refused("--only", name)
        assert any(module in line for module in LIBRARIES)
        assert "pip install 'scanweld[bench]'" in line
    page = write_page("table1", [pair_record(30, 0.5, 0.1)], tmp_path, quick=True)
    assert f"left out: {', '.join(LIBRARIES)}" in page


def run_quick(out: Path, patch: pytest.MonkeyPatch, *options: str) -> None:
    words = ["paper", "--quick", "--out", str(out), "--workers", "1", *options]
    patch.setattr(sys, "argv", words)
    patch.setenv("SCANWELD_DATA", "/nowhere")
    assert command.main() == 0


def test_a_quick_study_writes_all_pages_and_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    out = tmp_path / "paper"
    run_quick(out, monkeypatch)
    index = (out / "README.md").read_text(encoding="utf-8")
    for name in command.TABLES:
        page = (out / f"{name}.md").read_text(encoding="utf-8")
        assert f"({name}.md)" in index
        assert f"python -m benchmarks.paper --only {name} --quick" in page
        assert " nan" not in page and "FAIL" not in page
    assert "stand in" in (out / "real_pairs.md").read_text(encoding="utf-8")
    for name in OWN_TABLES:
        answers = [record.result["answers"] for record in read_records(out, name)]
        assert all({"m-icc", "mm-icc", "paper", "default"} <= set(each) for each in answers)
        assert all(Limit(deg=1, percent=1).holds(each["default"]) for each in answers)
    kept = {path: path.read_bytes() for path in (tmp_path / ".paper.work").rglob("*.json")}
    gone = next(path for path in kept if path.parent.name == OWN_TABLES[0])
    gone.unlink()
    run_quick(out, monkeypatch, "--only", *OWN_TABLES)
    assert json.loads(gone.read_bytes()).keys() == json.loads(kept.pop(gone)).keys()
    assert all(path.read_bytes() == content for path, content in kept.items())
