"""What a set says of its sensor: noise and bent depth apart, patches, what stood still, bounds."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from scanweld.confidence.bounds import Bounds
from scanweld.config import PrepareConfig
from scanweld.evidence.field import RASTER_DEPTH, RASTER_KIND, ScanField
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG
from scanweld.evidence.sample_patches import violating_patches
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.geometry.prepared import PixelKind
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.pairs.quick import search_quickly
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pairs.verdict import MAX_CONTRADICTION, held_to
from scanweld.preparation.range_image import make_range_image, natural_pixel
from scanweld.sensor.closure import NO_CYCLES, Closure, closure_of
from scanweld.sensor.learn import learn_sensor
from scanweld.sensor.model import SensorModel
from scanweld.sensor.standing import moved_share, standing_scans
from tests.prepared import PreparedPair, creature_pair

USUAL = 0.012


def learnt(pair: PreparedPair, *results: PairResult) -> SensorModel:
    pairs = {(2 * n, 2 * n + 1): replace(r, i=2 * n, j=2 * n + 1) for n, r in enumerate(results)}
    fields = [field for _ in results for field in pair.fields]
    return learn_sensor(pairs, fields, pair.diameter, USUAL * pair.diameter, 0.1)


def with_depth(field: ScanField, change: Callable[[FloatArray], FloatArray]) -> ScanField:
    """The scan with other depths: its pixels, samples and surface move along the rays."""
    raster = field.raster.copy()
    raster[..., RASTER_DEPTH] += change(raster[..., RASTER_DEPTH].astype(np.float64))
    return replace(field, raster=raster)


@pytest.fixture(scope="module")
def found() -> tuple[PreparedPair, PairResult]:
    pair = creature_pair(30)
    return pair, search_quickly(pair.problem())


def test_exact_scans_are_judged_as_usual_and_nothing_is_learnt_from_what_is_not_certain(
    found: tuple[PreparedPair, PairResult],
):
    pair, result = found
    assert result.kind is PairKind.GOOD
    sensor = learnt(pair, result, result)
    assert sensor.num_certain == 2
    assert sensor.tolerance == USUAL * pair.diameter
    assert 0.1 <= sensor.max_contradiction < 0.12 and sensor.margin == 0.0
    assert sensor.sigma < 0.003 * pair.diameter
    middle = len(sensor.spread) // 2
    assert sum(sensor.spread[middle - 4 : middle + 5]) > 0.55 * sum(sensor.spread) > 100
    assert "2 certain pairs" in sensor.words()
    doubtful = replace(result, margin=0.3)
    none = learnt(pair, doubtful)
    assert none.num_certain == 0 and none.tolerance == sensor.tolerance
    assert none.max_contradiction == 0.1
    assert "too few pairs" in none.words()


def test_a_coarser_sensor_is_judged_wider_up_to_a_limit(found: tuple[PreparedPair, PairResult]):
    """Surfaces that lie apart by noise widen the tolerance, in proportion."""
    pair, result = found
    i, j = pair.fields
    rng = np.random.default_rng(3)
    widths = []
    for noise in (0.0025, 0.0035, 0.02):
        fields = []
        for field in (i, j, i, j):
            shifts = noise * pair.diameter * rng.normal(size=(len(field.points), 1))
            fields.append(replace(field, points=field.points + shifts * field.normals))
        pairs = {(0, 1): result, (2, 3): replace(result, i=2, j=3)}
        sensor = learn_sensor(pairs, fields, pair.diameter, USUAL * pair.diameter, 0.1)
        widths.append(sensor.tolerance / pair.diameter)
        assert sensor.correlated < 0.5 * sensor.white or noise > 0.01, "each is off by itself"
    assert USUAL < widths[0] < widths[1] < widths[2] <= 0.03 + 1e-12


def test_bent_depth_is_what_neighbours_share_and_noise_is_not(
    found: tuple[PreparedPair, PairResult],
):
    """One scan waves before and behind the other, which says so from the other side."""
    pair, result = found
    i, j = pair.fields
    rng = np.random.default_rng(9)
    amplitude = 0.006 * pair.diameter

    def told(shifts: FloatArray) -> SensorModel:
        points = j.points + shifts[:, None] * j.normals
        targets = j.surface.copy()
        nearest = np.argmin(np.linalg.norm(targets[:, None, :3] - j.points[None], axis=2), axis=1)
        targets[:, :3] += shifts[nearest, None] * targets[:, 3:6]
        moved = replace(j, points=points, surface=targets)
        return learn_sensor({(0, 1): result}, [i, moved], pair.diameter, USUAL * pair.diameter, 0.1)

    wave = 2 * np.pi * (j.points @ [1.0, 0.7, 0.0]) / (0.5 * pair.diameter)
    bent = told(amplitude * np.sin(wave))
    noisy = told(amplitude * rng.normal(size=len(j.points)))
    assert bent.correlated > 2.0 * bent.white
    assert bent.correlated == pytest.approx(amplitude / np.sqrt(2), rel=0.4)
    assert noisy.correlated < 0.5 * noisy.white


def test_what_violates_together_counts_and_what_is_scattered_does_not(
    found: tuple[PreparedPair, PairResult],
):
    pair, _ = found
    i, j = pair.fields
    tolerance = USUAL * pair.diameter
    ((front, free, inside),) = violating_patches(i, j, [pair.i_from_j], tolerance)
    assert front < 0.01 and free < 0.01 and inside < 0.01
    # One in twenty of j's samples pulled out of its surface: at random, and all in one place.
    count = len(j.points) // 20
    rng = np.random.default_rng(5)
    at_random = rng.choice(len(j.points), count, replace=False)
    place = j.points[np.argmin(np.linalg.norm(j.points - j.centre, axis=1))]
    together = np.argsort(np.linalg.norm(j.points - place, axis=1))[:count]
    sizes = []
    for chosen in (at_random, together):
        points = j.points.copy()
        points[chosen] += 4 * tolerance * j.normals[chosen]
        moved = replace(j, points=points)
        sizes.append(violating_patches(i, moved, [pair.i_from_j], tolerance)[0].sum())
    assert sizes[1] > 2.5 * sizes[0]
    swapped = violating_patches(j, i, [pair.i_from_j.inverse()], tolerance)
    np.testing.assert_allclose(swapped, [[front, free, inside]], atol=0.01)


def test_a_surface_without_thickness_shows_its_inside_and_a_wall_does_not(
    found: tuple[PreparedPair, PairResult],
):
    pair, result = found
    i, j = pair.fields
    tolerance = USUAL * pair.diameter
    thickness = tolerance / 4
    assert result.best is not None

    def inside(depth: float) -> float:
        turned = replace(j, normals=-j.normals, points=j.points - depth * j.normals)
        return violating_patches(i, turned, [pair.i_from_j], tolerance, thickness)[0, 2]

    assert inside(0.0) > 0.3 * result.best.evidence.agree
    assert inside(2 * thickness) < 0.01


def test_a_pair_is_contradicted_by_the_limit_of_its_set(found: tuple[PreparedPair, PairResult]):
    _, result = found
    assert result.best is not None
    told = replace(result.best.evidence, front_patch=0.1 * result.best.evidence.agree)
    assert told.contradiction == pytest.approx(0.2, abs=0.02)
    assert held_to(result, 0.25, told) is result
    held = held_to(result, 0.15, told)
    assert held.kind is PairKind.CONTRADICTED and "saw through" in held.reason
    assert held.alternatives == result.alternatives
    assert MAX_CONTRADICTION > 0.25


def test_patches_in_free_space_are_held_to_what_certain_pairs_show(
    found: tuple[PreparedPair, PairResult],
):
    """A lid laid on a lid: hardly anything else agrees, and the bodies stand in free space."""
    pair, result = found
    assert result.best is not None
    cut = replace(result.best.evidence, free_patch=0.1)
    certain = replace(result, alternatives=(replace(result.best, evidence=cut),))
    through = replace(cut, agree=0.0, front_patch=0.0, free_patch=0.15)
    honest, trimmed, unknown = (
        learnt(pair, *results)
        for results in ((result, result), (result, certain), (replace(result, margin=0.3),))
    )
    assert through.free_excess(honest.limits) > 0.1
    assert through.free_excess(trimmed.limits) == pytest.approx(0.05)
    assert through.free_excess(unknown.limits) <= 0.0, "without certain pairs nothing is known"


@pytest.mark.parametrize(
    ("shares", "most"),
    [
        ([0.0] * 7 + [0.04, 0.05], 0.0),  # a part that moved is missing from two pairs
        ([0.0, 0.01, 0.02, 0.03, 0.04, 0.05], 0.05),  # borders that were cut anyhow
        ([0.01, 0.012, 0.011, 0.013, 0.012, 0.2], 0.01725),  # both
    ],
)
def test_what_few_certain_pairs_show_far_more_of_is_not_excused(
    found: tuple[PreparedPair, PairResult], shares: list[float], most: float
):
    pair, result = found
    best = result.alternatives[0]
    told = [replace(best, evidence=replace(best.evidence, free_patch=share)) for share in shares]
    sensor = learnt(pair, *(replace(result, alternatives=(one,)) for one in told))
    assert sensor.num_certain == len(shares)
    assert sensor.max_free_patch == pytest.approx(most)


@pytest.mark.parametrize("num_scans", [4, 6])
def test_cycles_tell_how_far_pairs_are_off(found: tuple[PreparedPair, PairResult], num_scans: int):
    """All pairs good and each off by a shift of its own; one that is wrong is not counted."""
    pair, result = found
    field, diameter = pair.fields[0], pair.diameter
    fields, edges = [field] * num_scans, list(combinations(range(num_scans), 2))

    def closed(share: float, wrong: float = 0.0) -> float:
        rng = np.random.default_rng(2)
        pairs = {}
        for n, (i, j) in enumerate(edges):
            off = rng.normal(size=3) * share * diameter / np.sqrt(3.0)
            off[0] += wrong * diameter * (n == 0)
            best = replace(result.alternatives[0], i_from_j=Pose.exp([0, 0, 0, *off]))
            pairs[i, j] = replace(result, i=i, j=j, alternatives=(best,))
        closure = closure_of(pairs, fields, diameter)
        assert wrong or closure.num_cycles == len(edges) - (num_scans - 1)
        return closure.displacement / diameter

    assert closed(0.0) == 0.0
    assert closed(0.01) == pytest.approx(0.01, rel=0.6)
    assert closed(0.02) == pytest.approx(2.0 * closed(0.01))
    assert closed(0.001, wrong=0.5) < 0.003
    alone = {(0, 1): result, (1, 2): replace(result, i=1, j=2), (0, 2): replace(result, i=0, j=2)}
    assert closure_of(alone, fields, diameter) == NO_CYCLES, "one cycle closes by chance"


def test_bent_depth_that_pairs_hide_widens_what_is_compared(
    found: tuple[PreparedPair, PairResult], monkeypatch: pytest.MonkeyPatch
):
    pair, result = found
    sensor = learnt(pair, result, result)

    def open_cycles(pairs: object, fields: object, diameter: float) -> Closure:
        return Closure(displacement=0.01 * diameter, num_cycles=2)

    monkeypatch.setattr("scanweld.sensor.learn.closure_of", open_cycles)
    bent = learnt(pair, result, result)
    assert bent.sigma > 0.005 * pair.diameter and bent.correlated == sensor.correlated
    assert bent.misclosure == pytest.approx(0.01 * pair.diameter)
    assert 0 < sensor.misclosure < 0.005 * pair.diameter, "usual, where no cycle closes"
    assert Closure(displacement=20.0, num_cycles=2).misclosure(5.0) == 20.0
    assert NO_CYCLES.misclosure(5.0) == 10.0
    assert "around cycles" in bent.words() and "around cycles" not in sensor.words()
    assert sensor.tolerance < bent.tolerance <= 0.03 * pair.diameter + 1e-9
    assert bent.reach > 2.0 * sensor.reach


# What stays and what moves.


def test_a_region_that_moved_before_a_standing_camera_is_found_and_noise_is_not():
    pair = creature_pair(30)
    field, diameter = pair.fields[0], pair.diameter
    rng = np.random.default_rng(7)
    noisy = with_depth(field, lambda depth: rng.normal(size=depth.shape) * 0.001 * diameter)
    assert moved_share(field, noisy, Pose.identity(), diameter) == 0.0
    rows, columns = np.nonzero(field.raster[..., RASTER_KIND] == float(PixelKind.SURFACE))
    middle = int(np.median(rows)), int(np.median(columns))

    def pushed(depth: FloatArray) -> FloatArray:
        change = np.zeros_like(depth)
        change[middle[0] - 6 : middle[0] + 6, middle[1] - 6 : middle[1] + 6] = 0.05 * diameter
        return change

    moved = with_depth(noisy, pushed)
    share = moved_share(field, moved, Pose.identity(), diameter)
    assert 0.3 * 144 / len(rows) < share < 1.5 * 144 / len(rows)
    scans = {k: Pose.identity() for k in range(3)}
    edges = [(0, 1), (0, 2), (1, 2)]
    found = standing_scans([field, moved, noisy], scans, edges, diameter)
    assert found is not None and found.scans == (0, 1, 2)
    assert "the camera did not move" in found.words()
    assert standing_scans([field, noisy, field], scans, edges, diameter) is None, "duplicates"
    turned = {**scans, 1: Pose.exp([0, 0.2, 0, 0, 0, 0]), 2: Pose.exp([0, 0.4, 0, 0, 0, 0])}
    assert standing_scans([field, moved, noisy], turned, edges, diameter) is None, "it moved"


# Bounds.


def test_bounds_grow_with_the_deviation_and_with_what_all_scans_err_alike():
    bounds = Bounds(rotation=3.0, translation=2.0, floor=4.0)

    def bound(deviation: float, correlated: float, unit: float = 1.0) -> PoseTolerance:
        """Of a scan whose points are off by so much in any way, in percent of the diameter."""
        arm = lever_arm(100.0)
        turn = float(np.degrees(deviation / arm))
        told = {0: PoseTolerance(angle_deg=turn, shift=deviation * unit)}
        sensor = SensorModel(
            num_certain=9,
            sigma=unit,
            white=unit,
            correlated=correlated * unit,
            tolerance=unit,
            max_contradiction=0.1,
            diameter=100.0 * unit,
        )
        return bounds.of(told, sensor)[0]

    assert bound(0.4, 0.0).shift == pytest.approx(0.8)
    assert np.radians(bound(0.4, 0.0).angle_deg) * lever_arm(100.0) == pytest.approx(1.2)
    assert bound(0.3, 0.1).shift == pytest.approx(1.0), "a right triangle of 3, 4, 5"
    assert bound(0.01, 0.2).angle_deg == pytest.approx(2 * bound(0.01, 0.1).angle_deg, rel=0.01)
    large = bound(0.4, 0.1, 1000.0)
    assert large.shift == pytest.approx(1000 * bound(0.4, 0.1).shift)
    assert large.angle_deg == pytest.approx(bound(0.4, 0.1).angle_deg)
    assert bound(1e9, 50.0) == PoseTolerance(angle_deg=RIVAL_ANGLE_DEG, shift=6.0)


def test_a_splat_lies_on_a_tilted_plane_wherever_its_points_fall():
    """Points without a grid: the nearest of each pixel would bring the plane forward."""
    rng = np.random.default_rng(11)
    xy = rng.uniform(-50, 50, size=(40_000, 2))
    points = np.column_stack([xy, 400.0 + 0.8 * xy[:, 0]])
    scan = RangeScan(
        name="plane",
        points=points,
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.ESTIMATED,
    )
    spacing = 0.5
    image, _ = make_range_image(scan, points, spacing, 150.0, PrepareConfig())
    assert natural_pixel(scan, spacing) > spacing
    seen = image.points()[np.isfinite(image.depth) & ~image.is_rim]
    off = seen[:, 2] - (400.0 + 0.8 * seen[:, 0])
    assert abs(np.median(off)) < 0.01 * image.pixel
    assert np.quantile(np.abs(off), 0.95) < 0.3 * image.pixel
