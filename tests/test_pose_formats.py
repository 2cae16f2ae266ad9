"""Poses in other tools' formats: as their definitions say, read back, and refused by one line."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanweld.app.options import PoseFormat
from scanweld.errors import InputError, ReadError, ScanweldError, WriteError
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.io import PoseSet, read_poses, write_poses
from scanweld.io.pose_formats import FORMATS, Frame, PosedScan, match_poses, read_any_poses
from tests.data import require_data
from tests.libraries import open3d

CAMERA = Camera(model=CameraModel.PINHOLE, width=40, height=30, fx=50, fy=60, cx=19.5, cy=14.25)
QUARTER = Pose(
    rotation=np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    translation=np.array([1.0, 2.0, 3.0]),
)
"""A quarter turn that takes x to y, so that mixing up R and its transpose shows."""
HALF = math.sqrt(0.5)


def scan_at(
    name: str, pose: Pose, sensor: Pose | None = None, camera: Camera | None = CAMERA
) -> PosedScan:
    return PosedScan(
        name=name,
        world_from_scan=pose,
        file=f"../scans/{name}.ply",
        camera=camera,
        scan_from_sensor=sensor or Pose.identity(),
    )


def write(folder: Path, form: str, scans: Sequence[PosedScan]) -> Path:
    """Write scans; what is to be named when they are read again."""
    contents = FORMATS[form].write(scans)
    for name, text in contents.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder / ("cloudcompare" if form == "cloudcompare" else next(iter(contents)))


def read(path: Path, names: Sequence[str]) -> dict[str, Pose]:
    return match_poses(path, read_any_poses(path), names)


def random_pose(seed: int, size: float) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose(rotation=random_rotation(rng), translation=size * rng.normal(size=3))


# Known files, by hand from the formats' definitions.

ROWS = "0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n"
COLUMNS = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]
KNOWN = {
    "a.conf": f"camera 0 0 0 0 0 0 1\nbmesh one.ply 1 2 3 0 0 {-HALF} {HALF}\n",
    "a.mlp": (
        '<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n <MeshGroup>\n  <MLMesh label="x" '
        f'filename="dir/one.ply">\n   <MLMatrix44>\n{ROWS}</MLMatrix44>\n  </MLMesh>\n'
        " </MeshGroup>\n <RasterGroup/>\n</MeshLabProject>\n"
    ),
    "a.aln": f"1\none.ply\n#\n{ROWS}0\n",
    "tum.txt": f"# a comment\n1305031102.1758 1 2 3 0 0 {HALF} {HALF}\n",
    "images.txt": f"# a comment\n7 {HALF} 0 0 {-HALF} -2 1 -3 1 dir/one.jpg\n2362.3 248.4 58396\n",
    "graph.json": json.dumps({"class_name": "PoseGraph", "nodes": [{"pose": COLUMNS}]}),
    "cc/one.txt": ROWS.replace("\n", "\r\n"),
    # Seen by a camera in OpenGL axes: y and z of ours turned round.
    "transforms.json": """{"frames": [{"file_path": "./images/one.png",
        "transform_matrix": [[0, 1, 0, 1], [1, 0, 0, 2], [0, 0, -1, 3], [0, 0, 0, 1]]}]}""",
    "flat.json": json.dumps({"one": [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}),
}


@pytest.mark.parametrize("name", KNOWN)
def test_files_by_hand_are_read_as_their_definition_says(tmp_path: Path, name: str):
    """Whatever their suffix, where the content tells the format."""
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    for encoding in ("utf-16", "utf-8-sig", "utf-8"):
        path.write_bytes(KNOWN[name].encode(encoding))
        poses = read(path.parent if path.parent.name == "cc" else path, ["one"])
        assert np.abs(poses["one"].matrix() - QUARTER.matrix()).max() < 1e-12
    if not name.startswith("cc/"):
        other = path.rename(tmp_path / ("poses.js" if "json" in name else "poses.dat"))
        assert np.allclose(read(other, ["one"])["one"].matrix(), QUARTER.matrix())


def test_what_is_written_is_what_the_definitions_say():
    """Pixel centres are at one half in colmap and nerfstudio."""
    scan = scan_at("one", QUARTER)
    texts = {key: text for form in FORMATS.values() for key, text in form.write([scan]).items()}
    words = texts["poses.conf"].splitlines()[1].split()
    assert words[:2] == ["bmesh", "../scans/one.ply"]
    assert np.allclose([float(w) for w in words[2:]], [1, 2, 3, 0, 0, -HALF, HALF])
    exact = "0.0 -1.0 0.0 1.0\n1.0 0.0 0.0 2.0\n0.0 0.0 1.0 3.0\n0.0 0.0 0.0 1.0\n"
    assert texts["cloudcompare/one.txt"] == exact
    assert texts["poses.aln"] == f"1\n../scans/one.ply\n#\n{exact}0\n"
    assert f"<MLMatrix44>\n{exact}</MLMatrix44>" in texts["poses.mlp"]
    assert json.loads(texts["posegraph.json"])["nodes"][0]["pose"] == COLUMNS
    row = next(line for line in texts["poses.tum.txt"].splitlines() if line[0] != "#")
    assert np.allclose([float(w) for w in row.split()], [0, 1, 2, 3, 0, 0, HALF, HALF])
    line = texts["colmap/cameras.txt"].splitlines()[1]
    assert line == "1 PINHOLE 40 30 50.0 60.0 20.0 14.75"
    frame = json.loads(texts["transforms.json"])["frames"][0]
    told = [frame[key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")]
    assert told == [50, 60, 20, 14.75, 40, 30]


@given(point=st.tuples(*[st.floats(-1, 1)] * 2, st.floats(1, 9)), seed=st.integers(0, 10**6))
def test_a_point_seen_lands_in_the_same_pixel_in_colmap_and_nerfstudio(
    point: tuple[float, float, float], seed: int
):
    """The whole chain, written out here once more: pose, axes, intrinsics."""
    scan = scan_at("one", random_pose(seed, 5.0), random_pose(seed + 1, 5.0))
    seen = np.array(point)
    world = scan.world_from_sensor().apply(seen)
    pixel = CAMERA.project(seen[None])[0][0] + 0.5
    lines = FORMATS["colmap"].write([scan])
    _, w, x, y, z, *shift = (
        float(word) for word in lines["colmap/images.txt"].split("\n")[2].split()[:8]
    )
    q = np.array([x, y, z])
    turned = world + 2 * np.cross(q, np.cross(q, world) + w * world) + np.array(shift)
    fx, fy, cx, cy = (float(word) for word in lines["colmap/cameras.txt"].split()[-4:])
    assert np.allclose([fx * turned[0] / turned[2] + cx, fy * turned[1] / turned[2] + cy], pixel)
    frame = json.loads(FORMATS["nerfstudio"].write([scan])["transforms.json"])["frames"][0]
    x, y, z, _ = np.linalg.inv(frame["transform_matrix"]) @ [*world, 1.0]
    assert z < 0
    u, v = frame["fl_x"] * x / -z + frame["cx"], frame["fl_y"] * -y / -z + frame["cy"]
    assert np.allclose([u, v], pixel)


NAMES = st.text(
    st.characters(
        categories=["L", "N", "P", "S"], include_characters=" ", exclude_characters="/\\"
    ),
    min_size=1,
    max_size=12,
).filter(lambda name: name.strip() == name and name not in (".", ".."))


@pytest.mark.parametrize("form", FORMATS)
@settings(max_examples=30)
@given(
    names=st.lists(NAMES, min_size=1, max_size=4, unique=True),
    seed=st.integers(0, 10**6),
    size=st.sampled_from([1e-6, 1.0, 1e6]),
)
def test_any_poses_under_odd_names_come_back_or_are_refused(
    form: str, names: list[str], seed: int, size: float, tmp_path_factory: pytest.TempPathFactory
):
    scans = [
        scan_at(name, random_pose(seed + k, size), random_pose(seed + 100 + k, size))
        for k, name in enumerate(names)
    ]
    folder = tmp_path_factory.mktemp("poses")
    try:
        path = write(folder, form, scans)
    except WriteError as error:
        assert "\n" not in str(error) and "rename" in str(error)
        assert form in ("conf", "colmap") and any(" " in name for name in names)
        return
    found = read_any_poses(path)
    assert found.frame is FORMATS[form].frame
    poses = match_poses(path, found, names)
    assert set(poses) == set(names)
    for scan in scans:
        is_scan = found.frame is Frame.SCAN
        want = scan.world_from_scan if is_scan else scan.world_from_sensor()
        assert np.abs(poses[scan.name].rotation - want.rotation).max() < 1e-12
        assert np.abs(poses[scan.name].translation - want.translation).max() < 1e-12 * size


@pytest.mark.parametrize("form", FORMATS)
def test_names_that_no_text_holds_are_refused_or_escaped(form: str, tmp_path: Path):
    for name in ("two\nlines", "tab\tbed", "bad\udcff", "nul\0", "sep\u2028"):
        try:
            path = write(tmp_path, form, [scan_at(name, QUARTER)])
        except WriteError as error:
            assert "\n" not in str(error)
        else:
            assert form in ("open3d", "nerfstudio")  # JSON escapes what it cannot hold
            assert set(read(path, [name])) == {name}
    for name in ("../out", "/etc/x", "..", "a/../../b") if form == "cloudcompare" else ():
        with pytest.raises(WriteError, match="cannot be the name of a file"):
            FORMATS[form].write([scan_at(name, QUARTER)])


@pytest.mark.parametrize(
    "form", [key for key, form in FORMATS.items() if form.frame is Frame.SENSOR]
)
@pytest.mark.parametrize("model", [None, CameraModel.ORTHOGRAPHIC, CameraModel.SPHERICAL])
def test_sensors_that_are_no_pinholes_are_refused(form: str, model: CameraModel | None):
    camera = None
    if model is not None:
        camera = Camera(model=model, width=9, height=9, fx=1, fy=1, cx=4, cy=4)
    with pytest.raises(InputError, match=r"^odd: its sensor is .*pinhole") as caught:
        FORMATS[form].write([scan_at("odd", QUARTER, camera=camera)])
    assert "\n" not in str(caught.value)


def test_real_conf_gives_the_published_poses():
    folder = require_data("stanford-bunny/bun.conf").parent
    truth = read_poses(folder / "poses_conf.json").poses
    poses = read(folder / "bun.conf", list(truth))
    assert set(poses) == set(truth)
    for name, pose in truth.items():
        assert np.abs(poses[name].matrix() - pose.matrix()).max() < 1e-5


def test_open3d_reads_and_writes_the_same_pose_graph(tmp_path: Path):
    o3d = open3d()
    scans = [scan_at(f"s{k}", random_pose(k, 3.0)) for k in range(3)]
    path = write(tmp_path, "open3d", scans)
    graph = o3d.io.read_pose_graph(str(path))
    assert len(graph.nodes) == 3
    for node, scan in zip(graph.nodes, scans, strict=True):
        assert np.allclose(node.pose, scan.world_from_scan.matrix(), atol=1e-14)
    again = tmp_path / "again.json"
    o3d.io.write_pose_graph(str(again), graph)
    poses = read(again, ["s2", "s0", "s1"])  # without names: natural order
    for scan in scans:
        assert np.allclose(poses[scan.name].matrix(), scan.world_from_scan.matrix(), atol=1e-14)


# Which pose is whose.


def entries(tmp_path: Path, labels: Sequence[str]) -> Path:
    path = tmp_path / "poses.aln"
    path.write_text(f"{len(labels)}\n" + "".join(f"{label}\n#\n{ROWS}" for label in labels))
    return path


@pytest.mark.parametrize(
    ("label", "names", "whose"),
    [
        ("../raw/a.ply", ["a", "b"], "a"),
        ("C:\\raw\\a.ply", ["a", "b"], "a"),
        ("raw/a.ply.gz", ["a", "b"], "a"),
        ("a.v1.ply", ["a", "a.v1"], "a.v1"),
        ("a.v1.ply", ["a"], None),
        ("left/a.ply", ["left/a", "right/a"], "left/a"),
        ("a.ply", ["left/a", "right/a"], None),
        ("left/a.ply", ["right/a"], None),
        ("aa.ply", ["a"], None),
    ],
)
def test_paths_belong_to_the_one_scan_they_end_in(
    tmp_path: Path, label: str, names: list[str], whose: str | None
):
    path = entries(tmp_path, [label])
    if whose is not None:
        assert list(read(path, names)) == [whose]
        return
    with pytest.raises(ReadError, match="none of its 1 poses"):
        read(path, names)


def test_without_names_the_counts_must_agree_and_natural_order_holds(tmp_path: Path):
    path = tmp_path / "tum.txt"
    path.write_text("".join(f"{k} {k} 0 0 0 0 0 1\n" for k in range(3)))
    poses = read(path, ["s10", "s2", "s1"])
    assert [poses[name].translation[0] for name in ("s1", "s2", "s10")] == [0, 1, 2]
    with pytest.raises(ReadError, match="3 poses for 2 scans"):
        read(path, ["a", "b"])
    with pytest.raises(ReadError, match="two poses for scan a"):
        read(entries(tmp_path, ["x/a.ply", "y/a.ply"]), ["a", "b"])
    assert list(read(entries(tmp_path, ["a.ply", "z.ply"]), ["a", "b"])) == ["a"]


def test_own_poses_are_those_of_the_largest_component(tmp_path: Path):
    poses = {name: random_pose(k, 1.0) for k, name in enumerate("abc")}
    path = tmp_path / "poses.json"
    write_poses(path, PoseSet(poses=poses, components=(("b", "c"), ("a",))))
    for named in (path, tmp_path):
        assert set(read(named, ["a", "b", "c"])) == {"b", "c"}


# Bad input.

BROKEN = {
    "prose.txt": "once upon a time\n",
    "empty.txt": "",
    "empty.json": "{}",
    "cut.json": '{"frames": [',
    "list.json": "[1, 2]",
    "other.json": '{"class_name": "PoseGraph", "nodes": [{"pose": [1, 2]}]}',
    "frames.json": '{"frames": [{"file_path": "a"}]}',
    "text.json": '{"frames": [{"file_path": "a", "transform_matrix": ["x"]}]}',
    "cut.mlp": "<MeshLabProject><MeshGroup>",
    "short.mlp": (
        '<MeshLabProject><MeshGroup><MLMesh filename="a.ply"><MLMatrix44>1 2 3</MLMatrix44>'
        "</MLMesh></MeshGroup></MeshLabProject>"
    ),
    "none.mlp": "<MeshLabProject><MeshGroup/></MeshLabProject>",
    "cut.aln": "2\na.ply\n#\n" + ROWS,
    "long.aln": "9" * 5000 + "\na.ply\n#\n" + ROWS,
    "huge.aln": "1\na.ply\n#\n" + ROWS.replace("-1", "-1e300"),
    "scaled.aln": "1\na.ply\n#\n2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n0\n",
    "mirror.aln": "1\na.ply\n#\n-1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n0\n",
    "words.conf": "bmesh a.ply 1 2 3 0 0 1\n",
    "letters.conf": "bmesh a.ply 1 2 3 0 0 x 1\n",
    "zero.conf": "bmesh a.ply 1 2 3 0 0 0 0\n",
    "nan.conf": "bmesh a.ply nan 2 3 0 0 0 1\n",
    "long.txt": "0 1 2 3 0 0 0 2\n",
    "one.txt": ROWS,
    "cameras.txt": "1 PINHOLE 10 10 5 5 5 5\n",
    "images.txt": "1 1 0 0 0 x 0 0 1 a.png\n\n",
}


@pytest.mark.parametrize("name", [*BROKEN, "missing.json", "."])
def test_broken_files_are_one_line_that_names_them(tmp_path: Path, name: str):
    path = tmp_path / name
    if name in BROKEN:
        path.write_text(BROKEN[name])
    with pytest.raises(ScanweldError) as caught:
        read_any_poses(path)
    told = str(caught.value)
    assert told.startswith(str(path)) and "\n" not in told
    if name == "prose.txt":
        assert "unknown format of poses" in told
        known = ("conf", "mlp", "aln", "TUM", "COLMAP", "Open3D", "CloudCompare", "nerfstudio")
        assert all(word in told for word in known)


def test_the_command_offers_every_format():
    assert [form.value for form in PoseFormat] == list(FORMATS)
