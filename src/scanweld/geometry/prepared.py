"""Records of a prepared scan: a range image that knows what its sensor saw, and samples on it."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, frozen
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan

MIN_COSINE = 0.1
"""Cosine of incidence below which a sensor measures too poorly for its pixels to count."""


class PixelKind(IntEnum):
    """What a pixel's ray says: it hit a surface, went past the object, or nothing is known."""

    SURFACE = 0
    FREE = 1
    UNKNOWN = 2


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RangeImage:
    """A range image in its sensor frame (x right, y down, z away).

    Attributes:
        camera: Pinhole or orthographic; its pixels are those of the arrays.
        depth: (H, W), NaN where there is no surface.
        normals: (H, W, 3) unit, towards the sensor; NaN where there is no surface.
        kind: (H, W) PixelKind as uint8.
        outside: (H, W) distance of a free pixel from the closed silhouette, as a length on the
            object; 0 inside the silhouette. To this belongs what is beside it where nothing came
            back, if the sensor saw what lies behind elsewhere.
        is_rim: (H, W) surface pixels at a depth jump, a hole or the silhouette, and next to them.
        is_reliable: (H, W) surface pixels off the rim and not seen at grazing incidence: where a
            normal can be trusted.
        pixel: Footprint of a pixel on the object, in the scans' unit.
        jump_pixels: Depth step between neighbouring pixels, in footprints, above which they are on
            different surfaces.
    """

    camera: Camera
    depth: FloatArray
    normals: FloatArray
    kind: ByteArray
    outside: FloatArray
    is_rim: BoolArray
    is_reliable: BoolArray
    pixel: float
    jump_pixels: float

    def __post_init__(self) -> None:
        shape = (self.camera.height, self.camera.width)
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("depth", frozen(self.depth, np.float64, shape))
        put("normals", frozen(self.normals, np.float64, (*shape, 3)))
        put("kind", frozen(self.kind, np.uint8, shape))
        put("outside", frozen(self.outside, np.float64, shape))
        put("is_rim", frozen(self.is_rim, np.bool_, shape))
        put("is_reliable", frozen(self.is_reliable, np.bool_, shape))

    def points(self) -> FloatArray:
        """(H, W, 3) points in the sensor frame, NaN where there is no surface."""
        return self.camera.unproject_image(self.depth)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Samples:
    """Oriented points of a scan, spread evenly by area, away from rims and grazing incidence.

    They come in farthest-point order: any prefix is evenly spread too.

    Attributes:
        points: (N, 3), sensor frame.
        normals: (N, 3) unit, towards the sensor.
    """

    points: FloatArray
    normals: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, np.float64, (None, 3)))
        object.__setattr__(self, "normals", frozen(self.normals, np.float64, (len(self.points), 3)))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PreparedScan:
    """A scan made ready for registration. Everything but ``scan`` is in the sensor frame.

    Attributes:
        scan: The scan, with its sensor known, fitted or estimated.
        image: The scan as a range image at the working resolution.
        mesh: The surface between the image's pixels, cut at depth jumps; vertices are the surface
            pixels in row-major order (those without a face included), normals are smoothed.
        samples: Oriented points, evenly spread.
        resolution: Median spacing of neighbouring points of the scan.
        diameter: Diagonal of the scan's box along its principal axes, strays removed.
        content_hash: Of the scan; orders scans and pairs, whatever their files are called.
        is_without_support: Whether the plane that the object stands on was left out.
    """

    scan: RangeScan
    image: RangeImage
    mesh: TriangleMesh
    samples: Samples
    resolution: float
    diameter: float
    content_hash: str
    is_without_support: bool = False

    @property
    def scan_from_sensor(self) -> Pose:
        """Where the sensor stood: given, fitted or estimated."""
        return self.scan.sensor_pose

    @property
    def work_hash(self) -> str:
        """Hash of the scan and of whether its support was left out: the key of cached work."""
        return f"{self.content_hash}{' without support' * self.is_without_support}"

    @property
    def name(self) -> str:
        """The scan's name."""
        return self.scan.name
