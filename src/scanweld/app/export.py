"""A model in the formats of other tools: its poses, its surface and its points."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from scanweld.app.model_folder import ModelFolder, open_model
from scanweld.app.options import Wanted
from scanweld.app.workspace import Workspace
from scanweld.errors import InputError
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import ScanFile, natural_key, path_from, write_whole
from scanweld.io.mesh_write import glb_bytes, obj_bytes, stl_bytes
from scanweld.io.ply_write import points_ply_bytes
from scanweld.io.pose_formats import FORMATS, Frame, PosedScan
from scanweld.io.pose_formats.records import printed
from scanweld.preparation.sensor import locate_sensor

NO_COLOR = 128
"""Grey of points whose scan has no colours where others have."""


def export(folder: Path, output: Path, wanted: Wanted, *, force: bool = False) -> list[str]:
    """Write a model in other formats into a folder that appears when it is whole.

    Args:
        folder: A model, as ``scanweld run`` or ``fuse`` has made it.
        output: The folder to be made.
        wanted: What to write.
        force: Whether an output that is there already is replaced.

    Returns:
        What was written and what is to be known about it, a line each.

    Raises:
        ScanweldError: If a part of the model that is asked for is missing or broken, or a format
            cannot hold it; nothing is written then.
    """
    model = open_model(folder)
    poses = _component(model, wanted)
    files = _find_files(model, poses, wanted)
    parts = [folder / "poses.json", *(file.path for file in files.values())]
    with Workspace(output, inputs=parts, force=force) as workspace:
        contents, notes = _render(model, poses, files, wanted, workspace.output)
        for name, data in contents.items():
            path = workspace.staging / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, data)
        workspace.publish()
    return [f"{output}: {', '.join(contents)}", *_left_out(model, wanted.component), *notes]


def _component(model: ModelFolder, wanted: Wanted) -> dict[str, Pose]:
    """Poses of the component that is asked for, in natural order; refuses what cannot be."""
    if not (wanted.poses or wanted.model or wanted.points):
        raise InputError("nothing to export: ask for --poses, --model or --points")
    points = wanted.points
    if points is not None and (Path(points).name != points or not points.endswith(".ply")):
        raise InputError(f"{points}: points are written as PLY; give a name such as merged.ply")
    if points in [f"model.{name}" for name in wanted.model]:
        raise InputError(f"{points}: is the model's name; call the file of points otherwise")
    count = len(model.poses.components)
    if not count:
        raise InputError(f"{model.path}: no scan is placed, so there is nothing to export")
    if wanted.component > count:
        raise InputError(f"{model.path}: has no component {wanted.component}, but {count}")
    if wanted.model and wanted.component > 1:
        raise InputError("only the first component has a model; leave out --model or --component")
    names = sorted(model.poses.components[wanted.component - 1], key=natural_key)
    return {name: model.poses.poses[name] for name in names}


def _find_files(
    model: ModelFolder, names: Mapping[str, Pose], wanted: Wanted
) -> dict[str, ScanFile]:
    """The scans' files, as far as they are needed."""
    formats = [FORMATS[name] for name in wanted.poses]
    if wanted.points or any(f.needs_files or f.frame is Frame.SENSOR for f in formats):
        return model.scan_files(names, wanted.scans)
    return {}


def _render(
    model: ModelFolder,
    poses: Mapping[str, Pose],
    files: Mapping[str, ScanFile],
    wanted: Wanted,
    output: Path,
) -> tuple[dict[str, bytes], list[str]]:
    """All files by name, before any of them is written, and notes on them."""
    contents: dict[str, bytes] = {}
    notes: list[str] = []
    # Formats that only name the files are right for these very scans, too: all are checked.
    scans = model.read_whole_scans(files)
    for name in dict.fromkeys(wanted.poses):
        sensors = scans if FORMATS[name].frame is Frame.SENSOR else {}
        posed = [_posed(key, pose, files, sensors, output) for key, pose in poses.items()]
        contents |= {key: text.encode() for key, text in FORMATS[name].write(posed).items()}
    for name in dict.fromkeys(wanted.model):
        contents[f"model.{name}"] = _model(model, name, wanted)
    if "glb" in wanted.model:
        notes += _glb_notes(model, wanted)
    if wanted.points:
        contents[wanted.points], told = _points(scans, poses)
        notes += told
    return contents, notes


def _posed(
    name: str,
    pose: Pose,
    files: Mapping[str, ScanFile],
    sensors: Mapping[str, RangeScan],
    output: Path,
) -> PosedScan:
    located = locate_sensor(sensors[name]) if name in sensors else None
    return PosedScan(
        name=name,
        world_from_scan=pose,
        file=path_from(output, files[name].path) if name in files else None,
        camera=None if located is None else located.camera,
        scan_from_sensor=None if located is None else located.scan_from_sensor,
    )


def _model(model: ModelFolder, name: str, wanted: Wanted) -> bytes:
    mesh = model.mesh
    if mesh is None:
        raise InputError(f"{model.path}: holds no model.ply, so there is no model to export")
    if name == "ply":
        return model.mesh_path.read_bytes()
    writers: dict[str, Callable[[TriangleMesh], bytes]] = {
        "obj": obj_bytes,
        "stl": stl_bytes,
        "glb": lambda mesh: glb_bytes(mesh, wanted.unit or model.unit, wanted.up),
    }
    return writers[name](mesh)


def _glb_notes(model: ModelFolder, wanted: Wanted) -> list[str]:
    if wanted.unit or model.unit:
        return []
    return ["note: the scans' unit is unknown, so model.glb takes it for metres; say it by --unit"]


def _points(scans: Mapping[str, RangeScan], poses: Mapping[str, Pose]) -> tuple[bytes, list[str]]:
    """All scans' points in one frame, with the number of the scan that each is of."""
    points = np.concatenate([poses[name].apply(scan.points) for name, scan in scans.items()])
    counts = [len(scan.points) for scan in scans.values()]
    labels = np.repeat(np.arange(len(counts)), counts)
    grey = [name for name, scan in scans.items() if scan.colors is None]
    colors = None
    if len(grey) < len(scans):
        plain = [np.full((n, 3), NO_COLOR, np.uint8) for n in counts]
        each = zip(scans.values(), plain, strict=True)
        colors = np.concatenate([p if scan.colors is None else scan.colors for scan, p in each])
    data = points_ply_bytes(points, labels, [printed(name) for name in scans], colors)
    if colors is None or not grey:
        return data, []
    return data, [f"note: without colours of their own, so grey among the points: {_list(grey)}"]


def _left_out(model: ModelFolder, component: int) -> list[str]:
    notes = []
    count = len(model.poses.components)
    if count > 1:
        notes.append(
            f"note: component {component} of {count}; the others have frames of their own, ask for "
            "them with --component"
        )
    if model.poses.unplaced:
        names = sorted(model.poses.unplaced, key=natural_key)
        notes.append(f"note: not placed, so left out: {_list(names)}")
    return notes


def _list(names: Sequence[str]) -> str:
    return ", ".join(printed(name) for name in names)
