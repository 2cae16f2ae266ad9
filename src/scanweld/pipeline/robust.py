"""The robust method: from any start, every pair judged."""

from collections.abc import Sequence

from scanweld.config import Config, RefineConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.evidence.judge import Poses
from scanweld.graph.partners import partners
from scanweld.graph.refine_graph import Refined
from scanweld.graph.view_graph import Edge
from scanweld.pairs.registrar import PairRegistrar
from scanweld.pipeline.method import Method, Scene
from scanweld.refinement.refine import refine_poses, refined_poses, scan_rms
from scanweld.sensor.model import SensorModel

NUM_SETTLING_ROUNDS = 3
"""Rounds of refinement of a component that grows, so that chains of pairs do not drift."""


def robust_method(scene: Scene, config: Config, workers: int) -> Method:
    """The robust method for the scans of a run, by some threads."""
    scans = scene.intake.prepared
    contours = contour_matcher(scans, config.contours)
    registrar = PairRegistrar(config=config)
    settling = config.refine.model_copy(update={"num_rounds": NUM_SETTLING_ROUNDS})

    def settle(sensor: SensorModel | None, poses: Poses) -> Poses:
        compared = partners(poses, scene.judge, workers)
        settings = _reaching(settling, sensor)
        return refined_poses(scans, poses, compared, settings, workers=workers)

    def refine(
        sensor: SensorModel, poses: Poses, accepted: Sequence[Edge], compared: Sequence[Edge]
    ) -> Refined:
        del accepted
        settings = _reaching(config.refine, sensor)
        refined = refine_poses(scans, poses, compared, settings, contours, workers)
        return refined.poses, scan_rms(refined)

    return Method(
        name="robust",
        settings=(config.prepare, config.heat, config.pairs, config.contours, config.refine),
        register=registrar.register,
        contours=contours,
        settle=settle,
        refine=refine,
        needs_features=config.pairs.keypoints != "even",
        shortcuts=registrar,
    )


def _reaching(config: RefineConfig, sensor: SensorModel | None) -> RefineConfig:
    """Settings by which surfaces are matched as far apart as the sensor leaves them."""
    if sensor is None:
        return config
    first, last = config.match_diameters
    reach = sensor.reach / sensor.diameter
    return config.model_copy(update={"match_diameters": (max(first, reach), max(last, reach))})
