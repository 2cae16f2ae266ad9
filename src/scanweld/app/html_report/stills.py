"""Pictures of the model that need no script."""

import base64
from dataclasses import dataclass, replace

from scanweld.app.html_report.orientation import Orientation
from scanweld.geometry.arrays import ByteArray
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
        _still(mesh, orientation, degrees, f"The model, shaded, from the {name}")
        for name, degrees in SIDES
    ]


def both_sides(
    mesh: TriangleMesh, colors: ByteArray, orientation: Orientation, what: str
) -> list[Still]:
    """The model in colours (V, 3) that mean something, from the front and from behind."""
    painted = replace(mesh, colors=colors)
    return [
        _still(painted, orientation, degrees, f"{what}, seen from {side}")
        for side, degrees in (("the front", 0.0), ("behind", 180.0))
    ]


def _still(mesh: TriangleMesh, orientation: Orientation, degrees: float, alt: str) -> Still:
    picture = render_cutout(mesh, orientation.turned(degrees), orientation.up, PIXELS)
    address = "data:image/png;base64," + base64.b64encode(png_bytes(picture)).decode("ascii")
    return Still(address=address, alt=alt, width=picture.shape[1], height=picture.shape[0])
