"""How exact the poses of a component are, from information and the sensor's errors.

A sensor's noise averages out over a surface, its bent depth does not: neighbouring points are off
together. So the points of a patch tell no more than the patch: its mean has the correlated error,
and what is left of the noise. The information of all patches of a pair (J^T J over the variance)
holds it no more firmly than it suits the other pairs; all pairs together make the covariance of all
poses at once, beside the component as a whole.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.buckets import cells_of
from scanweld.geometry.gauss_newton import jacobian, lever_arm
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.refinement.refine import SURFACE_NOISE_DIAMETERS, match_surfaces
from scanweld.refinement.surface_terms import SurfaceSource
from scanweld.sensor.learn import PATCH_DIAMETERS
from scanweld.sensor.model import SensorModel
from scanweld.sensor.network import PairNetwork, PairTie


def pose_deviations(
    sources: Mapping[int, SurfaceSource],
    world_from_sensor: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    sensor: SensorModel,
    workers: int = 1,
) -> dict[int, PoseTolerance]:
    """Standard deviations of the pose of each scan of a component, over all directions.

    Errors are meant beside the component as a whole: its own place is not known, nor needed.

    Args:
        sources: Surfaces of the scans, by index.
        world_from_sensor: Poses of the component's scans.
        pairs: Scans that are compared, (i, j) in any order.
        sensor: What is known of the sensor.
        workers: Threads.
    """
    diameter = sensor.diameter
    order = sorted(world_from_sensor)
    radius = max(sensor.reach, 0.006 * diameter)
    found = match_surfaces(sources, world_from_sensor, pairs, radius, workers)
    middles = {k: world_from_sensor[k].apply(_middle(sources[k])) for k in order}
    network = PairNetwork(
        ties=_ties(found, world_from_sensor, middles, sensor),
        free=_without_common_motion(order, middles, lever_arm(diameter)),
        diameter=diameter,
    )
    apart = float(np.hypot(sensor.white, sensor.correlated))
    covariance = network.covariance(network.pair_error(apart))
    arm = lever_arm(diameter)
    deviations = {}
    for n, k in enumerate(order):
        block = covariance[6 * n : 6 * n + 6, 6 * n : 6 * n + 6]
        turn = float(np.sqrt(np.trace(block[:3, :3]))) / arm
        shift = float(np.sqrt(np.trace(block[3:, 3:])))
        deviations[k] = PoseTolerance(angle_deg=float(np.degrees(turn)), shift=shift)
    return deviations


def _middle(source: SurfaceSource) -> FloatArray:
    """Mean of a scan's points (3,); where it has none that can be matched, its sensor's place."""
    return source.points.mean(axis=0) if len(source.points) else np.zeros(3)


def _ties(
    found: Sequence[tuple[int, int, Matches]],
    poses: Mapping[int, Pose],
    middles: Mapping[int, FloatArray],
    sensor: SensorModel,
) -> list[PairTie]:
    """What the matches of each pair say of it, about a centre between its scans."""
    place = {k: n for n, k in enumerate(sorted(poses))}
    arm = lever_arm(sensor.diameter)
    ties = []
    for (i, j), ways in _by_pair(found).items():
        between = 0.5 * (middles[i] + middles[j])
        information, gradient = _normal_equations((i, j), ways, poses, between, sensor)
        firmness, directions = np.linalg.eigh(information)
        ties.append(
            PairTie(
                a=place[i],
                b=place[j],
                firmness=np.maximum(firmness, 0.0),
                directions=directions,
                pull=directions.T @ gradient,
                by_a=carried_twist(middles[i] - between, arm),
                by_b=carried_twist(middles[j] - between, arm),
            )
        )
    return ties


def _by_pair(
    found: Sequence[tuple[int, int, Matches]],
) -> dict[tuple[int, int], list[tuple[int, Matches]]]:
    """Matches of both ways of each pair (i, j), i < j, each with the scan that it is matched to."""
    pairs: dict[tuple[int, int], list[tuple[int, Matches]]] = {}
    for i, j, matches in found:
        pairs.setdefault((min(i, j), max(i, j)), []).append((j, matches))
    return dict(sorted(pairs.items()))


def _normal_equations(
    edge: tuple[int, int],
    ways: Sequence[tuple[int, Matches]],
    poses: Mapping[int, Pose],
    centre: FloatArray,
    sensor: SensorModel,
) -> tuple[FloatArray, FloatArray]:
    """Information (6, 6) and gradient (6,) of the twist of a pair's first scan about a centre."""
    information, gradient = np.zeros((6, 6)), np.zeros(6)
    for target, matches in ways:
        points = poses[target].apply(matches.points)
        directions = poses[target].turn(matches.directions)
        weights = match_weights(matches.points, sensor)
        moves = jacobian(points, directions, centre, lever_arm(sensor.diameter))
        if target == edge[0]:
            moves = -moves  # the points are those of the second scan
        information += (weights[:, None] * moves).T @ moves
        gradient += moves.T @ (weights * matches.residuals)
    return information, gradient


def carried_twist(away: FloatArray, arm: float) -> FloatArray:
    """(6, 6) from the twist of a scan about its middle, (3,) from a centre, to that about this."""
    carried = np.eye(6)
    carried[3:, :3] = _cross(away) / arm
    return carried


def match_weights(points: FloatArray, sensor: SensorModel) -> FloatArray:
    """One over the variance (N,) of matches; those of a patch together weigh as the patch does.

    Matches come from both sides of a pair and say the same twice: each counts half. No sensor is
    so exact that its surfaces, which are facets, are more so.

    Args:
        points: (N, 3) in the frame of a sensor: where the world is does not matter.
        sensor: What is known of the sensor.
    """
    cell, count = cells_of(points, PATCH_DIAMETERS * sensor.diameter)
    shared = count[cell] * sensor.correlated**2
    least = (SURFACE_NOISE_DIAMETERS * sensor.diameter) ** 2
    return 0.5 / np.maximum(sensor.white**2 + shared, least)


def _without_common_motion(
    order: Sequence[int], middles: Mapping[int, FloatArray], arm: float
) -> FloatArray:
    """Orthonormal basis (6 N, 6 N - 6) of twists that do not move the component as a whole."""
    centre = np.mean([middles[k] for k in order], axis=0)
    common = np.vstack([carried_twist(centre - middles[k], arm) for k in order])
    basis, _, _ = np.linalg.svd(common, full_matrices=True)
    return basis[:, 6:]


def _cross(vector: FloatArray) -> FloatArray:
    """The matrix (3, 3) of a cross product from the left."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
