"""The examples do what they say: what a run of each prints."""

import re
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scanweld.app import job
from scanweld.evaluation.creature import creature
from scanweld.geometry.pose import Pose
from scanweld.io import read_poses
from tests.results import a_result

EXAMPLES = Path(__file__).parents[1] / "examples"


SLOW = pytest.mark.slow
SAYS = {
    "00_run_rendered.py": (r"\Agood: 6 of 6 scans are placed", r"ply: ([5-9]\d{3}|\d{5,}) faces"),
    "01_one_pair.py": (r"\Agood: ", r"the best pose is 0\.[0-4]\d* deg off"),
    "02_own_format.py": ("viewpoint  given", "viewpoint  estimated"),
    "03_view_graph.py": (
        r"(?s)(^scan_\d\d = scan_\d\d  good.*){4}",
        r"(?s)\A(?!.*^component in .*^component in ).*^component in the frame of ",
    ),
    "04_correct_and_resume.py": (
        r"\Afirst good: 6 scans are placed",
        r"\b(1[5-9]|[2-9]\d) pieces of work were found again",
        r"apart scan_\d\d scan_\d\d: contradicted",
    ),
    "05_fuse_known_poses.py": (r"\b([5-9]\d{3}|\d{5,}) faces",),
    "06_evaluate.py": ("of 5 scans: 3 right, 1 wrong, 1 unplaced",),
    "07_depth_frames.py": (
        r"\A\w+: 4 of 4 frames are placed",
        r"(?s)(^00\d: cut: table and background.*){4}",
        r"(?s)(^00\d by its mask: \d{4,5} points.*){4}",
    ),
    "08_capture.py": (r"^001: with colours", r"Open3D layout, with a pose \(trajectory\.log\)"),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=SLOW if name[:2] in ("00", "03", "04", "07") else ())
        for name in SAYS
    ],
)
def test_examples_do_what_they_say(name: str, capsys: pytest.CaptureFixture[str]):
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    text = capsys.readouterr().out
    for pattern in SAYS[name]:
        assert re.search(pattern, text, re.MULTILINE), text


@SLOW
@pytest.mark.parametrize(("off_deg", "code"), [(0.0, 0), (10.0, 3)])
def test_demo_succeeds_only_if_all_is_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, off_deg: float, code: int
):
    def run(*_: Any, **settings: Any) -> object:
        poses = dict(read_poses(tmp_path / "demo/scans/truth/poses.json").poses)
        poses["scan_03"] = poses["scan_03"] @ Pose.exp([off_deg / 57.3, 0, 0, 0, 0, 0])
        return replace(a_result(list(poses)), poses=poses)

    monkeypatch.setattr(job.pipeline, "run", run)
    demo = runpy.run_path(str(EXAMPLES / "demo.py"))["demo"]
    monkeypatch.setitem(demo.__globals__, "creature", lambda: creature(voxels=50))
    for _ in range(2 if code == 0 else 1):  # a second demo in the same folder replaces the first
        assert demo(tmp_path / "demo") == code
