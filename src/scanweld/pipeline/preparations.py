"""What preparing a scan finds, without the scan itself: it is kept, and travels, at a third."""

from dataclasses import dataclass, replace

import numpy as np

from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.geometry.arrays import IndexArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan, RangeImage, Samples
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.preparation import prepare


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Preparation:
    """A prepared scan but for what its scan has already.

    Attributes:
        camera: Of the scan, as given or fitted.
        scan_from_sensor: Where the sensor stood,
        viewpoint: and how that is known.
        grid: The scan's grid, if it had to be turned round; None where it stays what it is.
        notes: What was assumed, besides the notes of the scan.
        image: See ``PreparedScan``, as for all that follows.
        mesh: The surface between the image's pixels.
        samples: Oriented points, evenly spread.
        resolution: Median spacing of neighbouring points.
        diameter: Of the scan.
        is_without_support: Whether the plane that the object stands on was left out.
    """

    camera: Camera | None
    scan_from_sensor: Pose
    viewpoint: Viewpoint
    grid: IndexArray | None
    notes: tuple[str, ...]
    image: RangeImage
    mesh: TriangleMesh
    samples: Samples
    resolution: float
    diameter: float
    is_without_support: bool

    def of(self, scan: RangeScan, content_hash: str) -> PreparedScan:
        """The prepared scan, of the scan that this was found from, or one of the same content."""
        located = replace(
            scan,
            camera=self.camera,
            scan_from_sensor=self.scan_from_sensor,
            viewpoint=self.viewpoint,
            grid=scan.grid if self.grid is None else self.grid,
            notes=(*scan.notes, *self.notes),
        )
        return PreparedScan(
            scan=located,
            image=self.image,
            mesh=self.mesh,
            samples=self.samples,
            resolution=self.resolution,
            diameter=self.diameter,
            content_hash=content_hash,
            is_without_support=self.is_without_support,
        )


def try_prepare(
    scan: RangeScan, config: PrepareConfig, *, without_support: bool = False
) -> Preparation | str:
    """Prepare a scan, or say why it cannot take part.

    Args:
        scan: Any scan.
        config: Settings.
        without_support: Whether the plane that the object stands on, if any, is left out.
    """
    try:
        found = prepare(scan, config, without_support=without_support)
    except InputError as error:
        return str(error).removeprefix(f"{scan.name}: ")
    located = found.scan
    return Preparation(
        camera=located.camera,
        scan_from_sensor=found.scan_from_sensor,
        viewpoint=located.viewpoint,
        grid=None if _are_same(located.grid, scan.grid) else located.grid,
        notes=located.notes[len(scan.notes) :],
        image=found.image,
        mesh=found.mesh,
        samples=found.samples,
        resolution=found.resolution,
        diameter=found.diameter,
        is_without_support=found.is_without_support,
    )


def _are_same(a: IndexArray | None, b: IndexArray | None) -> bool:
    return a is b or (a is not None and b is not None and np.array_equal(a, b))
