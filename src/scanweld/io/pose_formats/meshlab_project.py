"""MeshLab project, ``.mlp``: XML with a ``MLMesh`` and its ``MLMatrix44`` a scan.

As MeshLab's ``io_base/save_project.cpp`` and ``load_project.cpp`` have it: the matrix (row after
row, column vectors) takes the mesh to the world, the file is named relative to the project.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.pose_formats.records import (
    Entry,
    Frame,
    PosedScan,
    PoseEntries,
    attempt,
    matrix_rows,
    parse_words,
    refuse_characters,
)

TITLE = "MeshLab .mlp"


def recognise(text: str) -> bool:
    """Whether the text looks like this format."""
    return "<MeshLabProject" in text


def read(path: Path, text: str) -> PoseEntries:
    """The poses of all meshes; one without a matrix stays where it is.

    Raises:
        ReadError: If it is no such XML, or a matrix is not a rigid motion.
    """
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ReadError(f"{path}: not valid XML ({error}); save the project anew") from error
    entries: list[Entry] = []
    for mesh in root.iterfind("MeshGroup/MLMesh"):
        label = mesh.get("filename") or mesh.get("label")
        if not label:
            raise ReadError(f"{path}: a mesh without a file name; save the project anew")
        words = (mesh.findtext("MLMatrix44") or "").split()
        pose = attempt(parse_words, path, label, words) if words else Pose.identity()
        entries.append((label, pose))
    return PoseEntries(title=TITLE, frame=Frame.SCAN, entries=tuple(entries))


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The file's text by its name.

    Raises:
        WriteError: If a name holds characters that XML cannot.
    """
    files = [scan.known_file() for scan in scans]
    refuse_characters(scans, files, "", TITLE)
    lines = ["<!DOCTYPE MeshLabDocument>", "<MeshLabProject>", " <MeshGroup>"]
    for k, (scan, file) in enumerate(zip(scans, files, strict=True)):
        label = f"label={quoteattr(scan.name)} filename={quoteattr(file)}"
        lines.append(f'  <MLMesh id="{k}" {label} visible="1">')
        lines += ["   <MLMatrix44>", *matrix_rows(scan.world_from_scan), "</MLMatrix44>"]
        lines.append("  </MLMesh>")
    lines += [" </MeshGroup>", " <RasterGroup/>", "</MeshLabProject>"]
    return {"poses.mlp": "\n".join(lines) + "\n"}
