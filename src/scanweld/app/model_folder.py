"""A model's folder, as ``scanweld run`` and ``scanweld fuse`` write it, opened again."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scanweld.config import Unit, load_config
from scanweld.errors import ReadError
from scanweld.geometry.mesh import TriangleMesh
from scanweld.io import PoseSet, read_mesh, read_poses
from scanweld.io.poses import load_json, read_text


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelFolder:
    """What a model's folder says; its mesh is read when it is asked for.

    Attributes:
        path: Of the folder.
        poses: Poses of the scans, and its components.
        unit: Of the scans; None where unknown.
        files: Where the scans' files were, by name; they need not be there still.
    """

    path: Path
    poses: PoseSet
    unit: Unit | None
    files: Mapping[str, Path]

    @property
    def mesh_path(self) -> Path:
        """Where the mesh is."""
        return self.path / "model.ply"

    def mesh(self) -> TriangleMesh:
        """The mesh of the largest component.

        Raises:
            ReadError: If there is none, it is broken, or it has no faces.
        """
        if not self.mesh_path.is_file():
            raise ReadError(f"{self.path}: holds no model.ply, so there is no model to export")
        return read_mesh(self.mesh_path)


def open_model(path: Path) -> ModelFolder:
    """Read what a model's folder says.

    Parts that are missing count as unknown, but for the poses.

    Raises:
        ScanweldError: If it is no such folder, or a part of it is broken.
    """
    if not (path / "poses.json").is_file():
        raise ReadError(
            f"{path}: holds no poses.json; name a folder that scanweld run or fuse has made"
        )
    settings = path / "config.toml"
    return ModelFolder(
        path=path,
        poses=read_poses(path / "poses.json"),
        unit=load_config(settings).unit if settings.is_file() else None,
        files=_files(path),
    )


def _files(folder: Path) -> dict[str, Path]:
    """Where the report says that the scans' files are."""
    report = folder / "report.json"
    if not report.is_file():
        return {}
    scans = load_json(report, read_text(report)).get("scans")
    if not isinstance(scans, dict):
        raise ReadError(f"{report}: has no scans; restore the file or remove it")
    told = {name: scan.get("file") for name, scan in scans.items() if isinstance(scan, dict)}
    return {name: folder / file for name, file in told.items() if isinstance(file, str)}
