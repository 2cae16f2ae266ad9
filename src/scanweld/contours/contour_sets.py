"""Contour points of range images: the near and the far side of depth jumps (paper eqs 2, 3)."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from scanweld.compiled.kernels import njit
from scanweld.config import ContoursConfig
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.mesh import border_vertices
from scanweld.geometry.prepared import PixelKind, PreparedScan


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ContourPoints:
    """Pixels on contours, with the surface there; all in the frame of the camera that sees them.

    Attributes:
        pixels: (N, 2) integer (u, v).
        points: (N, 3).
        normals: (N, 3) unit normals of the surface, towards the sensor that measured it.
    """

    pixels: IntArray
    points: FloatArray
    normals: FloatArray

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, kept: BoolArray | IntArray) -> "ContourPoints":
        return ContourPoints(
            pixels=self.pixels[kept], points=self.points[kept], normals=self.normals[kept]
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ObservedContours:
    """What a scan brings to contour coherence, whatever it is compared with.

    Attributes:
        scan: The scan.
        jump: Depth step that makes a contour, tau_1 = tau_2, as a length.
        contour: The visible contour C_i (eq. 2).
        is_border: (V,) mesh vertices on C_i, on O_i (eq. 3) or on the open border of the mesh.
        jumps: (N, 3) points of C_i and O_i.
    """

    scan: PreparedScan
    jump: float
    contour: ContourPoints
    is_border: BoolArray
    jumps: FloatArray


def observe_contours(scan: PreparedScan, config: ContoursConfig) -> ObservedContours:
    """Contours of a scan. Free pixels are background, infinitely far; unknown ones say nothing."""
    image, jump = scan.image, config.jump_pixels * scan.image.pixel
    near = near_side(image.depth, image.kind == PixelKind.FREE, jump)
    far = far_side(image.depth, jump)
    rows, columns = np.nonzero(near)
    points = image.points()
    contour = ContourPoints(
        pixels=np.stack([columns, rows], axis=1),
        points=points[near],
        normals=image.normals[near],
    )
    on_jump = (near | far)[np.isfinite(image.depth)]
    return ObservedContours(
        scan=scan,
        jump=jump,
        contour=contour,
        is_border=on_jump | border_vertices(scan.mesh.faces, len(scan.mesh.vertices)),
        jumps=points[near | far],
    )


def near_side(depth: FloatArray, is_background: BoolArray, jump: float) -> BoolArray:
    """Pixels of C (eq. 2): one of 8 neighbours lies farther by more than jump, or is background.

    Args:
        depth: (H, W), NaN where there is no surface.
        is_background: (H, W) pixels without surface that are known to be infinitely far.
        jump: tau_1, in the unit of depth.
    """
    return _near_side(np.array(depth), np.array(is_background), jump)


@njit(cache=True, nogil=True)
def _near_side(
    depth: FloatArray, is_background: BoolArray, jump: float
) -> BoolArray:  # pragma: no cover - compiled
    height, width = depth.shape
    found = np.zeros((height, width), np.bool_)
    for v in range(height):
        for u in range(width):
            if not np.isfinite(depth[v, u]):
                continue
            for y in range(max(v - 1, 0), min(v + 2, height)):
                for x in range(max(u - 1, 0), min(u + 2, width)):
                    is_farther = np.isfinite(depth[y, x]) and depth[y, x] - depth[v, u] > jump
                    if is_background[y, x] or is_farther:
                        found[v, u] = True
    return found


def far_side(depth: FloatArray, jump: float) -> BoolArray:
    """Pixels of O (eq. 3): a neighbour among 8 lies nearer by more than the jump."""
    reach = np.where(np.isfinite(depth), depth, np.inf)
    nearest = ndimage.minimum_filter(reach, size=3, mode="constant", cval=np.inf)
    with np.errstate(invalid="ignore"):
        return np.isfinite(depth) & (depth - nearest > jump)
