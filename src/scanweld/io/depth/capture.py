"""Sets of depth images: which files they are, and what was laid beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from numpy.typing import NDArray

from scanweld.errors import InputError, ReadError
from scanweld.geometry.pose import Pose
from scanweld.geometry.sampling import NUM_FRAMES
from scanweld.geometry.scan import RangeScan
from scanweld.io.collect import ScanFile, collect
from scanweld.io.depth.frame import FrameSettings, camera_of, read_frame, read_mask_of
from scanweld.io.depth.images import (
    are_depth_images,
    colors_of,
    found_intrinsics,
    image_names,
    masks_of,
    other_scans,
)
from scanweld.io.depth.intrinsics import FORMS, Intrinsics, read_intrinsics
from scanweld.io.depth.layouts.records import Shot
from scanweld.io.depth.layouts.registry import layout_of
from scanweld.io.depth.layouts.shots import Shots, shots_of
from scanweld.io.depth.pixels import read_pixels
from scanweld.io.depth.scale import DepthScale, find_scale
from scanweld.io.names import printable
from scanweld.io.poses import PoseSet

_NO_COLORS = Path("none")


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthOptions:
    """What users say of depth images.

    Attributes:
        intrinsics: A file; None to look for one beside the images.
        scale: Depth values in a metre; None to find it out.
        max_depth: Metres beyond which all is left out.
        masks: Folder of masks, or a glob pattern.
        color: Folder of colour images; none of them if it is called "none".
    """

    intrinsics: Path | None = None
    scale: float | None = None
    max_depth: float | None = None
    masks: Path | None = None
    color: Path | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame(ScanFile):
    """A depth image to be read as a scan.

    Attributes:
        settings: How it becomes one.
        world_from_scan: A pose that the layout has for it; nothing is believed of it.
        layout: What the layout is called, if it is a known one.
    """

    settings: FrameSettings
    world_from_scan: Pose | None = None
    layout: str = ""

    def read(self) -> RangeScan:
        """Read the scan.

        Raises:
            ReadError: If it cannot be read.
        """
        scan = read_frame(self.path, self.name, self.settings)
        return replace(scan, world_from_scan=self.world_from_scan)


Inputs = Sequence[Path | str]


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthImages:
    """Depth images that a user names, by files, folders and glob patterns.

    Attributes:
        inputs: What was named.
        options: What was said of them.
    """

    inputs: Inputs
    options: DepthOptions = DepthOptions()

    def collect(self) -> tuple[Frame, ...]:
        """The images in natural order of their paths, each with what it needs to be read.

        Raises:
            ReadError: If a file is missing or cannot be read, or sizes differ.
            InputError: If there are no images, intrinsics, masks or colours for all, or if files
                of several layouts are there.
        """
        found = self._with_files(shots_of(self.inputs))
        paths = [shot.depth for shot in found.shots]
        looked_at = _readable(paths[:: -(-len(paths) // NUM_FRAMES)])
        intrinsics = self._intrinsics(found)
        masks = {shot.depth: shot.mask for shot in found.shots if shot.mask is not None}
        for path, values in looked_at.items():
            camera_of(path, intrinsics[path], (values.shape[0], values.shape[1]))
            if path in masks:
                read_mask_of(path, masks[path], values.shape)
        scales = self._scales(found, intrinsics, looked_at)
        return tuple(
            Frame(
                path=shot.depth,
                name=printable(name),
                world_from_scan=shot.world_from_camera,
                layout="" if found.layout is None else found.layout.name,
                settings=FrameSettings(
                    intrinsics=intrinsics[shot.depth],
                    scale=scales[shot.depth],
                    max_depth=self.options.max_depth,
                    mask=shot.mask,
                    color=shot.color,
                    is_color_scaled=found.is_color_scaled,
                    told=found.told_of(shot, intrinsics[shot.depth]),
                ),
            )
            for shot, name in zip(found.shots, image_names(paths), strict=True)
        )

    def _with_files(self, found: Shots) -> Shots:
        """The images with the masks and colours that the user names."""
        options, paths = self.options, [shot.depth for shot in found.shots]
        shots = found.shots
        if options.masks is not None:
            masks = masks_of(paths, options.masks)
            shots = tuple(replace(shot, mask=masks[shot.depth]) for shot in shots)
        if options.color == _NO_COLORS:
            shots = tuple(replace(shot, color=None) for shot in shots)
        elif options.color is not None:
            colors = colors_of(paths, options.color)
            shots = tuple(replace(shot, color=colors[shot.depth]) for shot in shots)
        else:
            found.check_colors()
        return replace(found, shots=shots)

    def _intrinsics(self, found: Shots) -> dict[Path, Intrinsics]:
        """Of each image: as the user says, else the layout, a file beside, or what is usual."""
        given = (
            None if self.options.intrinsics is None else read_intrinsics(self.options.intrinsics)
        )
        beside: dict[Path, Intrinsics | None] = {}
        intrinsics = {}
        for shot in found.shots:
            folder = shot.depth.parent
            if folder not in beside:
                path = found_intrinsics(folder)
                beside[folder] = None if path is None else read_intrinsics(path)
            own = given or shot.intrinsics or beside[folder] or found.usual
            if own is None:
                raise InputError(
                    f"{shot.depth}: a depth image needs its camera's intrinsics; give --intrinsics "
                    f"FILE: {FORMS}"
                )
            intrinsics[shot.depth] = own
        return intrinsics

    def _scales(
        self, found: Shots, intrinsics: Mapping[Path, Intrinsics], images: Mapping[Path, NDArray]
    ) -> dict[Path, DepthScale]:
        """Of each image; those for which the same is told have the same."""
        told = {shot.depth: _told(found, shot, intrinsics[shot.depth]) for shot in found.shots}
        scales: dict[tuple[float, str] | None, DepthScale] = {}
        for path, how in told.items():
            if how in scales:
                continue
            alike = [values for other, values in images.items() if told[other] == how]
            try:
                scales[how] = find_scale(alike, self.options.scale, how)
            except ReadError as error:
                first = next((other for other in images if told[other] == how), path)
                raise ReadError(f"{first}: {error}") from error
        return {path: scales[how] for path, how in told.items()}


def _told(found: Shots, shot: Shot, intrinsics: Intrinsics) -> tuple[float, str] | None:
    """The scale that the layout or the intrinsics tell, and which."""
    if shot.per_meter is not None:
        return shot.per_meter, found.title
    if intrinsics.depth_scale is not None:
        return intrinsics.depth_scale, "the intrinsics"
    return None if found.per_meter is None else (found.per_meter, found.title)


def as_named(inputs: Inputs, options: DepthOptions) -> Inputs | DepthImages:
    """What a user names: depth images if they are, or if something is said of such.

    Raises:
        InputError: If a folder is a capture and holds other scans, too.
        ReadError: If a folder cannot be listed.
    """
    try:
        return _as_named(inputs, options)
    except OSError as error:
        raise ReadError(f"{inputs[0]}: cannot be listed ({error.strerror}); check it") from error


def _as_named(inputs: Inputs, options: DepthOptions) -> Inputs | DepthImages:
    images = DepthImages(inputs=inputs, options=options)
    if options != DepthOptions():
        return images
    folder = Path(inputs[0]) if len(inputs) == 1 else None
    if folder is not None and folder.is_dir() and (layout := layout_of(folder)) is not None:
        others = [name for name in other_scans(folder) if name not in layout.scans]
        if others:
            raise InputError(
                f"{folder}: holds depth images ({layout.name}) and other scans, such as "
                f"{others[0]}; name the files of one of them"
            )
        return images
    return images if are_depth_images(inputs) else inputs


def start_poses(files: Sequence[ScanFile]) -> PoseSet | None:
    """The poses that the layout of a capture has, to be tried; None if it has none."""
    frames = [file for file in files if isinstance(file, Frame)]
    poses = {f.name: f.world_from_scan for f in frames if f.world_from_scan is not None}
    return PoseSet(poses=poses, components=(tuple(poses),)) if len(poses) > 1 else None


def collect_named(named: Inputs | DepthImages) -> tuple[ScanFile, ...]:
    """The scans that a user names, see ``collect`` and ``DepthImages.collect``."""
    return named.collect() if isinstance(named, DepthImages) else collect(named)


def _readable(paths: Sequence[Path]) -> dict[Path, NDArray]:
    """The images that can be read, if any can; what is wrong with others is told one by one."""
    images: dict[Path, NDArray] = {}
    first: ReadError | None = None
    for path in paths:
        try:
            images[path] = read_pixels(path)
        except ReadError as error:
            first = first or error
    if first is not None and not images:
        raise first
    return images
