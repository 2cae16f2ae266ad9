"""Pairs of the Stanford scans, with the truth that the data give."""

from functools import lru_cache

from benchmarks.paper.views import KnownPair, data_file
from benchmarks.sets import moved_scans
from scanweld.config import PrepareConfig
from scanweld.evaluation.metrics import object_diameter
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_poses, read_scan
from scanweld.preparation import prepare

SEED = 0
"""Of the frames that the scans are given in."""


def real_pair(folder: str, names: tuple[str, ...], i: str, j: str) -> KnownPair:
    """Two scans of an object by their names.

    With ``names`` these scans are disguised by random motions and quarter turns of their grids;
    without any, all scans stay in the frames of their files.
    """
    _, world_from_scan, diameter = _scans(folder, names)
    a, b = (_prepared(folder, names, name) for name in (i, j))
    world_from_a = world_from_scan[i] @ a.scan_from_sensor
    world_from_b = world_from_scan[j] @ b.scan_from_sensor
    return KnownPair(i=a, j=b, true=world_from_a.inverse() @ world_from_b, diameter=diameter)


@lru_cache(maxsize=2)
def _scans(
    folder: str, names: tuple[str, ...]
) -> tuple[dict[str, RangeScan], dict[str, Pose], float]:
    """The scans, their reference poses, and the diameter of the object."""
    poses = dict(read_poses(data_file(f"{folder}/poses.json")).poses)
    chosen = names or sorted(poses)
    scans = [read_scan(data_file(f"{folder}/{name}.ply")) for name in chosen]
    if names:
        scans, poses = moved_scans(scans, poses, SEED, any_rotation=True, turn_grids=True)
    return {scan.name: scan for scan in scans}, poses, object_diameter(scans, poses)


@lru_cache(maxsize=32)
def _prepared(folder: str, names: tuple[str, ...], name: str) -> PreparedScan:
    return prepare(_scans(folder, names)[0][name], PrepareConfig())
