"""report.html: whole, by itself, the same every time, and true to the files beside it."""

import base64
import dataclasses
import json
import re
import zlib
from pathlib import Path

import numpy as np
import pytest

from scanweld.app import job
from scanweld.app.html_report import write_html_report
from scanweld.app.html_report.buffers import box_around, packed, quantised, steps
from scanweld.app.html_report.definitions import DEFINITIONS
from scanweld.app.html_report.histogram import histogram
from scanweld.app.html_report.orientation import as_seen_from
from scanweld.app.html_report.scene import Scene, payload
from scanweld.app.html_report.simplify import cluster_faces, cluster_means, cluster_vertices
from scanweld.app.html_report.sources import Sources
from scanweld.app.html_report.surface_check import check_surface, open_borders, thin_share
from scanweld.app.html_report.view_graph import pair_level
from scanweld.app.model_files import PairEntry
from scanweld.app.model_folder import open_model
from scanweld.app.outputs import Place, write_outputs
from scanweld.config import Config, FusionConfig, PrepareConfig
from scanweld.errors import ReadError
from scanweld.evaluation.primitives import sphere
from scanweld.evidence.slippage import Slide
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.pairs.result import PairKind
from scanweld.preparation import prepare
from scanweld.preparation.support import find_support
from scanweld.reconstruction import FactReport, FactVerdict, ScanVerdict
from tests.command_line import scanweld as command
from tests.html_pages import Page
from tests.model_folders import Made, crowd, good_result, small_scene, whole_folder, written
from tests.results import a_mesh, a_pair, a_result, no_pair
from tests.scenes import write_scans
from tests.test_support import on_table, seen

pytestmark = pytest.mark.slow


