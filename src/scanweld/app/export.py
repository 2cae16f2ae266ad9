"""A model in the formats of other tools: its poses, its surface and its points."""

import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanweld.app.model_folder import ModelFolder, open_model
from scanweld.app.options import Wanted
from scanweld.app.outputs import PREVIEW
from scanweld.app.refusals import Refusals
from scanweld.app.workspace import Workspace
from scanweld.errors import InputError, ReadError, ScanweldError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import UNCOLORED, TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import ScanFile, natural_key, path_from, write_whole
from scanweld.io.local_origin import about_note, find_shift
from scanweld.io.mesh_write import glb_bytes, obj_bytes, stl_bytes
from scanweld.io.ply_write import points_ply_bytes
from scanweld.io.pose_formats import FORMATS, Frame, PosedScan, PoseFormat
from scanweld.io.pose_formats.records import printed
from scanweld.io.read import part_names
from scanweld.preparation.sensor import locate_sensor

_NOT_ON_WINDOWS = re.compile(r"(^|/)(con|prn|aux|nul|(com|lpt)\d)(\.|$)|[<>:|?*\"\\]", re.I)
_ABOUT_SHIFT = ("model.ply", "model.obj", "model.stl")
"""Files of the model in which one far off is about a local origin; a GLB moves it back itself."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Exported:
    """What an export has written.

    Attributes:
        files: Names of the files, as seen from the output's folder.
        notes: What is to be known about them, a line each.
        left_out: What could not be written and why, a line each.
    """

    files: tuple[str, ...]
    notes: tuple[str, ...]
    left_out: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Source:
    """What is exported: posed scans, as far as their files are there.

    Attributes:
        model: The folder.
        poses: Of the component's scans, in natural order.
        files: Where their files are, as far as they are needed,
        scans: and what they hold.
        shared: Files that hold several scans.
        broken: Why others cannot be read, by name.
    """

    model: ModelFolder
    poses: Mapping[str, Pose]
    files: Mapping[str, ScanFile]
    scans: Mapping[str, RangeScan]
    shared: Collection[Path]
    broken: Mapping[str, ScanweldError]


def export(folder: Path, output: Path, wanted: Wanted, *, force: bool = False) -> Exported:
    """Write a model in other formats into a folder that appears when it is whole.

    A scan or a format that cannot be written is left out and named; the rest is written.

    Args:
        folder: A model, as ``scanweld run`` or ``fuse`` has made it.
        output: The folder to be made.
        wanted: What to write.
        force: Whether an output that is there already is replaced.

    Raises:
        ScanweldError: If nothing that is asked for can be written; then there is no output.
    """
    model = open_model(folder)
    poses = _component(model, wanted)
    files, missing = _find_files(model, poses, wanted)
    parts = [folder / "poses.json", *(file.path for file in files.values())]
    refusals = Refusals()
    with Workspace(output, inputs=parts, force=force) as workspace:
        source = _read(model, poses, files, missing)
        contents, notes = _render(source, wanted, workspace.output, refusals)
        if not contents and refusals.first is not None:
            raise refusals.first
        for name, data in contents.items():
            path = workspace.staging / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, data)
        workspace.publish()
    return Exported(
        files=tuple(contents),
        notes=(*_not_of_it(model, wanted.component), *notes),
        left_out=refusals.lines(),
    )


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
) -> tuple[dict[str, ScanFile], dict[str, InputError]]:
    """The scans' files, as far as they are needed, and why some are not there."""
    formats = [FORMATS[name] for name in wanted.poses]
    if wanted.points or any(f.needs_files or f.frame is Frame.SENSOR for f in formats):
        return model.find_files(names, wanted.scans)
    return {}, {}


def _read(
    model: ModelFolder,
    poses: Mapping[str, Pose],
    files: Mapping[str, ScanFile],
    missing: Mapping[str, ScanweldError],
) -> _Source:
    """Read the scans. Formats that only name the files are right for these very ones, too."""
    scans: dict[str, RangeScan] = {}
    broken = dict(missing)
    for name, file in files.items():
        try:
            scans |= model.read_whole_scans({name: file})
        except (InputError, ReadError) as error:
            broken[name] = error
    paths = {file.path for file in files.values()}
    shared = {path for path in paths if len(part_names(path)) > 1}
    return _Source(model=model, poses=poses, files=files, scans=scans, shared=shared, broken=broken)


