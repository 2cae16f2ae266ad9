"""The stages of a run one by one, for scans and poses that come from elsewhere.

Poses here are between the scans' own frames, or from them to a world.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

from scanweld.config import Config
from scanweld.contours.coherence import contour_matcher
from scanweld.errors import InputError
from scanweld.fusion.fuse import fuse as fuse_prepared
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.graph.view_graph import ViewGraph
from scanweld.heat.features import describe
from scanweld.pairs.registrar import PairRegistrar, PairTask
from scanweld.pairs.result import PairKind
from scanweld.pipeline.conclude import pair_report
from scanweld.preparation.prepare import prepare as prepare_scan
from scanweld.reconstruction import PairReport
from scanweld.refinement.refine import refine_poses
from scanweld.work.threads import num_workers, single_threaded_algebra


def prepare(scan: RangeScan, config: Config | None = None) -> PreparedScan:
    """What every later stage needs of a scan: where its sensor stood, its range image, samples.

    Args:
        scan: A scan.
        config: Settings; the defaults if not given.

    Raises:
        InputError: If the scan shows no surface.
    """
    return prepare_scan(scan, (config or Config()).prepare)


def register_pair(a: RangeScan, b: RangeScan, config: Config | None = None) -> PairReport:
    """Find the relative pose of two scans from any start, and say what it rests on.

    Args:
        a: A scan.
        b: Another one of the same object, of another name.
        config: Settings; the defaults if not given.

    Returns:
        The pair with the scans in the order of their names: ``i_from_j`` is between the frames of
        these, None where nothing fits. Its kind says whether two scans alone decide. It has no
        confidence: that is of pairs in a run.

    Raises:
        InputError: If a scan shows no surface, or both have the same name.
    """
    if a.name == b.name:
        raise InputError(f"both scans are called {a.name}; give them two names")
    config = config or Config()
    with single_threaded_algebra():
        prepared = [prepare(scan, config) for scan in sorted((a, b), key=lambda scan: scan.name)]
        registrar = PairRegistrar(config=config)
        parts = [registrar.scan(scan, describe(scan, config.heat)) for scan in prepared]
        result = registrar.register(PairTask(edge=(0, 1)), *parts)
    is_good = result.kind is PairKind.GOOD
    graph = ViewGraph(
        pairs={(0, 1): result},
        usable={(0, 1): result},
        accepted={(0, 1): result.alternatives[0]} if is_good else {},
        rejected={} if is_good else {(0, 1): result.reason},
        components=(),
        unplaced={},
    )
    return pair_report(prepared, graph, (0, 1), config)


def refine(
    scans: Sequence[RangeScan], poses: Mapping[str, Pose], config: Config | None = None
) -> dict[str, Pose]:
    """Refine roughly known poses of scans together, by surfaces and contours (paper 3.2).

    Args:
        scans: Scans; those without a pose take no part.
        poses: ``world_from_scan`` by name, good to a few degrees and percent of the diameter.
        config: Settings; the defaults if not given.

    Returns:
        Refined ``world_from_scan`` of the scans that had one. The first of these, in the order of
        ``scans``, stays where it is.

    Raises:
        InputError: If fewer than two scans have a pose, or one shows no surface.
    """
    config = config or Config()
    prepared = _prepared_with_pose(scans, poses, config)
    start = _world_from_sensor(prepared, poses)
    edges = list(combinations(range(len(prepared)), 2))
    with single_threaded_algebra():
        contours = contour_matcher(prepared, config.contours)
        refined = refine_poses(prepared, dict(enumerate(start)), edges, config.refine, contours)
    return {
        scan.name: poses[scan.name] if k == 0 else pose @ scan.scan_from_sensor.inverse()
        for (k, pose), scan in zip(sorted(refined.poses.items()), prepared, strict=True)
    }


def fuse(
    scans: Sequence[RangeScan],
    poses: Mapping[str, Pose],
    config: Config | None = None,
    *,
    workers: int | None = None,
) -> TriangleMesh:
    """Fuse scans with known poses into one mesh, in the world frame.

    Args:
        scans: Scans; those without a pose take no part.
        poses: ``world_from_scan`` by name; they are not judged.
        config: Settings; the defaults if not given.
        workers: Threads; as many as there are cores if not given.

    Raises:
        InputError: If fewer than two scans have a pose, or there is nothing to fuse.
    """
    config = config or Config()
    prepared = _prepared_with_pose(scans, poses, config)
    with single_threaded_algebra():
        return fuse_prepared(
            prepared,
            _world_from_sensor(prepared, poses),
            config.fusion,
            prepare=config.prepare,
            workers=num_workers(workers),
        )


def _prepared_with_pose(
    scans: Sequence[RangeScan], poses: Mapping[str, Pose], config: Config
) -> list[PreparedScan]:
    prepared = [prepare(scan, config) for scan in scans if scan.name in poses]
    if len(prepared) < 2:
        raise InputError(f"{len(prepared)} of the scans have a pose; give poses of at least 2")
    return prepared


def _world_from_sensor(
    prepared: Sequence[PreparedScan], world_from_scan: Mapping[str, Pose]
) -> list[Pose]:
    return [world_from_scan[scan.name] @ scan.scan_from_sensor for scan in prepared]