def page_of(folder: Path) -> Page:
    return Page((folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    made = whole_folder(tmp_path_factory.mktemp("whole") / "model")
    write_html_report(made.folder, made.scans)
    return made


@pytest.fixture(scope="module")
def page(made: Made) -> Page:
    return page_of(made.folder)


def test_page_is_well_formed_and_needs_nothing_else(made: Made, page: Page):
    text = (made.folder / "report.html").read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>")
    assert not re.search(r"(?:https?:)?//[a-z]+\.[a-z]", text)
    for _, found in page.elements:
        for key in ("src", "href"):
            assert found.get(key, "#").startswith(("#", "data:")), found
    ids = [found["id"] for _, found in page.elements if "id" in found]
    assert len(ids) == len(set(ids))
    for _, found in page.elements:
        if found.get("href", "").startswith("#"):
            assert found["href"][1:] in ids
    assert "@import" not in text and "url(" not in text
    pictures = [found for tag, found in page.elements if tag == "img"]
    assert len(pictures) == 3 + 2 + 3 + 4, "four of them show the scans in colour"
    assert all(found["alt"] for found in pictures)
    drawings = [found for tag, found in page.elements if tag in ("svg", "canvas")]
    assert len(drawings) >= 4 and all(found["aria-label"] for found in drawings)


def test_numbers_are_those_of_the_files(made: Made, page: Page):
    report = json.loads((made.folder / "report.json").read_text(encoding="utf-8"))
    graph = json.loads((made.folder / "graph.json").read_text(encoding="utf-8"))
    for name, scan in report["scans"].items():
        wanted = {repr(scan["overlap"]), repr(scan["rms"]), str(scan["num_points"])}
        assert wanted <= page.values(), name
    stages = report["stages"]["pairs"]
    assert {repr(stages["seconds"]), repr(stages["peak_mb"])} <= page.values()
    shown = json.loads(page.text["pairs-data"])
    assert len(shown) == len(graph["pairs"])
    for pair, found in zip(graph["pairs"], shown, strict=True):
        assert found.items() <= {"confidence": None, **pair}.items()
    assert f"All {len(report['scans'])} scans are placed." in page.words
    before = (made.folder / "report.html").read_bytes()
    write_html_report(made.folder, dict(reversed(made.scans.items())))
    assert (made.folder / "report.html").read_bytes() == before


def test_the_page_is_the_same_from_what_is_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scene = small_scene()
    made = seen(on_table(), 0.0)
    scans = {scan.name: scan for scan in (*scene.scans, made)}
    prepared = {
        name: prepare(scan, PrepareConfig(), without_support=name == made.name)
        for name, scan in scans.items()
    }
    result = good_result(scene)
    on_support = dataclasses.replace(result.scans["scan_01"], is_without_support=True)
    result = dataclasses.replace(
        result,
        poses={**result.poses, made.name: Pose.identity()},
        components=((*result.components[0], made.name),),
        scans={**result.scans, made.name: dataclasses.replace(on_support, content_hash=None)},
        prepared=prepared,
    )
    folder = written(tmp_path, result)
    page = write_html_report(folder, scans).read_bytes()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("it is in memory")

    monkeypatch.setattr("scanweld.app.html_report.sources.prepare", refuse)
    monkeypatch.setattr("scanweld.app.model_folder.read_mesh", refuse)
    assert write_html_report(folder, scans, result).read_bytes() == page


def test_every_number_is_defined_in_the_words_of_the_documentation(page: Page):
    asked = {found["data-def"] for _, found in page.elements if "data-def" in found}
    assert asked <= set(DEFINITIONS)
    told = (Path(__file__).parents[1] / "docs/report.md").read_text(encoding="utf-8")
    told = " ".join(told.replace("`", "").split())
    for key, definition in DEFINITIONS.items():
        assert definition.meaning in told, key


def test_true_scans_lie_on_the_model(made: Made, page: Page):
    scene = small_scene()
    points = {
        scan.name: scene.world_from_scan[scan.name].apply(scan.points) for scan in scene.scans
    }
    check = check_surface(scene.mesh, points)
    assert check.off_model == 0
    # Vertices stand for their surroundings, so on a curved surface the residual is not quite 0.
    found = histogram(check.all_distances())
    assert found is not None and found.median < 2e-3 * np.ptp(scene.mesh.vertices)
    assert repr(found.median) in page.values()
    seen = check.support[check.support > 0]
    assert check.support.max() <= 4 and 1 <= np.median(seen) <= 2  # of four views from around


@pytest.mark.parametrize("left_out", [True, False])
def test_a_table_that_was_left_out_is_not_measured(tmp_path: Path, left_out: bool):
    scan = seen(on_table(), 0.0)
    result = a_result([scan.name])
    told = dataclasses.replace(result.scans[scan.name], is_without_support=left_out)
    folder = written(tmp_path, dataclasses.replace(result, scans={scan.name: told}))
    sources = Sources(open_model(folder), {scan.name: scan}, PrepareConfig())
    points = sources.points_of_model()[scan.name]
    assert (len(points) == len(scan.points)) is not left_out
    spacing = sources.prepared(scan.name).resolution
    assert (find_support(points, spacing) is None) is left_out
    assert sources.prepared(scan.name).is_without_support is left_out


@pytest.mark.parametrize("with_doubtful", [False, True])
def test_residuals_are_of_the_scans_that_the_model_was_made_of(tmp_path: Path, with_doubtful: bool):
    scene = small_scene()
    result = good_result(scene)
    config = Config(fusion=FusionConfig(with_doubtful=with_doubtful))
    doubtful = dataclasses.replace(result.scans["scan_02"], verdict=ScanVerdict.DOUBTFUL)
    scans = {**result.scans, "scan_02": doubtful}
    folder = written(tmp_path, dataclasses.replace(result, scans=scans, config=config))
    write_html_report(folder, {scan.name: scan for scan in scene.scans})
    page = page_of(folder)
    shown = [found for _, found in page.elements if "data-scan" in found]
    assert len(shown) == (4 if with_doubtful else 3)
    assert any(f"The fused surface of {len(shown)} scans" in words for words in page.words)


def test_residual_support_and_holes_of_a_ball():
    ball = sphere(50.0)
    outside = ball.vertices * 1.01
    upper = outside[outside[:, 2] > 0]
    check = check_surface(ball, {"all": outside, "upper": upper})
    assert np.allclose(check.distances["all"], 0.5, atol=1e-3)
    top, bottom = ball.vertices[:, 2] > 5, ball.vertices[:, 2] < -5
    assert set(check.support[top]) == {2} and set(check.support[bottom]) == {1}
    assert thin_share(ball, check.support) == pytest.approx(0.5, abs=0.03)
    # Where the model knows, nothing is measured anew: its vertices may be closer than points are.
    told = dataclasses.replace(ball, support=np.full(len(ball.vertices), 3))
    assert set(check_surface(told, check.points).support) == {3}
    assert np.allclose(check.residual, 0.5, atol=1e-3)
    far = check_surface(ball, {"far": ball.vertices * 3})
    assert far.off_model == 1 and not len(far.all_distances()) and np.isnan(far.residual).all()
    kept = (ball.vertices[ball.faces][..., 2] < 40).all(axis=1)
    cut = TriangleMesh(vertices=ball.vertices, faces=ball.faces[kept])
    borders = open_borders(cut)
    assert open_borders(ball).num_holes == 0
    assert borders.num_holes == 1
    around = 2 * np.pi * 30  # of the circle at height 40, along which the border zigzags
    assert around < borders.length < 1.4 * around
    assert borders.longest == pytest.approx(borders.length)


def test_thinned_mesh_keeps_the_shape():
    ball = sphere(50.0)
    cluster = cluster_vertices(ball.vertices, 2000)
    vertices = cluster_means(cluster, ball.vertices)
    faces = cluster_faces(cluster, ball.faces)
    assert 500 < len(vertices) <= 2000 and faces.max() < len(vertices)
    assert np.allclose(np.linalg.norm(vertices, axis=1), 50, rtol=0.01)
    areas = np.linalg.norm(face_normals(vertices, faces), axis=1) / 2
    assert areas.sum() == pytest.approx(4 * np.pi * 50**2, rel=0.02)
    assert np.array_equal(cluster_vertices(ball.vertices, 10**6), np.arange(len(ball.vertices)))


def test_buffers_keep_coordinates_to_a_step_and_lie_at_multiples_of_their_size():
    points = np.random.default_rng(0).uniform(-3, 9, (101, 3))
    box = box_around([points])
    back = (quantised(points, box) / 65535 - 0.5) * 2 * box.half + np.array(box.centre)
    assert np.abs(back - points).max() < box.half / 65535 * 1.01
    index, _ = packed({"a": np.arange(3, dtype=np.uint8), "b": steps(np.array([[5, 2], [9, 9]]))})
    assert index["b"] == {"type": "int32", "offset": 4, "length": 4}
    assert steps(np.array([5, 2, 9])).tolist() == [5, -3, 7]


def test_without_the_scans_the_page_says_what_is_missing(tmp_path: Path):
    made = whole_folder(tmp_path / "model")
    write_html_report(made.folder)
    page = page_of(made.folder)
    assert sum("can be measured only with the scans" in words for words in page.words) == 4
    assert len([tag for tag, _ in page.elements if tag == "img"]) == 3
    modes = [found["value"] for tag, found in page.elements if tag == "input"]
    assert modes == ["model"]


ODD = ['</script><script>alert("x")</script>', "a&b <i>", "'quoted\"", "{{ 7 * 7 }}", "überзл 扫描"]


def test_odd_names_are_only_text(tmp_path: Path):
    folder = written(tmp_path, a_result(ODD[:3], {ODD[3]: "<b>no</b>", ODD[4]: "empty"}))
    write_html_report(folder)
    page = page_of(folder)
    tags = [tag for tag, _ in page.elements]
    assert tags.count("script") == 4 and "b" not in tags
    for name in ODD:
        assert name in page.words
    assert {pair["i"] for pair in json.loads(page.text["pairs-data"])} <= set(ODD)


def test_nothing_placed_or_one_scan_and_pairs_without_numbers(tmp_path: Path):
    result = a_result([], {"a": "shows no surface", "b": "too few points"})
    write_html_report(written(tmp_path, result), {})
    page = page_of(tmp_path)
    assert "No two of the 2 scans could be brought together." in page.words
    assert "canvas" not in [tag for tag, _ in page.elements]
    assert any("shows no surface" in words for words in page.words)
    result = a_result(["a"], {"b": "fits nowhere"})
    result = dataclasses.replace(result, pairs=(no_pair("a", "b"),))
    write_html_report(written(tmp_path, result))
    assert "1 of 2 scans are placed." in page_of(tmp_path).words


def test_sixty_scans_and_several_components(tmp_path: Path):
    names = [f"turn_{k:02d}" for k in range(60)]
    folder = crowd(tmp_path, names)
    write_html_report(folder)
    page = page_of(folder)
    cells = [found for tag, found in page.elements if tag == "td" and "data-pair" in found]
    assert len(cells) == 60 * 59 and all(found["title"] for found in cells)
    assert (folder / "report.html").stat().st_size < 4e6
    result = dataclasses.replace(
        a_result(["a", "b", "c", "d"]), components=(("a", "b"), ("d", "c"))
    )
    write_html_report(written(tmp_path, result))
    words = page_of(tmp_path).words
    assert any("in 2 separate components" in each for each in words)
    assert any("Component 2" in each for each in words) and "reference d" in words


def test_what_was_known_and_what_a_pair_slides_like_are_shown(tmp_path: Path):
    facts = (
        FactReport(fact="fix a", verdict=FactVerdict.HELD, reason="a: its frame is the world"),
        FactReport(fact="apart a b", verdict=FactVerdict.CONTRADICTED, reason="they are one"),
    )
    folder = written(tmp_path, dataclasses.replace(a_result(["a", "b"]), knowledge=facts))
    write_html_report(folder)
    page = page_of(folder)
    assert "Known beforehand" in page.words
    assert {"fix a", " held: a: its frame is the world"} <= set(page.words)
    assert {"apart a b", " contradicted: they are one"} <= set(page.words)
    assert any(found.get("class") == "contradicted" for _, found in page.elements)
    sliding = dataclasses.replace(a_pair("a", "b"), kind=PairKind.SLIDING, sliding=Slide.CYLINDER)
    folder = written(tmp_path, dataclasses.replace(a_result(["a", "b"]), pairs=(sliding,)))
    write_html_report(folder)
    told = [found["title"] for _, found in page_of(folder).elements if "title" in found]
    assert any("alone: sliding (cylinder), score" in words for words in told)
    assert json.loads(page_of(folder).text["pairs-data"])[0]["sliding"] == "cylinder"


def test_confidence_is_shown_where_there_is_one(tmp_path: Path):
    folder = written(tmp_path, good_result(small_scene()))
    for name, key in (("report.json", "scans"), ("graph.json", "pairs")):
        content = json.loads((folder / name).read_text(encoding="utf-8"))
        entries = content[key].values() if key == "scans" else content[key]
        for entry in entries:
            entry["confidence"] = 0.98765
        (folder / name).write_text(json.dumps(content))
    write_html_report(folder)
    page = page_of(folder)
    assert "0.98765" in page.values() and "98.8\u00a0%" in page.words
    assert all(pair["confidence"] == 0.98765 for pair in json.loads(page.text["pairs-data"]))
    told = {"kind": "good", "accepted": True, "reason": "", "overlap": 0.5, "evidence": None}
    told |= {"i": "a", "j": "b", "margin": 1.0, "observability": 0.1, "score": 0.6}
    assert pair_level(PairEntry.model_validate(told)) == 4
    assert pair_level(PairEntry.model_validate({**told, "score": None})) == 0
    assert pair_level(PairEntry.model_validate({**told, "confidence": 0.5})) == 2


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("report.json", None, "report.json: is missing"),
        ("graph.json", "[1, 2", "graph.json: not valid JSON"),
        ("graph.json", '{"format": 7, "pairs": []}', "graph.json: format"),
        ("poses.json", None, "holds no poses.json"),
        ("report.json", '{"format": 1}', "report.json: verdict: field required"),
        ("model.ply", "ply\nformat", "model.ply"),
    ],
)
def test_a_broken_folder_is_told_in_a_line(
    tmp_path: Path, name: str, content: str | None, told: str
):
    folder = whole_folder(tmp_path).folder
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    with pytest.raises(ReadError) as caught:
        write_html_report(folder)
    assert told in str(caught.value) and "\n" not in str(caught.value)
    assert not (folder / "report.html").exists()