def _render(
    source: _Source, wanted: Wanted, output: Path, refusals: Refusals
) -> tuple[dict[str, bytes], list[str]]:
    """All files by name, before any of them is written, and notes on them."""
    contents: dict[str, bytes] = {}
    notes: list[str] = []
    shift = _shift(source, wanted)
    about: list[str] = []
    for name in dict.fromkeys(wanted.poses):
        texts = _poses(source, FORMATS[name], shift, output, refusals)
        contents |= {key: text.encode() for key, text in texts.items()}
        if FORMATS[name].frame is Frame.SENSOR:
            about += list(texts)[:1]
    for name in dict.fromkeys(wanted.model):
        try:
            contents[f"model.{name}"] = _model(source.model, name, wanted)
        except ScanweldError as error:
            refusals.add_whole(f"model.{name}", [error])
    if "model.glb" in contents:
        notes += _glb_notes(source.model, wanted)
    if wanted.points:
        contents |= _points_file(source, wanted.points, shift, refusals)
        notes += _grey_notes(source.scans.values())
    notes += _name_notes(list(contents))
    about += [key for key in contents if key in _ABOUT_SHIFT or key == wanted.points]
    if shift is not None and about:
        notes.append(about_note(about, shift))
    return contents, notes


def _name_notes(files: Sequence[str]) -> list[str]:
    """What is said of files that other systems cannot have, or not beside each other."""
    odd = [file for file in files if _NOT_ON_WINDOWS.search(file)]
    lower = Counter(file.casefold() for file in files)
    alike = [file for file in files if lower[file.casefold()] > 1]
    return [
        f"note: {', '.join(map(printed, names))}: {why}; rename the scans to copy them there"
        for names, why in (
            (odd, "Windows can have no files of such names"),
            (alike, "for Windows and macOS, which tell no capitals, these are the same"),
        )
        if names
    ]


def _shift(source: _Source, wanted: Wanted) -> FloatArray | None:
    """The local origin of what lies far off: that of the mesh, if there is one."""
    if wanted.component == 1:
        try:
            if source.model.mesh is not None:
                return find_shift(source.model.mesh.vertices)
        except ReadError:  # who exports it says so
            pass
    scans = source.scans
    if not scans:
        return None
    return find_shift(np.concatenate([source.poses[k].apply(s.points) for k, s in scans.items()]))


def _poses(
    source: _Source,
    form: PoseFormat,
    shift: FloatArray | None,
    output: Path,
    refusals: Refusals,
) -> dict[str, str]:
    """Texts of a format of poses; scans that it cannot hold are left out."""
    kept: list[PosedScan] = []
    errors: list[ScanweldError] = []
    for name in source.poses:
        try:
            scan = _posed(name, source, form, shift, output)
            form.write([scan])
            kept.append(scan)
        except ScanweldError as error:
            errors.append(error)
    if not kept:
        refusals.add_whole(form.title, errors)
        return {}
    for error in errors:
        refusals.add(form.title, error)
    return form.write(kept)


def _posed(
    name: str, source: _Source, form: PoseFormat, shift: FloatArray | None, output: Path
) -> PosedScan:
    speaks_of_sensors = form.frame is Frame.SENSOR
    if name in source.broken and (form.needs_files or speaks_of_sensors):
        raise source.broken[name]
    if form.needs_files and source.files[name].path in source.shared:
        raise InputError(
            f"{printed(name)}: shares its file with other scans, which {form.title} cannot tell "
            "apart; ask for --poses cloudcompare or open3d"
        )
    located = locate_sensor(source.scans[name]) if speaks_of_sensors else None
    return PosedScan(
        name=name,
        world_from_scan=source.poses[name],
        file=path_from(output, source.files[name].path) if name in source.files else None,
        camera=None if located is None else located.camera,
        scan_from_sensor=None if located is None else located.scan_from_sensor,
        shift=shift,
    )


def _model(model: ModelFolder, name: str, wanted: Wanted) -> bytes:
    mesh = model.mesh
    if mesh is None:
        doubtful = (model.path / PREVIEW).is_file()
        told = f"; {PREVIEW} is of doubtful scans, which are no model" if doubtful else ""
        raise InputError(f"{model.path}: holds no model.ply, so there is no model to export{told}")
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


def _points_file(
    source: _Source, name: str, shift: FloatArray | None, refusals: Refusals
) -> dict[str, bytes]:
    """A file of all scans' points in one frame, with the number of the scan that each is of."""
    scans = source.scans
    if not scans:
        refusals.add_whole(name, list(source.broken.values()))
        return {}
    for error in source.broken.values():
        refusals.add(name, error)
    points = np.concatenate([source.poses[key].apply(scan.points) for key, scan in scans.items()])
    counts = [len(scan.points) for scan in scans.values()]
    labels = np.repeat(np.arange(len(counts)), counts)
    colors = None
    if any(scan.colors is not None for scan in scans.values()):
        plain = [np.full((n, 3), UNCOLORED, np.uint8) for n in counts]
        each = zip(scans.values(), plain, strict=True)
        colors = np.concatenate([p if scan.colors is None else scan.colors for scan, p in each])
    names = [printed(key) for key in scans]
    return {name: points_ply_bytes(points, labels, names, colors, shift)}


def _grey_notes(scans: Collection[RangeScan]) -> list[str]:
    grey = [scan.name for scan in scans if scan.colors is None]
    if len(grey) in (0, len(scans)):
        return []
    return [f"note: without colours of their own, so grey among the points: {_list(grey)}"]


def _not_of_it(model: ModelFolder, component: int) -> list[str]:
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
