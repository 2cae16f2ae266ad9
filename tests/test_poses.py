"""Files of poses: both formats read, one written, the same bytes each time."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet, read_poses, write_poses
from tests.data import require_data
from tests.scenes import random_motion

IDENTITY = np.eye(4).tolist()
SCALED = (np.eye(4) * [2, 2, 2, 1]).tolist()
MIRRORED = (np.eye(4) * [1, 1, -1, 1]).tolist()


def assert_same(a: PoseSet, b: PoseSet):
    assert a.components == b.components
    assert a.unplaced == b.unplaced
    assert set(a.poses) == set(b.poses)
    for name, pose in a.poses.items():
        np.testing.assert_array_equal(pose.matrix(), b.poses[name].matrix())


@settings(max_examples=30)
@given(
    names=st.lists(st.text(st.characters(codec="utf-8"), max_size=8), unique=True, max_size=8),
    cuts=st.tuples(st.integers(0, 8), st.integers(0, 8)),
    seed=st.integers(0, 2**32),
)
def test_written_poses_are_read_back_exactly(
    names: list[str], cuts: tuple[int, int], seed: int, tmp_path: Path
):
    first, second = sorted(cuts)
    parts = (tuple(names[:first]), tuple(names[first:second]))
    rng = np.random.default_rng(seed)
    poses = PoseSet(
        poses={name: random_motion(rng, 100.0) for part in parts for name in part},
        components=tuple(part for part in parts if part),
        unplaced={name: f"why ä \n {name}" for name in names[second:]},
    )
    path = tmp_path / "poses.json"
    write_poses(path, poses)
    written = path.read_bytes()
    again = read_poses(path)
    assert_same(poses, again)
    write_poses(path, again)
    assert path.read_bytes() == written


def test_what_is_written_has_the_promised_form_whatever_the_order(tmp_path: Path):
    rng, path = np.random.default_rng(5), tmp_path / "poses.json"
    poses = {name: random_motion(rng, 100.0) for name in ("scan10", "scan2", "büste")}
    written = set()
    for order in (list(poses), sorted(poses)):
        made = PoseSet(
            poses={name: poses[name] for name in order},
            components=(("scan2", "scan10"), ("büste",)),
            unplaced={"b": "too small", "a": "empty"},
        )
        write_poses(path, made)
        written.add(path.read_text(encoding="utf-8"))
    (text,) = written
    content = json.loads(text)
    assert list(content) == ["format", "convention", "scans", "components", "unplaced"]
    assert content["format"] == 1
    assert list(content["scans"]) == ["büste", "scan2", "scan10"] and "büste" in text
    assert content["components"] == [["scan2", "scan10"], ["büste"]]
    assert list(content["unplaced"].items()) == [("a", "empty"), ("b", "too small")]
    row = json.dumps(content["scans"]["scan2"][0])
    assert any(line.strip().rstrip(",") == row for line in text.splitlines())


def test_without_components_all_scans_are_one(tmp_path: Path):
    path = tmp_path / "flat.json"
    path.write_text("\ufeff" + json.dumps({"b": IDENTITY, "a": IDENTITY}), encoding="utf-8")
    poses = read_poses(path)
    assert poses.components == (("b", "a"),)
    assert poses.unplaced == {}
    path.write_text(json.dumps({"format": 1, "scans": {"a": IDENTITY}}))
    assert read_poses(path).components == (("a",),)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not valid JSON"),
        ("{", "not valid JSON"),
        ("[1]", "not a JSON object"),
        ('{"a": 3}', "'a' is not a 4x4 matrix"),
        ('{"a": [[1, 0], [0, 1]]}', "'a' is not a 4x4 matrix"),
        (json.dumps({"a": [["1", 0, 0, 0], *IDENTITY[1:]]}), "'a' is not a 4x4 matrix"),
        (json.dumps({"a": [[True, 0, 0, 0], *IDENTITY[1:]]}), "'a' is not a 4x4 matrix"),
        (json.dumps({"a": [[1, 0, 0, float("nan")], *IDENTITY[1:]]}), "NaN is no number"),
        (json.dumps({"a": IDENTITY}).replace("[1.0, 0.0, 0.0, 0.0]", "[1, 0, 0, 1e999]"), "'a': "),
        (json.dumps({"a": SCALED}), "'a': the 4x4 matrix is not a rigid motion"),
        (json.dumps({"a": MIRRORED}), "'a': "),
        (json.dumps({"a": np.ones((4, 4)).tolist()}), "'a': .*last row"),
        ('{"a": 1, "a": 2}', "'a' comes twice"),
        ('{"format": 2, "scans": {}}', "format 2 is unknown"),
        ('{"format": 1}', "must be JSON objects"),
        ('{"format": 1, "scans": {}, "components": [["a"]]}', "every placed scan"),
        ('{"format": 1, "scans": {}, "components": ["a"]}', "list of lists of names"),
        (
            json.dumps({"format": 1, "scans": {"a": IDENTITY}, "unplaced": {"a": "?"}}),
            "'a' has a pose and is named as unplaced",
        ),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, text: str, says: str):
    path = tmp_path / "poses.json"
    with pytest.raises(ReadError, match=re.escape(str(path))):
        read_poses(path)
    path.write_text(text)
    with pytest.raises(ReadError, match=says) as caught:
        read_poses(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("parts", ["", "a", "ab b", "aab", "abc"])
def test_components_name_every_placed_scan_once(parts: str):
    poses = {"a": Pose.identity(), "b": Pose.identity()}
    with pytest.raises(ValueError, match="every placed scan"):
        PoseSet(poses=poses, components=tuple(map(tuple, parts.split())))


@pytest.mark.parametrize("folder", ["stanford-bunny", "stanford-dragon"])
@pytest.mark.parametrize("name", ["poses.json", "poses_conf.json"])
def test_reference_poses_keep_their_digits(folder: str, name: str):
    path = require_data(f"{folder}/{name}")
    content = json.loads(path.read_text(encoding="utf-8"))
    poses = read_poses(path).poses
    assert poses.keys() == content.keys()
    for key, rows in content.items():
        np.testing.assert_allclose(poses[key].matrix(), rows, atol=1e-9)
