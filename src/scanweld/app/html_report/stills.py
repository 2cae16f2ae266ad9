"""Pictures of the model that need no script."""

import base64
from dataclasses import dataclass, replace

from scanweld.app.html_report.orientation import Orientation
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.shading import png_bytes, render_cutout

PIXELS = 440
"""Longer side of a picture."""
SIDES = (("front", 0.0), ("right", 120.0), ("left", 240.0))
"""What the three sides are called, and how far around the object they are, in degrees."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Still:
    """A picture as a data address, with the words for those who cannot see it."""

    address: str
    alt: str
    width: int
    height: int


def three_sides(mesh: TriangleMesh, orientation: Orientation) -> list[Still]:
    """The model from the reference scan's side, and from a third of a turn to either side."""
    return [
        _still(mesh, orientation.turned(degrees), orientation.up, f"The model from the {name}")
        for name, degrees in SIDES
    ]


def painted_sides(
    mesh: TriangleMesh, colors: ByteArray, orientation: Orientation, what: str
) -> list[Still]:
    """The model in colours (V, 3) that mean something, from the front, behind and below."""
    painted = replace(mesh, colors=colors)
    front, up = orientation.front, orientation.up
    views = (("the front", front, up), ("behind", -front, up), ("below", -up, front))
    return [
        _still(painted, direction, upright, f"{what}, seen from {side}")
        for side, direction, upright in views
    ]


def _still(mesh: TriangleMesh, direction: FloatArray, up: FloatArray, alt: str) -> Still:
    picture = render_cutout(mesh, direction, up, PIXELS)
    address = "data:image/png;base64," + base64.b64encode(png_bytes(picture)).decode("ascii")
    return Still(address=address, alt=alt, width=picture.shape[1], height=picture.shape[0])
