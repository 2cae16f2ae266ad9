"""Outcomes of runs that never took place, for tests of what is done with them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.evidence.evidence import Evidence
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.knowledge.facts import Knowledge
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import (
    AlternativeReport,
    PairReport,
    Reconstruction,
    ScanReport,
    ScanVerdict,
    Verdict,
)
from scanweld.work.progress import Cache, NoCache, Progress, StageAdvanced, silent
from scanweld.work.stage_log import StageReport

EVIDENCE = Evidence(agree=0.5, front=0.01, contradict=0.02, free=0.03, occluded=0.34, unknown=0.1)


def turned(number: int) -> Pose:
    """A different pose for each number."""
    return Pose.exp([0.1 * number, 0.2, -0.3, number, 0.5, -number])


def a_mesh() -> TriangleMesh:
    """One triangle."""
    return TriangleMesh(vertices=np.eye(3), faces=np.array([[0, 1, 2]]))


def a_pair(i: str, j: str) -> PairReport:
    """An accepted pair with a rival."""
    return PairReport(
        i=i,
        j=j,
        kind=PairKind.GOOD,
        accepted=True,
        reason="",
        i_from_j=turned(1),
        score=EVIDENCE.score,
        overlap=0.4,
        evidence=EVIDENCE,
        margin=0.8,
        observability=1e-3,
        alternatives=(
            AlternativeReport(i_from_j=turned(1), score=EVIDENCE.score, weight=0.75),
            AlternativeReport(i_from_j=turned(2), score=0.1, weight=0.25),
        ),
    )


def no_pair(i: str, j: str) -> PairReport:
    """A pair that fits nowhere."""
    return PairReport(
        i=i,
        j=j,
        kind=PairKind.NO_OVERLAP,
        accepted=False,
        reason="nothing fits",
        i_from_j=None,
        score=None,
        overlap=0.0,
        evidence=None,
        margin=float("nan"),
        observability=float("inf"),
    )


def a_result(
    placed: Sequence[str], unplaced: Mapping[str, str] | None = None, config: Config | None = None
) -> Reconstruction:
    """All of the placed scans in one component; partial if there are others."""
    unplaced = dict(unplaced or {})
    good = ScanReport(verdict=ScanVerdict.GOOD, reason="fits", rms=float("nan"))
    scans = {name: good for name in placed}
    for name, reason in unplaced.items():
        scans[name] = ScanReport(verdict=ScanVerdict.UNPLACED, reason=reason)
    verdict = Verdict.PARTIAL if unplaced else Verdict.GOOD
    first, *others = placed or ("",)
    return Reconstruction(
        poses={name: turned(k) for k, name in enumerate(placed)},
        components=(tuple(placed),) if placed else (),
        unplaced=unplaced,
        scans=scans,
        pairs=tuple(a_pair(first, other) for other in others),
        mesh=a_mesh() if placed else None,
        verdict=verdict if placed else Verdict.NOTHING,
        reasons=tuple(f"{name} is not placed" for name in unplaced),
        stages={"pairs": StageReport(seconds=1.23456, peak_mb=100.06, counts={"pairs": 3})},
        config=config or Config(),
    )


def stub_run(
    scans: Sequence[RangeScan],
    config: Config | None = None,
    *,
    knowledge: Knowledge | None = None,
    unreadable: Mapping[str, str] | None = None,
    workers: int | None = None,
    cache: Cache | None = None,
    progress: Progress = silent,
) -> Reconstruction:
    """Stands for the pipeline: places every scan that could be read, keeps one thing on the way."""
    if len(scans) < 2:
        raise InputError(f"only {len(scans)} of the scans can be read; give two or more")
    (knowledge or Knowledge()).check_names([scan.name for scan in scans])
    for done, scan in enumerate(scans):
        progress(StageAdvanced(stage="prepare", done=done + 1, total=len(scans)))
        (cache or NoCache()).put(scan.content_hash(), scan.name)
    return a_result([scan.name for scan in scans], unreadable, config)


class Memory:
    """A cache that counts what it is asked to keep."""

    def __init__(self) -> None:
        self.kept: dict[str, Any] = {}
        self.num_put = 0

    def get(self, key: str) -> Any:
        return self.kept.get(key)

    def put(self, key: str, value: Any) -> None:
        self.num_put += 1
        self.kept[key] = value
