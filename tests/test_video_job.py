"""``scanweld run --video``: keyframes as files, the same at any worker count; what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scanweld.app.video_job import take_video
from scanweld.io.depth.capture import DepthImages
from scanweld.work.progress import Event, StageAdvanced, silent
from tests.command_line import COARSE, error_line, scanweld
from tests.videos import tracked, video, way_around, written


def test_keyframes_are_the_same_bytes_at_any_worker_count(tmp_path: Path):
    made = video(way_around(10, 22.0))
    frames, events = DepthImages(inputs=[written(made, tmp_path)]).collect(), list[Event]()
    for workers in (1, 3):
        (tmp_path / f"{workers}").mkdir()
        take_video(frames, tmp_path / f"{workers}", workers, events.append)
    one, three = ({p.name: p.read_bytes() for p in (tmp_path / n).rglob("*.*")} for n in "13")
    assert one == three and {"video.json", "intrinsics.json", "frame-000.tif"} <= one.keys()
    told = [(e.done, e.total) for e in events if isinstance(e, StageAdvanced)]
    assert told == 2 * [(k, 10) for k in range(1, 11)]

    found, _ = tracked(made.frames)
    assert [f"{each.name}.tif" for each in found] == sorted(n for n in one if n.endswith(".tif"))
    (scan,) = (f.read() for f in DepthImages(inputs=[tmp_path / "1" / "keyframes"]).collect()[:1])
    assert scan.camera == made.camera  # the folder can be read by itself
    assert len(scan.points) == pytest.approx(np.isfinite(found[0].depth).sum(), rel=0.01)


@pytest.mark.slow
def test_a_run_takes_keyframes_for_scans_and_tells_of_the_track(tmp_path: Path):
    there, away = way_around(8, 22.0), way_around(6, 16.0, begin_deg=150.0)
    made = video([*there, *away])
    frames, out, again = written(made, tmp_path), tmp_path / "model", tmp_path / "again"
    Image.new("L", (160, 120)).save(frames / "frame-003.png")  # a picture, no depths
    (tmp_path / "coarse.toml").write_text(COARSE)
    how = ("--video", "--object", "all", "-q", "--config", tmp_path / "coarse.toml")
    for folder, workers in ((out, "1"), (again, "2")):
        assert scanweld("run", frames, "-o", folder, "--workers", workers, *how) in (0, 3)
    report, track = (json.loads((out / f"{n}.json").read_text()) for n in ("report", "video"))
    counts = report["stages"]["video"]
    assert counts["frames"] == 14 and counts["pieces"] == 2
    assert counts["keyframes"] == len(track["keyframes"]) == len(report["scans"]) - 1
    assert report["scans"]["frame-003"]["verdict"] == "unplaced"
    (broken,) = [each for each in report["reasons"] if each.startswith("the track")]
    assert broken.startswith("the track of the camera breaks at frame-008: ")
    assert any(fact["fact"] == "start poses" for fact in report["knowledge"])
    for name, keyframe in track["keyframes"].items():
        scan = report["scans"][name]
        assert scan["file"] == f"keyframes/{name}.tif"
        assert any(f"the mean of {keyframe['frames']} frames" in each for each in scan["notes"])
    page = (out / "report.html").read_bytes()
    assert broken in page.decode()
    assert scanweld("report", out) == 0 and (out / "report.html").read_bytes() == page
    for name in ("poses.json", "graph.json", "video.json", "frames.json"):
        assert (out / name).read_bytes() == (again / name).read_bytes()


def _refusal(frames: Path, capsys: pytest.CaptureFixture[str], *more: str | Path) -> str:
    out = frames.parent / "refused"
    assert scanweld("run", frames, "-o", out, "--video", "-q", "--no-cache", *more) == 1
    assert not out.exists() and not list(frames.parent.glob(".refused*"))
    return error_line(capsys)


def test_what_is_no_video_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    made = video(way_around(3, 2.0))
    frames = written(made, tmp_path / "still")
    assert "hardly moved: all 3 frames show one view" in _refusal(frames, capsys)

    (frames / "frame-001.png").unlink()
    (frames / "frame-002.png").unlink()
    assert "one frame is no video; name all" in _refusal(frames, capsys)

    scans = tmp_path / "scans"
    scans.mkdir()
    (scans / "a.ply").write_text("ply\n")
    assert "holds no depth images" in _refusal(scans, capsys)
    line = _refusal(scans / "a.ply", capsys)
    assert "--video takes depth images" in line and "a.ply: no depth image" in line

    apart = written(
        video([way_around(1, 0.0, turn)[0] for turn in (0, 90, 180, 270)]), tmp_path / "b"
    )
    assert "leave --video out if they are no video" in _refusal(apart, capsys)


def test_frames_of_nothing_are_left_out_wherever_they_are(tmp_path: Path):
    frames = DepthImages(inputs=[written(video(way_around(10, 22.0)), tmp_path)]).collect()
    for frame in frames[::2]:  # those by which noise would be found
        Image.fromarray(np.zeros((120, 160), np.uint16)).save(frame.path)
    taken = take_video(frames, tmp_path, 1, silent)
    assert taken.unreadable.keys() == {frame.name for frame in frames[::2]}
    assert taken.stages["video"].counts["averaged"] + len(taken.files) == 5


def test_a_size_that_changes_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    frames = written(video(way_around(4, 3.0)), tmp_path)
    told = json.loads((tmp_path / "intrinsics.json").read_text())
    (tmp_path / "intrinsics.json").write_text(
        json.dumps({key: told[key] for key in told if key not in ("width", "height")})
    )
    with Image.open(frames / "frame-002.png") as image:
        image.crop((0, 0, 150, 110)).save(frames / "frame-002.png")
    line = _refusal(frames, capsys)
    assert "150 x 110 pixels, other frames 160 x 120 pixels" in line and "one camera" in line
