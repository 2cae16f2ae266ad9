"""Prepared scans with exact truth, rendered once and shared by the tests of later stages."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from scanweld.config import PairsConfig, PrepareConfig
from scanweld.evidence.evidence import PatchLimits
from scanweld.evidence.field import ScanField, make_field
from scanweld.evidence.judge import Judge
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.pairs.problem import PairProblem
from scanweld.preparation import prepare
from scanweld.sensor.learn import learn_sensor
from scanweld.sensor.model import SensorModel
from tests.scenes import Scene, pair_at_gap


@dataclass(frozen=True, kw_only=True)
class PreparedPair:
    """Two scans ready for registration, and the true pose between their sensors."""

    scans: tuple[PreparedScan, PreparedScan]
    fields: tuple[ScanField, ScanField]
    i_from_j: Pose
    diameter: float

    def sensor(self) -> SensorModel:
        """What the pair says of its sensor: too little, so that usual values are used."""
        tolerance = PairsConfig().fine_tolerance_diameters * self.diameter
        limit = PairsConfig().max_contradiction
        return learn_sensor({}, self.fields, self.diameter, tolerance, limit)

    def problem(self, config: PairsConfig | None = None) -> PairProblem:
        """The pair as the search is asked."""
        i, j = self.fields
        config = config or PairsConfig()
        return PairProblem(edge=(0, 1), i=i, j=j, config=config)

    def judge(self) -> Judge:
        """The two scans as later stages ask them."""
        tolerance = PairsConfig().fine_tolerance_diameters * self.diameter
        return Judge(
            fields=self.fields,
            diameter=self.diameter,
            tolerance=tolerance,
            limits=PatchLimits(contradiction=PairsConfig().max_contradiction),
        )

    def off_by(self, i_from_j: Pose) -> tuple[float, float]:
        """Error of a pose: degrees, and shift of j's centre in diameters."""
        off = self.i_from_j.inverse() @ i_from_j
        return off.angle_deg(), off.shift_at(self.fields[1].centre) / self.diameter


def prepared_pair(i: RangeScan, j: RangeScan, true_i_from_j: Pose) -> PreparedPair:
    """Prepare two scans; the true pose is between the frames of the scans."""
    a, b = (prepare(scan, PrepareConfig()) for scan in (i, j))
    diameter = float(np.median([a.diameter, b.diameter]))
    return PreparedPair(
        scans=(a, b),
        fields=(make_field(a), make_field(b)),
        i_from_j=a.scan_from_sensor.inverse() @ true_i_from_j @ b.scan_from_sensor,
        diameter=diameter,
    )


@lru_cache
def creature_pair(
    gap_deg: float, model: CameraModel = CameraModel.PINHOLE, factor: float = 1.0
) -> PreparedPair:
    """The creature from two sides, each scan in its own random frame, all lengths multiplied."""
    i, j, i_from_j = pair_at_gap(gap_deg, pixels=160.0, model=model, seed=int(gap_deg))
    stretched = Pose(rotation=i_from_j.rotation, translation=factor * i_from_j.translation)
    return prepared_pair(scaled(i, factor), scaled(j, factor), stretched)


def pair_of_scene(scene: Scene, i: int, j: int) -> PreparedPair:
    """Two scans of a scene."""
    return prepared_pair(scene.scans[i], scene.scans[j], scene.i_from_j(i, j))


def scaled(scan: RangeScan, factor: float) -> RangeScan:
    """The same scan with all lengths multiplied: another unit."""
    camera, sensor = scan.camera, scan.scan_from_sensor
    if camera is not None and camera.model is CameraModel.ORTHOGRAPHIC:
        camera = replace(camera, fx=camera.fx / factor, fy=camera.fy / factor)
    if sensor is not None:
        sensor = Pose(rotation=sensor.rotation, translation=factor * sensor.translation)
    return replace(scan, points=factor * scan.points, camera=camera, scan_from_sensor=sensor)


def moved(scan: RangeScan, motion: Pose) -> RangeScan:
    """The same scan in other coordinates: motion is new_from_old."""
    sensor = scan.scan_from_sensor
    return replace(
        scan,
        points=motion.apply(scan.points),
        scan_from_sensor=None if sensor is None else motion @ sensor,
    )
