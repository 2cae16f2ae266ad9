"""The scans that a model was made of, where they are at hand: what the files alone cannot tell."""

from collections.abc import Mapping

import numpy as np

from scanweld.app.model_folder import ModelFolder
from scanweld.config import PrepareConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.io import natural_key
from scanweld.preparation import prepare
from scanweld.preparation.sensor import locate_sensor


class Sources:
    """The placed scans of a model folder; each is prepared when asked for, and once.

    Args:
        model: The folder.
        scans: The scans by name; more than those that are placed does no harm.
        config: How scans are prepared.
    """

    def __init__(
        self, model: ModelFolder, scans: Mapping[str, RangeScan], config: PrepareConfig
    ) -> None:
        self._poses = model.poses
        self._entries = model.report.scans
        self._fused = model.fused_scans
        self._config = config
        self._scans = {name: model.cut(scan) for name, scan in scans.items()}
        self._prepared = {} if model.result is None else dict(model.result.prepared)

    def points_of_model(self) -> dict[str, FloatArray]:
        """Points (N, 3) of each scan that the model was made of, in its frame."""
        names = sorted(self._fused, key=natural_key)
        return {name: self.world_from_scan(name).apply(self._points(name)) for name in names}

    def world_from_scan(self, name: str) -> Pose:
        """The pose of a placed scan, in the frame of its component."""
        return self._poses.poses[name]

    def world_from_reference_sensor(self) -> Pose:
        """Where the sensor of the largest component's reference scan stood."""
        name = self._poses.components[0][0]
        scan = self._prepared[name].scan if name in self._prepared else self._scans[name]
        return self.world_from_scan(name) @ locate_sensor(scan).sensor_pose

    def prepared(self, name: str) -> PreparedScan:
        """A scan as the run prepared it."""
        if name not in self._prepared:
            without_support = self._entries[name].is_without_support
            self._prepared[name] = prepare(
                self._scans[name], self._config, without_support=without_support
            )
        return self._prepared[name]

    def _points(self, name: str) -> FloatArray:
        """Points (N, 3) of a scan in its frame, without the support where that was left out."""
        if not self._entries[name].is_without_support:
            return self._scans[name].points
        scan = self.prepared(name)
        return scan.scan_from_sensor.apply(scan.image.points()[np.isfinite(scan.image.depth)])
