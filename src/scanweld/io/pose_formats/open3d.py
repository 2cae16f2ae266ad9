"""Open3D's PoseGraph as JSON: the pose of each node takes its scan to the world.

As Open3D's ``pipelines/registration/PoseGraph.cpp`` writes it: 16 numbers, *column* after column.
It has no names: nodes come in the scans' natural order. We add their names under a key of our own,
which Open3D passes over.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.pose_formats.records import (
    Frame,
    PosedScan,
    PoseEntries,
    attempt,
    parse_pose,
)
from scanweld.io.poses import load_json

TITLE = "Open3D PoseGraph"
_NAMES = "scanweld_names"
_VERSION = {"version_major": 1, "version_minor": 0}


def recognise_json(content: dict[str, Any]) -> bool:
    """Whether the JSON looks like this format."""
    return content.get("class_name") == "PoseGraph"


def read(path: Path, text: str) -> PoseEntries:
    """The poses of all nodes.

    Raises:
        ReadError: If it is no such JSON, or a matrix is not a rigid motion.
    """
    content = load_json(path, text)
    nodes = content.get("nodes")
    if not isinstance(nodes, list):
        raise ReadError(f"{path}: has no list of nodes; write the pose graph anew")
    poses = [attempt(_pose, path, f"node {k}", node) for k, node in enumerate(nodes)]
    names = content.get(_NAMES)
    if not isinstance(names, list) or [type(name) for name in names] != [str] * len(poses):
        names = [None] * len(poses)
    entries = tuple(zip(names, poses, strict=True))
    return PoseEntries(title=TITLE, frame=Frame.SCAN, entries=entries, are_paths=False)


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The file's text by its name."""
    nodes = [
        {
            "class_name": "PoseGraphNode",
            "pose": (scan.world_from_scan.matrix().T.ravel() + 0.0).tolist(),
            **_VERSION,
        }
        for scan in scans
    ]
    names = [scan.name for scan in scans]
    graph = {"class_name": "PoseGraph", "edges": [], "nodes": nodes, _NAMES: names, **_VERSION}
    return {"posegraph.json": json.dumps(graph, indent=1) + "\n"}


def _pose(path: Path, where: str, node: Any) -> Pose:
    numbers = node.get("pose") if isinstance(node, dict) else None
    is_matrix = (
        isinstance(numbers, list)
        and len(numbers) == 16
        and all(type(x) in (int, float) for x in numbers)
    )
    if not is_matrix:
        raise ReadError(f"{path}: {where}: no pose of 16 numbers; write the pose graph anew")
    rows = np.array(numbers, dtype=np.float64).reshape(4, 4).T
    return parse_pose(path, where, rows.ravel().tolist())
