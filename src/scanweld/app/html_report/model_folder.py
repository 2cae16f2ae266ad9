"""A finished model folder, read back: what the page's numbers come from."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from scanweld.errors import ReadError
from scanweld.geometry.mesh import TriangleMesh
from scanweld.io import PoseSet, read_mesh, read_poses
from scanweld.pairs.result import Evidence, PairKind
from scanweld.reconstruction import ScanVerdict, Verdict


class Entry(BaseModel):
    """Part of a file; keys that are not named here are left alone."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class ScanEntry(Entry):
    """A scan in report.json."""

    verdict: ScanVerdict
    reason: str
    num_points: int
    num_dropped: int
    resolution: float | None
    diameter: float | None
    camera: str | None
    viewpoint: str
    notes: tuple[str, ...]
    content_hash: str | None
    num_keypoints: int
    edges: tuple[str, ...]
    overlap: float | None
    rms: float | None
    confidence: float | None = None


class StageEntry(Entry):
    """A stage in report.json; what it counted is kept as extra keys."""

    model_config = ConfigDict(frozen=True, extra="allow")
    seconds: float
    peak_mb: float

    @property
    def counts(self) -> Mapping[str, Any]:
        """What the stage counted, by name."""
        return self.model_extra or {}


class Report(Entry):
    """report.json."""

    format: Literal[1]
    verdict: Verdict
    reasons: tuple[str, ...]
    scans: dict[str, ScanEntry]
    stages: dict[str, StageEntry]
    settings: dict[str, Any]


class PairEntry(Entry):
    """A pair in graph.json."""

    i: str
    j: str
    kind: PairKind
    accepted: bool
    reason: str
    score: float | None
    overlap: float
    evidence: Evidence | None
    margin: float | None
    observability: float | None
    confidence: float | None = None


class Graph(Entry):
    """graph.json."""

    format: Literal[1]
    pairs: tuple[PairEntry, ...]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ModelFolder:
    """What a run wrote.

    Attributes:
        path: The folder.
        report: Verdict, scans, stages, settings.
        graph: All pairs.
        poses: Poses, components and what has no pose.
        mesh: The fused surface; None if nothing was fused.
    """

    path: Path
    report: Report
    graph: Graph
    poses: PoseSet
    mesh: TriangleMesh | None


def read_model_folder(path: Path) -> ModelFolder:
    """Read what ``scanweld run`` wrote.

    Raises:
        ReadError: If a part is missing, broken, or does not fit the others.
    """
    if not path.is_dir():
        raise ReadError(f"{path}: is no folder; name one that scanweld run has made")
    report = _read(path / "report.json", Report)
    graph = _read(path / "graph.json", Graph)
    poses = read_poses(path / "poses.json")
    named = {*poses.poses, *(name for pair in graph.pairs for name in (pair.i, pair.j))}
    if strangers := sorted(named - set(report.scans)):
        raise ReadError(
            f"{path}: report.json does not know the scan {strangers[0]!r} of the other files; "
            "give the folder of one run"
        )
    return ModelFolder(
        path=path, report=report, graph=graph, poses=poses, mesh=_mesh(path / "model.ply", report)
    )


def _mesh(path: Path, report: Report) -> TriangleMesh | None:
    fused = report.stages.get("fuse")
    if path.exists():
        return read_mesh(path)
    if fused is not None and fused.counts.get("faces"):
        raise ReadError(f"{path}: is missing; copy the model folder as a whole")
    return None


Content = TypeVar("Content", bound=Entry)


def _read(path: Path, kind: type[Content]) -> Content:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ReadError(f"{path}: is missing; name a folder that scanweld run has made") from error
    except (OSError, ValueError, RecursionError) as error:
        raise ReadError(f"{path}: cannot be read ({error}); run scanweld again") from error
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole"
        raise ReadError(
            f"{path}: {where}: {first['msg'].lower()}; run scanweld again to write it anew"
        ) from error
