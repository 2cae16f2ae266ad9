"""From folders, patterns and files to scans with unique names."""

import logging
import os
import sys
from itertools import permutations
from pathlib import Path
from typing import Never

import pytest

from scanweld.errors import InputError, ReadError
from scanweld.io import collect, natural_key, read_scan
from scanweld.io.depth.capture import DepthOptions, as_named, collect_named
from scanweld.io.not_scans import FOREIGN
from scanweld.io.scan_formats.registry import formats_by_suffix


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder as it is found in practice."""
    names = ["scan10.ply", "scan2.ply", "Scan1.PLY", "mesh.obj", "cloud.xyz"]
    names += ["README.txt", "README.md", "overlaps.csv", "bun.conf", "poses.json", "._scan2.ply"]
    scans = tmp_path / "scans"
    (scans / "inner").mkdir(parents=True)
    (scans / "folder.ply").mkdir()
    for name in [*names, "inner/scan3.ply"]:
        (scans / name).write_text("")
    return scans


def names_of(*inputs: Path | str) -> list[str]:
    return [scan.name for scan in collect(inputs)]


def test_a_folder_gives_its_scans_in_natural_order(folder: Path):
    found = collect([folder])
    assert [scan.name for scan in found] == ["Scan1", "cloud", "mesh", "scan2", "scan10"]
    assert all(scan.path.parent == folder for scan in found)


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_link_to_nothing_is_left_for_the_reader_to_name(folder: Path):
    (folder / "scan3.ply").symlink_to(folder / "gone.ply")
    assert "scan3" in names_of(folder) and "scan3" in names_of(f"{folder}/scan*.ply")
    with pytest.raises(ReadError, match=r"scan3\.ply: cannot be read"):
        read_scan(folder / "scan3.ply")


def test_a_pattern_is_a_folder_that_is_filtered(folder: Path):
    assert names_of(f"{folder}/scan*.ply") == ["scan2", "scan10"]
    assert names_of(f"{folder}/*") == ["Scan1", "cloud", "mesh", "scan2", "scan10"]
    assert names_of(f"{folder}/*.txt") == ["README"]
    assert names_of(folder / "README.txt", folder / "scan2.ply") == ["README", "scan2"]
    (folder / "scan[2].ply").write_text("")
    assert names_of(folder / "scan[2].ply") == ["scan[2]"]


def test_order_repetition_and_spelling_of_inputs_do_not_matter(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    inputs = [folder / "scan2.ply", folder / "inner", f"{folder}/*.obj", folder]
    results = {collect(order) for order in permutations(inputs)}
    assert len({tuple(scan.name for scan in result) for result in results}) == 1
    assert len(collect(inputs)) == 6
    monkeypatch.chdir(folder)
    found = collect(["scan2.ply", folder / "inner" / ".." / "scan2.ply"])
    assert len(found) == 1


def test_the_same_stem_twice_makes_all_names_relative_paths(folder: Path):
    (folder / "inner" / "scan2.ply").write_text("")
    assert names_of(folder, folder / "inner") == [
        *["Scan1", "cloud", "inner/scan2", "inner/scan3", "mesh", "scan2", "scan10"]
    ]
    inputs = [folder / "scan2.ply", folder / "scan2.obj", folder / "mesh.obj"]
    inputs[1].write_text("")
    assert names_of(*inputs) == ["mesh.obj", "scan2.obj", "scan2.ply"]


def test_what_is_missing_or_of_an_unknown_format_is_an_error(folder: Path):
    with pytest.raises(ReadError, match=r"scan77\.ply: there is no such file"):
        collect([folder, folder / "scan77.ply"])
    with pytest.raises(ReadError, match=r"poses\.json: unknown format"):
        collect([folder / "poses.json"])
    with pytest.raises(InputError, match="no scans given"):
        collect([])
    (folder / "loop.obj").symlink_to("loop.obj")
    with pytest.raises(ReadError, match=r"loop\.obj: is a link that leads nowhere"):
        collect([folder / "loop.obj"])
    for what in ("folder.ply", "*.las", "none*.ply"):
        with pytest.raises(InputError, match="holds no scans"):
            collect([os.path.join(folder, what)])


def test_a_folder_that_cannot_be_listed_and_a_name_that_cannot_be_are_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    with pytest.raises(ReadError, match="there is no such file"):
        collect(["n" * 300 + ".ply", folder])

    def refuse(path: Path) -> Never:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refuse)
    with pytest.raises(ReadError, match=r"cannot be listed \(Permission denied\)"):
        collect_named(as_named([folder], DepthOptions()))


def test_a_folder_without_scans_says_what_it_holds_and_what_to_export(tmp_path: Path):
    for name in ("a.fls", "b.FLS", "shot.bag", "notes.md", "points.txt", ".DS_Store"):
        (tmp_path / name).write_text("")
    (tmp_path / "inner").mkdir()
    with pytest.raises(InputError) as raised:
        collect([tmp_path])
    told = str(raised.value)
    assert told.startswith(f"{tmp_path}: the folder holds no scans, but 2 .fls (FARO SCENE: export")
    assert "shot.bag (a recording of ROS or RealSense: export depth images or PLY)" in told
    assert "points.txt (name it if that is a scan)" in told and "inner/ (name it, too)" in told
    assert "notes.md" in told and "DS_Store" not in told and "\n" not in told
    for k in range(30):
        (tmp_path / f"x.{k}").write_text("")
    with pytest.raises(InputError, match=r"2 \.fls.* and \d+ more; scanweld looks for"):
        collect([tmp_path])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="the folder holds no scans; scanweld looks for"):
        collect([tmp_path / "empty"])


def test_a_folder_with_scans_says_what_else_lies_there(
    folder: Path, caplog: pytest.LogCaptureFixture
):
    with caplog.at_level(logging.INFO, "scanweld"):
        collect([folder])
    (record,) = caplog.records
    assert record.levelname == "INFO" and "bun.conf" in record.message
    caplog.clear()
    (folder / "more.rcp").write_text("")
    collect([folder])
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert "the folder also holds more.rcp (Autodesk ReCap: export E57 or PTS" in record.message


@pytest.mark.parametrize("suffix", [suffix for kind in FOREIGN for suffix in kind.suffixes])
def test_a_file_that_others_read_is_refused_with_what_to_export(tmp_path: Path, suffix: str):
    (kind,) = [kind for kind in FOREIGN if suffix in kind.suffixes]  # told of once
    assert suffix == suffix.lower() and suffix not in formats_by_suffix()  # never of what is read
    path = tmp_path / f"scan{suffix.upper()}"
    path.write_text("")
    for read in (read_scan, lambda path: collect([path])):
        with pytest.raises(ReadError) as raised:
            read(path)
        assert str(raised.value).startswith(f"{path}: is a format that scanweld does not read")
        assert str(raised.value).endswith(kind.remedy)


def test_what_to_export_is_documented():
    text = (Path(__file__).parents[1] / "docs/formats.md").read_text(encoding="utf-8")
    for kind in FOREIGN:
        suffixes = " ".join(f"`{suffix}`" for suffix in kind.suffixes)
        assert f"| {suffixes} | {kind.title} | {kind.remedy} |" in text


def test_natural_order():
    names = ["b", "a10", "a2", "a02", "a", "10", "9", "a2b1"]
    assert sorted(names, key=natural_key) == ["9", "10", "a", "a02", "a2", "a2b1", "a10", "b"]
