"""What was read from a scan file, and what had to be assumed."""

from scanweld.geometry.camera import Camera
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.preparation.resolution import point_spacing
from scanweld.preparation.sensor import locate_sensor


def describe_scan(scan: RangeScan) -> str:
    """A paragraph on a scan: its points, grid, camera, viewpoint, resolution, diameter and notes.

    Args:
        scan: As it was read.

    Raises:
        InputError: If the scan is too small to have a viewpoint.
    """
    located = locate_sensor(scan)
    rows = {
        "points": f"{len(scan.points):,} ({scan.num_dropped:,} dropped)",
        "grid": _grid(scan),
        "camera": _camera(located.camera),
        "viewpoint": located.viewpoint.value,
        "resolution": f"{point_spacing(scan.points):.4g}",
        "diameter": f"{principal_diameter(scan.points):.4g}",
    }
    lines = [scan.name, *(f"  {key:<11}{value}" for key, value in rows.items())]
    return "\n".join([*lines, *(f"  {'note':<11}{note}" for note in located.notes)])


def _grid(scan: RangeScan) -> str:
    if scan.grid is None:
        return f"none, a mesh of {len(scan.faces):,} faces" if scan.faces is not None else "none"
    rows, columns = scan.grid.shape
    return f"{rows} rows x {columns} columns"


def _camera(camera: Camera | None) -> str:
    if camera is None:
        return "none"
    size = f"{camera.width} x {camera.height} pixels"
    return f"{camera.model.name.lower()}, {size}, focal length {camera.fx:.4g} x {camera.fy:.4g}"
