"""Objects that are turned before a depth camera, and how well they are cut out."""

from collections.abc import Callable

from scanweld.evaluation.primitives import box, cylinder, lathe, sphere
from scanweld.evaluation.turntable import joined, moved
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.mesh import TriangleMesh
from tests.bodies import gear, vase, worn
from tests.scenes import small_creature

OBJECTS: dict[str, Callable[[], TriangleMesh]] = {
    **{f"creature {k}": lambda k=k: small_creature(k) for k in range(4)},
    "box": box,
    "flat box": lambda: box(100.0, 70.0, 25.0),
    "cylinder and ball": lambda: joined(
        moved(cylinder(), (0, 0, 0)), moved(sphere(25.0), (45.0, 0, -25.0))
    ),
    "vase with a handle": lambda: joined(
        lathe(vase, 100.0), moved(box(26.0, 9.0, 50.0), (38.0, 0.0, 0.0))
    ),
    "worn gear": lambda: lathe(worn, 60.0),
    "gear and box": lambda: joined(lathe(gear, 30.0), moved(box(20, 30, 70), (20, 0, 20))),
}
SYMMETRIC = lambda: lathe(vase, 100.0)  # noqa: E731


def iou(a: BoolArray, b: BoolArray) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))
