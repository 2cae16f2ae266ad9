"""What a run writes: poses.json, graph.json, report.json, config.toml, model.ply or preview.ply."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scanweld.app.json_text import json_text
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet, natural_key, write_mesh_ply, write_poses, write_whole
from scanweld.io.local_origin import find_shift
from scanweld.reconstruction import PairReport, Reconstruction
from scanweld.sensor.model import SensorModel
from scanweld.work.stage_log import StageReport

FORMAT = 1
PREVIEW = "preview.ply"
PREVIEW_COMMENT = "preview of doubtful scans, not a model: their poses may be wrong"

Json = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Place:
    """Where a scan is: its file, as seen from the model's folder, and which of the file's scans."""

    file: str
    part: int = 0


def write_outputs(
    result: Reconstruction,
    folder: Path,
    places: Mapping[str, Place] | None = None,
    max_points: int | None = None,
) -> None:
    """Write everything a run found out into a folder.

    Args:
        result: What the run found out.
        folder: An existing folder. There is no model.ply where there is no mesh, but preview.ply
            where all scans are doubtful.
        places: Where each scan is, as seen from the folder's final place.
        max_points: To how many points scans were thinned at most, if they were.

    Raises:
        WriteError: If a file cannot be written.
    """
    poses = PoseSet(
        poses=dict(result.poses), components=result.components, unplaced=dict(result.unplaced)
    )
    write_poses(folder / "poses.json", poses)
    write_whole(folder / "graph.json", json_text(graph_json(result)).encode())
    report = report_json(result, places, max_points)
    write_whole(folder / "report.json", json_text(report).encode())
    write_whole(folder / "config.toml", result.config.to_toml().encode())
    if result.mesh is not None:
        write_mesh_ply(folder / "model.ply", result.mesh)
    if result.preview is not None:
        write_mesh_ply(folder / PREVIEW, result.preview, [PREVIEW_COMMENT])


def graph_json(result: Reconstruction) -> Json:
    """What was found out about every pair."""
    return {"format": FORMAT, "pairs": [_pair(pair) for pair in result.pairs]}


def report_json(
    result: Reconstruction,
    places: Mapping[str, Place] | None = None,
    max_points: int | None = None,
) -> Json:
    """The verdict, as a whole and scan by scan, the stages' costs and the settings."""
    places = places or {}
    names = sorted(result.scans, key=natural_key)
    facts = [asdict(fact) for fact in result.knowledge]
    mesh = result.mesh or result.preview
    shift = None if mesh is None else find_shift(mesh.vertices)
    return {
        "format": FORMAT,
        "verdict": result.verdict.value,
        "exit_code": result.verdict.exit_code,
        "reasons": list(result.reasons),
        **({"knowledge": facts} if facts else {}),
        **({} if max_points is None else {"max_points": max_points}),
        **({} if result.sensor is None else {"sensor": _sensor(result.sensor)}),
        **({} if shift is None else {"shift": shift.tolist()}),
        **({} if result.preview is None else {"preview": PREVIEW}),
        "scans": {name: asdict(result.scans[name]) | _place(places.get(name)) for name in names},
        "stages": {name: _stage(stage) for name, stage in result.stages.items()},
        "settings": result.config.model_dump(mode="json"),
    }


def _place(place: Place | None) -> dict[str, Any]:
    if place is None:
        return {"file": None}
    return {"file": place.file} | ({"part": place.part} if place.part else {})


def _pair(pair: PairReport) -> Json:
    return {
        "i": pair.i,
        "j": pair.j,
        "kind": pair.kind.value,
        "accepted": pair.accepted,
        "reason": pair.reason,
        "confidence": pair.confidence,
        "i_from_j": None if pair.i_from_j is None else _matrix(pair.i_from_j),
        "score": pair.score,
        "overlap": pair.overlap,
        "evidence": None if pair.evidence is None else asdict(pair.evidence),
        "margin": pair.margin,
        "observability": pair.observability,
        "sliding": pair.sliding,
        "searched": pair.searched,
        "grounds": dict(pair.grounds),
        "alternatives": [
            {"i_from_j": _matrix(other.i_from_j), "score": other.score, "weight": other.weight}
            for other in pair.alternatives
        ],
        "passed_over": [
            {"i_from_j": _matrix(other.i_from_j), "score": other.score}
            for other in pair.passed_over
        ],
    }


def _sensor(sensor: SensorModel) -> Json:
    """What the set says of its sensor, in numbers and in words."""
    return {**asdict(sensor), "words": sensor.words()}


def _stage(stage: StageReport) -> Json:
    """What a stage cost, and what it counted."""
    return {"seconds": round(stage.seconds, 3), "peak_mb": round(stage.peak_mb, 1), **stage.counts}


def _matrix(pose: Pose) -> list[list[float]]:
    return pose.matrix().tolist()
