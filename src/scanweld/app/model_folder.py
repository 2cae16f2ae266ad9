"""A model's folder, as ``scanweld run`` and ``scanweld fuse`` write it, opened again."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from scanweld.app.frame_files import read_frames
from scanweld.app.model_files import Files, Graph, Report, read_entries
from scanweld.config import Unit, load_config
from scanweld.cut import mask_of, with_only
from scanweld.errors import InputError, ReadError
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.scan import RangeScan
from scanweld.io import PoseSet, ScanFile, collect, printable, read_mesh, read_poses
from scanweld.io.depth.capture import Frame
from scanweld.io.depth.frame import FrameSettings
from scanweld.io.depth.images import image_names
from scanweld.io.depth.layouts.records import Shot
from scanweld.io.depth.layouts.shots import shots_of
from scanweld.io.pose_formats.records import printed
from scanweld.preparation.thinning import thinned
from scanweld.reconstruction import Reconstruction, ScanVerdict


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelFolder:
    """A model's folder; but for the poses, what it holds is read when it is asked for, and once.

    Attributes:
        path: Of the folder.
        poses: Poses of the scans, and its components.
        result: What the folder was written from, if that is at hand: then the mesh is not read.
    """

    path: Path
    poses: PoseSet
    result: Reconstruction | None = None

    @property
    def mesh_path(self) -> Path:
        """Where the mesh is."""
        return self.path / "model.ply"

    @cached_property
    def mesh(self) -> TriangleMesh | None:
        """The mesh of the largest component; None where there is none.

        Raises:
            ReadError: If it is broken, or has no faces.
        """
        if self.result is not None:
            return self.result.mesh
        return read_mesh(self.mesh_path) if self.mesh_path.is_file() else None

    @cached_property
    def report(self) -> Report:
        """What was made of the scans.

        Raises:
            ReadError: If it is missing or broken.
        """
        return read_entries(self.path / "report.json", Report)

    @cached_property
    def graph(self) -> Graph:
        """All pairs; none where the poses were given.

        Raises:
            ReadError: If it is missing or broken.
        """
        return read_entries(self.path / "graph.json", Graph)

    @property
    def fused_scans(self) -> list[str]:
        """Scans that the mesh of a run was made of: doubtful ones if they were asked for."""
        with_doubtful = self.report.settings.get("fusion", {}).get("with_doubtful", False)
        return [
            name
            for name in (self.poses.components or ((),))[0]
            if with_doubtful or self.report.scans[name].verdict is not ScanVerdict.DOUBTFUL
        ]

    @cached_property
    def unit(self) -> Unit | None:
        """Of the scans; None where unknown.

        Raises:
            ConfigError: If the settings are broken.
        """
        settings = self.path / "config.toml"
        return load_config(settings).unit if settings.is_file() else None

    def scan_files(
        self, names: Iterable[str], given: Sequence[Path | str] = ()
    ) -> dict[str, ScanFile]:
        """Where the files of some scans are: among those given, else where the report says.

        Args:
            names: Of the scans.
            given: Files, folders and glob patterns, where the scans have been moved.

        Raises:
            InputError: If one of them is not there.
            ReadError: If the report is broken.
        """
        found, missing = self.find_files(names, given)
        for error in missing.values():
            raise error
        return found

    def find_files(
        self, names: Iterable[str], given: Sequence[Path | str] = ()
    ) -> tuple[dict[str, ScanFile], dict[str, InputError]]:
        """The same, and of each scan whose file is not there, why that is so."""
        known = self._given_files(given) if given else self._told_files()
        found: dict[str, ScanFile] = {}
        missing: dict[str, InputError] = {}
        for name in names:
            if name in known and known[name].path.is_file():
                found[name] = known[name]
                continue
            place = f" ({known[name].path})" if name in known else ""
            where = "among the scans given" if given else f"where the model says{place}"
            missing[name] = InputError(
                f"{printed(name)}: its file is not {where}; name all scans with --scans"
            )
        return found, missing

    def read_scans(self, files: Mapping[str, ScanFile]) -> dict[str, RangeScan]:
        """Scans as the model's maker took them: thinned where it had to save memory, not yet cut.

        Args:
            files: As ``scan_files`` finds them, by the scans' names.

        Raises:
            InputError: If one of them is not what the model was made of.
            ReadError: If one of them, or the report, is broken.
        """
        return {name: self._as_taken(file.read()) for name, file in files.items()}

    def read_whole_scans(self, files: Mapping[str, ScanFile]) -> dict[str, RangeScan]:
        """The same with all of their points, but for what was cut off.

        Raises:
            InputError: If one of them is not what the model was made of.
            ReadError: If one of them, or the report, is broken.
        """
        scans = {name: file.read() for name, file in files.items()}
        for scan in scans.values():
            self._as_taken(scan)
        return {name: self.cut(scan) for name, scan in scans.items()}

    def cut(self, scan: RangeScan) -> RangeScan:
        """A scan without what the run cut off.

        Raises:
            InputError: If it is not the scan that was cut.
            ReadError: If the report is broken.
        """
        told = self._files.scans.get(scan.name)
        if told is None or told.kept is None:
            return scan
        try:
            kept = mask_of(told.kept)
        except ValueError as error:
            path = self.path / "report.json"
            raise ReadError(
                f"{path}: scans.{scan.name}.kept: {error}; run scanweld again"
            ) from error
        try:
            return with_only(scan, kept)
        except ValueError as error:
            raise InputError(f"{error}; give the same files") from error

    def _as_taken(self, scan: RangeScan) -> RangeScan:
        """A scan as the model's maker took it, after making sure that it is the same one."""
        most, told = self._files.max_points, self._files.scans.get(scan.name)
        taken = scan if most is None else thinned(scan, most)
        if told is not None and told.content_hash not in (None, self.cut(taken).content_hash()):
            raise InputError(
                f"{printed(scan.name)}: is not the scan that {self.path} was made of; give the "
                "same files"
            )
        return taken

    @cached_property
    def _frames(self) -> dict[str, FrameSettings]:
        return read_frames(self.path)

    @cached_property
    def _files(self) -> Files:
        report = self.path / "report.json"
        return read_entries(report, Files) if report.is_file() else Files(scans={})

    def _given_files(self, given: Sequence[Path | str]) -> Mapping[str, ScanFile]:
        if not self._frames:
            return {file.name: file for file in collect(given)}
        shots = shots_of(given).shots
        names = [printable(name) for name in image_names([shot.depth for shot in shots])]
        return {
            name: Frame(path=shot.depth, name=name, settings=_beside(self._frames[name], shot))
            for shot, name in zip(shots, names, strict=True)
            if name in self._frames
        }

    def _told_files(self) -> Mapping[str, ScanFile]:
        return {
            name: self._file(self.path / scan.file, name, scan.part)
            for name, scan in self._files.scans.items()
            if scan.file
        }

    def _file(self, path: Path, name: str, part: int = 0) -> ScanFile:
        settings = self._frames.get(name)
        if settings is None:
            return ScanFile(path=path, name=name, part=part)
        return Frame(path=path, name=name, settings=settings)


def _beside(settings: FrameSettings, shot: Shot) -> FrameSettings:
    """The settings, with mask and colours from where they have been moved to with the image."""
    moved = {
        key: getattr(shot, key)
        for key in ("mask", "color")
        if (path := getattr(settings, key)) is not None and not path.is_file()
    }
    return replace(settings, **{key: path for key, path in moved.items() if path is not None})


def open_model(path: Path, result: Reconstruction | None = None) -> ModelFolder:
    """Open a model's folder.

    Args:
        path: Of the folder.
        result: What it was written from, if that is at hand.

    Raises:
        ReadError: If it is no such folder, or its poses are broken.
    """
    if not (path / "poses.json").is_file():
        raise ReadError(
            f"{path}: holds no poses.json; name a folder that scanweld run or fuse has made"
        )
    return ModelFolder(path=path, poses=read_poses(path / "poses.json"), result=result)
