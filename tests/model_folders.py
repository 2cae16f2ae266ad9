"""Model folders as a run leaves them, of scans whose poses are known, for tests of the report."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from pathlib import Path

from scanweld.app.outputs import write_outputs
from scanweld.evaluation.views import view_of
from scanweld.geometry.scan import RangeScan
from scanweld.reconstruction import Reconstruction
from tests.results import a_pair, a_result, no_pair
from tests.scenes import Scene, scene_of, small_creature


@dataclass(frozen=True, kw_only=True)
class Made:
    """A folder and the scans it was made of."""

    folder: Path
    scans: dict[str, RangeScan]


@lru_cache(maxsize=1)
def small_scene() -> Scene:
    """Four views of a creature from around."""
    mesh = small_creature()
    return scene_of(mesh, [view_of(mesh, 90 * k, 10, pixels=90) for k in range(4)])


def good_result(scene: Scene) -> Reconstruction:
    """What a run would find of the scene: the truth."""
    names = [scan.name for scan in scene.scans]
    result = a_result(names)
    hashes = {scan.name: scan.content_hash() for scan in scene.scans}
    scans = {
        name: dataclasses.replace(
            report, content_hash=hashes[name], overlap=0.8625, num_points=12345, rms=0.01875
        )
        for name, report in result.scans.items()
    }
    pairs = [
        dataclasses.replace(a_pair(i, j), score=0.1 * k + 0.0123)
        for k, (i, j) in enumerate(combinations(names, 2))
    ]
    return dataclasses.replace(
        result, poses=scene.world_from_scan, mesh=scene.mesh, pairs=tuple(pairs), scans=scans
    )


def whole_folder(folder: Path) -> Made:
    """A folder in which everything is good."""
    scene = small_scene()
    return Made(
        folder=written(folder, good_result(scene)), scans={scan.name: scan for scan in scene.scans}
    )


def crowd(folder: Path, names: Sequence[str]) -> Path:
    """A folder of many scans from around, of which every two are a pair, and one triangle."""
    pairs = []
    for i, j in combinations(range(len(names)), 2):
        gap = min(j - i, len(names) - j + i)
        pair = a_pair(names[i], names[j])
        if gap > 9:
            pair = no_pair(names[i], names[j])
        elif gap == 7:
            pair = dataclasses.replace(pair, accepted=False, reason="the others contradict it")
        pairs.append(dataclasses.replace(pair, score=0.7 - 0.09 * gap) if gap <= 9 else pair)
    return written(folder, dataclasses.replace(a_result(names), pairs=tuple(pairs)))


def written(folder: Path, result: Reconstruction) -> Path:
    """The folder, with a run's files in it."""
    folder.mkdir(parents=True, exist_ok=True)
    write_outputs(result, folder)
    return folder
