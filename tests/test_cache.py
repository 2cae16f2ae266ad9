"""Finished work on disk: exact or absent, bounded, and gone at any time without harm."""

import hashlib
import io
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.cache import CacheSize, FileCache, cache_folder
from scanweld.app.job import Limits, run_job
from scanweld.config import Config, FusionConfig, PairsConfig
from scanweld.errors import WriteError
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.pairs.result import PairResult
from scanweld.pipeline.preparations import Preparation
from scanweld.work.records import Records
from tests.command_line import scanweld
from tests.scenes import creature_scene, write_scans


def test_cached_scan_comes_back_equal_and_frozen(tmp_path: Path):
    scan = RangeScan(name="a", points=np.arange(12.0).reshape(4, 3))
    cache = FileCache(tmp_path, Records(RangeScan))
    assert cache.get("ab") is None and cache.size().records == 0
    cache.put("ab", (scan, Pose.identity()))
    kept = cache.get("ab")
    assert isinstance(kept, tuple)
    assert kept[0].content_hash() == scan.content_hash()
    assert not kept[0].points.flags.writeable and not kept[1].rotation.flags.writeable
    assert [path.name for path in tmp_path.iterdir()] == ["ab.record"]


@pytest.mark.parametrize("length", [0, 1, 31, 32, 33, -1, None])
def test_a_truncated_or_damaged_entry_counts_as_absent(tmp_path: Path, length: int | None):
    cache = FileCache(tmp_path)
    cache.put("ab", tuple(range(100)))
    data = bytearray((tmp_path / "ab.record").read_bytes())
    data[-5] ^= length is None
    (tmp_path / "ab.record").write_bytes(data[:length])
    assert cache.get("ab") is None
    cache.put("ab", "again")
    assert cache.get("ab") == "again"


class Evil:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (pytest.fail, ("code of the cache was run",))


@pytest.mark.parametrize("suffix", ["record", "pkl"])
def test_a_folder_from_elsewhere_cannot_run_code(tmp_path: Path, suffix: str):
    objects = io.BytesIO()
    np.savez(objects, tree=np.array([Evil()], dtype=object))
    for body in (pickle.dumps(Evil()), objects.getvalue()):
        (tmp_path / f"ab.{suffix}").write_bytes(hashlib.sha256(body).digest() + body)
        assert FileCache(tmp_path).get("ab") is None


def test_keys_stay_inside_the_folder(tmp_path: Path):
    with pytest.raises(ValueError, match="hex"):
        FileCache(tmp_path / "cache").put("../ab", 1)
    assert not list(tmp_path.iterdir())


def test_what_was_not_used_for_longest_goes_first(tmp_path: Path):
    one = np.zeros(10_000)
    cache = FileCache(tmp_path, max_bytes=500_000)
    for k in range(5):
        cache.put(f"a{k}", one)
        os.utime(tmp_path / f"a{k}.record", ns=(k, k))
    assert cache.get("a0") is not None  # and is now the last used
    for reopened in (cache, FileCache(tmp_path, max_bytes=500_000)):
        reopened.put(f"b{id(reopened)}", one)
        reopened.put(f"c{id(reopened)}", one)
        assert reopened.size().bytes <= 500_000
    assert cache.get("a0") is not None and cache.get("a1") is None and cache.get("a2") is None


def test_the_folder_may_go_while_a_run_uses_it(tmp_path: Path):
    cache = FileCache(tmp_path / "deep" / "kept")
    cache.put("ab", 1)
    shutil.rmtree(tmp_path / "deep")
    assert cache.get("ab") is None and cache.size() == CacheSize(records=0, bytes=0)
    cache.put("ab", 2)
    assert cache.get("ab") == 2
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(WriteError, match="--no-cache"):
        FileCache(tmp_path / "file").put("ab", 1)


def test_the_command_tells_and_clears(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    FileCache(cache_folder(Path("model"))).put("ab", np.zeros(250_000))
    (tmp_path / "mine").write_text("mine")
    assert scanweld("cache", "info") == 0
    assert capsys.readouterr().out == ".scanweld-cache: 1 record kept, 2.0 MB\n"
    assert scanweld("cache", "clear", tmp_path) == 0
    assert "1 record removed" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert scanweld("cache", "clear") == 0
    assert "0 records removed" in capsys.readouterr().out


@pytest.mark.slow
def test_a_scan_more_or_fewer_redoes_what_it_touches_and_changes_no_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scans = creature_scene(4, pixels=60.0).scans
    folder = write_scans(tmp_path / "scans", scans)
    files = sorted(folder.iterdir())
    pairs = PairsConfig(num_anchors=8, num_turns=8, num_survivors=(40, 10))
    config = Config(pairs=pairs, fusion=FusionConfig(max_voxels_across=60, with_doubtful=True))
    put, kept = FileCache.put, list[object]()

    def counted(self: FileCache, key: str, value: object) -> None:
        kept.append(value)
        put(self, key, value)

    monkeypatch.setattr(FileCache, "put", counted)

    def model(name: str, inputs: list[Path], keeps: bool = True) -> dict[str, bytes]:
        kept.clear()
        output = tmp_path / name
        run_job(inputs, output, config, limits=Limits(workers=2, keeps=keeps))
        written = {path.name: path.read_bytes() for path in output.iterdir()}
        return {name: data for name, data in written.items() if "report" not in name}

    model("three", files[:3])
    four = model("four", files)
    assert "model.ply" in four and sum(isinstance(value, Preparation) for value in kept) == 1
    quick = [value for value in kept if isinstance(value, PairResult) and not value.is_searched]
    assert len(quick) == 3
    renamed = [path.rename(path.with_name(f"z{path.name}")) for path in files[:2]]
    two = model("two", renamed)
    assert not any(isinstance(value, Preparation) for value in kept)
    assert two == model("two anew", renamed, keeps=False) and not kept
    for path, old in zip(renamed, files, strict=False):
        path.rename(old)
    assert four == model("four anew", files, keeps=False) and not kept
    shutil.rmtree(cache_folder(tmp_path / "four"))
    assert four == model("four again", files) and kept
