"""Sets of depth images: which files they are, and what was laid beside them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from numpy.typing import NDArray

from scanweld.errors import InputError, ReadError
from scanweld.geometry.scan import RangeScan
from scanweld.io.collect import ScanFile, collect
from scanweld.io.depth.frame import FrameSettings, camera_of, read_frame, read_mask_of
from scanweld.io.depth.images import (
    are_depth_images,
    depth_images,
    found_intrinsics,
    image_names,
    masks_of,
)
from scanweld.io.depth.intrinsics import FORMS, Intrinsics, read_intrinsics
from scanweld.io.depth.pixels import read_pixels
from scanweld.io.depth.scale import find_scale
from scanweld.io.names import printable

_TUM_FILES = ("depth.txt", "rgb.txt")
_MOST_LOOKED_AT = 20
"""Images, evenly spread over a set, from which its scale is found."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthOptions:
    """What users say of depth images.

    Attributes:
        intrinsics: A file; None to look for one beside the images.
        scale: Depth values in a metre; None to find it out.
        max_depth: Metres beyond which all is left out.
        masks: Folder of masks.
    """

    intrinsics: Path | None = None
    scale: float | None = None
    max_depth: float | None = None
    masks: Path | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame(ScanFile):
    """A depth image to be read as a scan."""

    settings: FrameSettings

    def read(self) -> RangeScan:
        """Read the scan.

        Raises:
            ReadError: If it cannot be read.
        """
        return read_frame(self.path, self.name, self.settings)


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
            InputError: If there are no images, intrinsics, or masks for all.
        """
        paths = depth_images(self.inputs)
        told, intrinsics = self._intrinsics(paths)
        masks = {} if self.options.masks is None else masks_of(paths, self.options.masks)
        looked_at = _readable(paths[:: -(-len(paths) // _MOST_LOOKED_AT)])
        for path, values in looked_at.items():
            camera_of(path, intrinsics, (values.shape[0], values.shape[1]))
            if path in masks:
                read_mask_of(path, masks[path], values.shape)
        try:
            scale = find_scale(list(looked_at.values()), self.options.scale, told)
        except ReadError as error:
            raise ReadError(f"{next(iter(looked_at))}: {error}") from error
        settings = FrameSettings(
            intrinsics=intrinsics, scale=scale, max_depth=self.options.max_depth
        )
        return tuple(
            Frame(
                path=path,
                name=printable(name),
                settings=replace(settings, mask=masks.get(path)),
            )
            for path, name in zip(paths, image_names(paths), strict=True)
        )

    def _intrinsics(self, paths: Sequence[Path]) -> tuple[tuple[float, str] | None, Intrinsics]:
        """The intrinsics, and the scale that they or the layout tell, with who says so."""
        path = self.options.intrinsics or found_intrinsics(paths[0].parent)
        if path is None:
            raise InputError(
                f"{paths[0]}: a depth image needs its camera's intrinsics; give --intrinsics FILE: "
                f"{FORMS}"
            )
        intrinsics = read_intrinsics(path)
        if intrinsics.depth_scale is not None:
            return (intrinsics.depth_scale, path.name), intrinsics
        if path.name == "cam.info.txt":
            return (10_000.0, "the layout of the APC vision toolbox"), intrinsics
        above = paths[0].parent.parent
        if all((above / name).is_file() for name in _TUM_FILES):
            return (5000.0, "TUM's layout"), intrinsics
        return None, intrinsics


def as_named(inputs: Inputs, options: DepthOptions) -> Inputs | DepthImages:
    """What a user names: depth images if they are, or if something is said of such."""
    if options != DepthOptions() or are_depth_images(inputs):
        return DepthImages(inputs=inputs, options=options)
    return inputs


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
