"""The table under an object: found and left out where there is one, and nothing else is."""

from collections.abc import Sequence

import numpy as np
import pytest
import trimesh

from scanweld.config import Config, PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.primitives import box, sphere
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.turntable import joined
from scanweld.evaluation.views import view_of
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline import preparations
from scanweld.pipeline.intake import require_two, take_in
from scanweld.preparation import prepare, stands_on_support
from scanweld.preparation.support import find_support
from scanweld.work.progress import Event, NoCache, StageAdvanced, silent
from scanweld.work.stage_log import Stages
from tests.scenes import small_creature

NOISE = NoiseModel(depth_diameters=2e-4)


def slab(mesh: TriangleMesh, width: float, thickness: float = 2.0) -> TriangleMesh:
    """A square slab of a width, in diameters of the mesh, under it."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    side = width * float(np.linalg.norm(high - low))
    block = trimesh.creation.box((side, side, thickness))
    place = np.array([*0.5 * (low + high)[:2], low[2] - 0.5 * thickness])
    return TriangleMesh(vertices=block.vertices + place, faces=block.faces)


def seen(mesh: TriangleMesh, azimuth_deg: float, elevation_deg: float = 30.0) -> RangeScan:
    view = view_of(mesh, azimuth_deg, elevation_deg, 20.0, pixels=180.0)
    name = f"at {azimuth_deg:.0f}"
    return scan_mesh(mesh, view.camera, view.world_from_sensor, NOISE, 1, name=name)


def on_table(width: float = 1.6) -> TriangleMesh:
    mesh = small_creature()
    return joined(mesh, slab(mesh, width))


def solid(made: trimesh.Trimesh) -> TriangleMesh:
    return TriangleMesh(vertices=made.vertices, faces=made.faces)


@pytest.mark.parametrize("azimuth_deg", [0.0, 130.0, 250.0])
def test_what_is_left_out_is_the_table_and_nothing_else(azimuth_deg: float):
    mesh = small_creature()
    view = view_of(on_table(), azimuth_deg, 30.0, 20.0, pixels=180.0)
    scan = scan_mesh(on_table(), view.camera, view.world_from_sensor, NOISE, 1)
    prepared = prepare(scan, PrepareConfig())
    assert stands_on_support(prepared)
    spacing = prepared.resolution
    left_out = find_support(scan.points, spacing)
    assert left_out is not None
    height = view.world_from_sensor.apply(scan.points)[:, 2] - mesh.vertices[:, 2].min()
    assert left_out[height < 0.5 * spacing].all()
    assert not left_out[height > 3.0 * spacing].any()


def taken_in(scans: list[RangeScan], config: Config | None = None) -> Sequence[PreparedScan]:
    stages = Stages(workers=1, cache=NoCache(), progress=silent)
    return take_in(scans, {}, Knowledge(), config or Config(), stages).prepared


def test_the_prepared_scan_shows_the_object_alone():
    alone = prepare(seen(small_creature(), 0.0), PrepareConfig())
    scan = prepare(seen(on_table(), 0.0), PrepareConfig(), without_support=True)
    assert scan.diameter == pytest.approx(alone.diameter, rel=0.1)
    assert scan.is_without_support and "support" in scan.scan.notes[-1]
    assert not stands_on_support(scan)


BODIES = {
    "figure": small_creature(),
    "box": box(60, 40, 30),
    "ball": sphere(40),
    "cylinder": solid(trimesh.creation.cylinder(radius=30, height=60)),
    "plate with a low boss": joined(
        box(100, 70, 6), solid(trimesh.creation.cylinder(radius=12, height=14))
    ),
}


@pytest.mark.parametrize("body", BODIES)
def test_an_object_without_a_table_has_none(body: str):
    for azimuth_deg in (15.0, 200.0):
        assert not stands_on_support(prepare(seen(BODIES[body], azimuth_deg), PrepareConfig()))
    rng = np.random.default_rng(0)
    assert find_support(rng.normal(size=(3000, 3)), 0.05) is None
    assert find_support(np.outer(np.linspace(0, 1, 500), [1.0, 2.0, 3.0]), 0.002) is None


def test_only_scans_on_the_table_are_prepared_again_and_progress_counts_each_once(
    monkeypatch: pytest.MonkeyPatch,
):
    scans = [seen(on_table(), azimuth) for azimuth in (0.0, 90.0, 180.0)]
    scans.append(seen(small_creature(), 270.0))
    worked: list[str] = []

    def counted(scan: RangeScan, config: PrepareConfig, **options: bool) -> PreparedScan:
        worked.append(scan.name)
        return prepare(scan, config, **options)

    monkeypatch.setattr(preparations, "prepare", counted)
    events: list[Event] = []
    stages = Stages(workers=1, cache=NoCache(), progress=events.append)
    take_in(scans, {}, Knowledge(), Config(), stages)
    assert worked == ["at 0", "at 180", "at 270", "at 90", "at 0", "at 180", "at 90"]
    done = [event.done for event in events if isinstance(event, StageAdvanced)]
    assert done == [1, 2, 3, 4]


def test_a_table_in_most_scans_is_left_out_of_these_unless_the_settings_keep_it():
    with_table = [seen(on_table(), azimuth) for azimuth in (0.0, 90.0, 180.0, 270.0)]
    alone = [seen(small_creature(), azimuth) for azimuth in (0.0, 90.0, 180.0, 270.0)]
    mostly = taken_in([*with_table[:3], alone[3]])
    assert {scan.name: scan.is_without_support for scan in mostly} == {
        **dict.fromkeys(["at 0", "at 90", "at 180"], True),
        "at 270": False,
    }
    few = taken_in([*alone[:3], with_table[3]])
    kept = taken_in(with_table[:3], Config(prepare=PrepareConfig(support="kept")))
    assert not any(scan.is_without_support for scan in (*few, *kept))
    hashes = {scan.work_hash for scan in (*mostly, *kept)}
    assert len(hashes) == 7, "work on a scan with its table is none on one without"


def test_of_many_refused_scans_few_are_named():
    refused = {f"frame_{k:03}": "it shows nothing" for k in range(300)}
    with pytest.raises(InputError, match="0 usable scans; give at least 2") as error:
        require_two([], refused)
    assert "frame_000: it shows nothing" in str(error.value)
    assert "more" in str(error.value) and len(str(error.value)) < 400