def test_files_of_different_runs_are_refused(tmp_path: Path):
    folder = whole_folder(tmp_path / "a").folder
    other = written(tmp_path / "b", a_result(["x", "y"]))
    (other / "poses.json").replace(folder / "poses.json")
    with pytest.raises(ReadError, match="does not know the scan 'x'"):
        write_html_report(folder)


def test_command_writes_the_page_anew(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = small_scene()
    scans = write_scans(tmp_path / "scans", scene.scans)
    read, _ = job.read_all(job.collect_named([scans]))
    result = good_result(dataclasses.replace(scene, scans=tuple(read)))
    folder = written(tmp_path / "model", result)
    assert command("report", folder, "--scans", scans) == 0
    assert capsys.readouterr().out.strip() == str(folder / "report.html")
    assert num_pictures(folder) == 12
    assert command("report", folder) == 0  # where they are, this folder does not say
    assert num_pictures(folder) == 3
    write_outputs(result, folder, {s.name: Place(file=f"../scans/{s.name}.ply") for s in read})
    assert command("report", folder) == 0
    assert num_pictures(folder) == 12
    assert command("report", folder, "--scans", scans / f"{read[0].name}.ply") == 1
    assert "its file is not among the scans given" in capsys.readouterr().err
    first, second = (scans / f"{scan.name}.ply" for scan in read[:2])
    first.write_bytes(second.read_bytes())
    assert command("report", folder) == 1
    assert "is not the scan that" in capsys.readouterr().err
    (folder / "graph.json").unlink()
    assert command("report", folder) == 1
    assert capsys.readouterr().err.startswith("scanweld: error: ")
    assert command("report", tmp_path / "none") == 1


def num_pictures(folder: Path) -> int:
    return len([tag for tag, _ in page_of(folder).elements if tag == "img"])


def test_points_know_their_scan_beyond_the_256th():
    numbers = np.arange(300)
    scene = Scene(
        mesh=a_mesh(),
        borders=np.zeros((0, 2), np.int64),
        points=np.zeros((300, 3)),
        point_normals=np.zeros((300, 3)),
        point_scan=numbers,
    )
    described, text = payload(scene, as_seen_from(None), ["#000000"] * 300)
    place = described["arrays"]["pointScan"]
    body = zlib.decompress(base64.b64decode(text))
    found = np.frombuffer(body, "<u2", place["length"], place["offset"])
    assert place["type"] == "uint16" and (found == numbers).all()
