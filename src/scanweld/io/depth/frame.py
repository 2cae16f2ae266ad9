"""A depth image as a scan: its points in metres, its grid, and the camera that stood there."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io.depth.colors import colors_for
from scanweld.io.depth.intrinsics import Intrinsics
from scanweld.io.depth.lens import undistorted, undistorted_colors
from scanweld.io.depth.pixels import read_mask, read_pixels
from scanweld.io.depth.scale import DepthScale

_FAR_OFF = 0.3
"""Distance of a camera's centre from the middle of its image, in widths, that is worth a note."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FrameSettings:
    """How a depth image becomes a scan.

    Attributes:
        intrinsics: Of the camera.
        scale: Of the values.
        max_depth: Metres beyond which all is left out; no limit if None.
        mask: Image of the pixels that are the object; all are if None.
        color: Colour image of the same view; none if None.
        is_color_scaled: Whether the colour image may be of another size.
        told: What else is to be said of it.
    """

    intrinsics: Intrinsics
    scale: DepthScale
    max_depth: float | None = None
    mask: Path | None = None
    color: Path | None = None
    is_color_scaled: bool = False
    told: tuple[str, ...] = ()


def read_frame(path: Path, name: str, settings: FrameSettings) -> RangeScan:
    """A depth image as a scan: points in metres in the frame of its camera, which stood at zero.

    Raises:
        ReadError: If it cannot be read, is of another size than the camera or its mask, or shows
            nothing.
    """
    values = read_pixels(path)
    camera = camera_of(path, settings.intrinsics, (values.shape[0], values.shape[1]))
    depth, notes = settings.scale.depth(values), settings.scale.notes + settings.told
    if max(_off_middle(settings.intrinsics, camera.width, camera.height)) > _FAR_OFF:
        notes += ("the camera's centre is far from the middle: are these its intrinsics?",)
    seen = np.isfinite(depth)
    if not seen.any():
        raise ReadError(f"{path}: no pixel has a depth; leave it out")
    notes += (f"{100 * (1 - seen.mean()):.0f} % of the pixels are without return",)
    whole = depth
    depth, cut = _without_far(path, depth, settings.max_depth)
    notes += cut
    if settings.mask is not None:
        depth, cut = _masked(path, depth, settings.mask)
        notes += cut
    colors = None
    if settings.color is not None:
        shape = (camera.height, camera.width)
        colors, told = colors_for(settings.color, shape, is_scaled=settings.is_color_scaled)
        notes += (told,)
    if lens := settings.intrinsics.distortion:
        depth, whole = undistorted(depth, camera, lens), undistorted(whole, camera, lens)
        colors = None if colors is None else undistorted_colors(colors, camera, lens)
        notes += ("lens distortion undone",)
    scan = scan_of_depth(name, depth, camera, notes)
    if settings.max_depth is not None or settings.mask is not None:
        scan = replace(scan, seen_beyond=np.isfinite(whole) & np.isnan(depth))
    return scan if colors is None else replace(scan, colors=colors[np.isfinite(depth)])


def camera_of(path: Path, intrinsics: Intrinsics, shape: tuple[int, int]) -> Camera:
    """The camera of an image of so many rows and columns, without its lens.

    Raises:
        ReadError: If the intrinsics are those of another size.
    """
    height, width = shape
    size = (intrinsics.width or width, intrinsics.height or height)
    if size != (width, height):
        raise ReadError(
            f"{path}: has {width} x {height} pixels, the intrinsics are for {size[0]} x {size[1]}; "
            "give those of the depth images"
        )
    if max(_off_middle(intrinsics, width, height)) > 1:
        raise ReadError(
            f"{path}: has {width} x {height} pixels, but the intrinsics' centre is at "
            f"{intrinsics.cx:g}, {intrinsics.cy:g}; give those of the depth images"
        )
    return Camera(
        model=CameraModel.PINHOLE,
        width=width,
        height=height,
        fx=intrinsics.fx,
        fy=intrinsics.fy,
        cx=intrinsics.cx,
        cy=intrinsics.cy,
    )


def _off_middle(intrinsics: Intrinsics, width: int, height: int) -> tuple[float, float]:
    """How far the centre is from the middle of the image, in widths and heights."""
    return abs(intrinsics.cx / width - 0.5), abs(intrinsics.cy / height - 0.5)


def read_mask_of(path: Path, mask: Path, shape: tuple[int, ...]) -> BoolArray:
    """Which pixels of an image of a shape (H, W) its mask keeps.

    Raises:
        ReadError: If it cannot be read, or is of another size.
    """
    is_object = read_mask(mask)
    if is_object.shape != shape:
        raise ReadError(
            f"{mask}: has {is_object.shape[1]} x {is_object.shape[0]} pixels, {path.name} "
            f"{shape[1]} x {shape[0]}; give masks of the depth images"
        )
    return is_object


def _without_far(
    path: Path, depth: FloatArray, max_depth: float | None
) -> tuple[FloatArray, tuple[str, ...]]:
    if max_depth is None:
        return depth, ()
    nearest = float(np.nanmin(depth))
    if nearest > max_depth:
        raise ReadError(
            f"{path}: all depths lie beyond --depth-max {max_depth:g} m, the nearest at "
            f"{nearest:.3g} m; raise it, or check --depth-scale"
        )
    with np.errstate(invalid="ignore"):
        far = depth > max_depth
    told = f"{int(far.sum())} points beyond --depth-max {max_depth:g} m cut off"
    return np.where(far, np.nan, depth), (told,)


def _masked(path: Path, depth: FloatArray, mask: Path) -> tuple[FloatArray, tuple[str, ...]]:
    is_object = read_mask_of(path, mask, depth.shape)
    seen = np.isfinite(depth)
    if not (seen & is_object).any():
        raise ReadError(f"{path}: its mask {mask.name} has no pixel with a depth; leave it out")
    kept = (seen & is_object).sum() / seen.sum()
    return np.where(is_object, depth, np.nan), (f"cut to its mask: {100 * kept:.0f} % of it kept",)


def scan_of_depth(
    name: str, depth: FloatArray, camera: Camera, notes: tuple[str, ...] = ()
) -> RangeScan:
    """A depth image (H, W), NaN where nothing was seen, as a scan in its camera's frame."""
    has = np.isfinite(depth)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[has] = np.arange(has.sum())
    return RangeScan(
        name=name,
        points=camera.unproject_image(depth)[has],
        grid=grid,
        camera=camera,
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
        notes=notes,
    )
