"""Scores of many hypotheses, by a few samples of each scan in the other's coarse range image."""

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.visibility import AGREE_COSINE, CONTRADICT_COSINE
from scanweld.geometry.arrays import FloatArray

Single = NDArray[np.float32]

MIN_SWEPT_AGREE = 0.05
"""Share of samples that must agree: else poses that touch nothing, and so violate nothing, crowd
out those near the right one, where a thin object violates more than it agrees."""


@njit(cache=True, nogil=True, error_model="numpy")
def _hear(
    cells: Single,
    camera: Single,
    turns: Single,
    places: Single,
    points: Single,
    normals: Single,
    at: tuple[int, int, int],
    samples: tuple[int, int],
    weights: Single,
    tolerance: np.float32,
    seen: Single,
) -> tuple[np.float32, int]:
    """What a sensor says of some oriented points turned and shifted into its frame.

    Many at a time, first where they lie and then what is there, and without branches: which way
    they would go cannot be foreseen, and that would cost more than all the rest.

    Args:
        cells: (H, W, 4) what the sensor saw, see ``_coarse_image``.
        camera: (5,) its camera.
        turns: (K, T, 3, 3) rotations of the anchors there.
        places: (K, 3) these anchors.
        points: (L, 3, S) samples in the frames of the anchors here,
        normals: and their normals.
        at: Indices of the anchor there, of the turn, and of the anchor here.
        samples: The first sample, and the one after the last.
        weights: (5,) of agree, front, contradict, free and nothing.
        tolerance: Of depth.
        seen: (7, S) is written over.

    Returns:
        Sum of the weights, and how many samples agree.
    """
    there, turn, here = at
    first, end = samples
    nothing, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    agree_cosine, contradict_cosine = np.float32(AGREE_COSINE), np.float32(CONTRADICT_COSINE)
    right, bottom = np.float32(cells.shape[1] - 1), np.float32(cells.shape[0] - 1)
    is_pinhole = camera[0] == nothing
    fx, fy, cx, cy = camera[1], camera[2], camera[3], camera[4]
    x_x, x_y, x_z = turns[there, turn, 0, 0], turns[there, turn, 0, 1], turns[there, turn, 0, 2]
    y_x, y_y, y_z = turns[there, turn, 1, 0], turns[there, turn, 1, 1], turns[there, turn, 1, 2]
    z_x, z_y, z_z = turns[there, turn, 2, 0], turns[there, turn, 2, 1], turns[there, turn, 2, 2]
    place_x, place_y, place_z = places[there, 0], places[there, 1], places[there, 2]
    for s in range(first, end):
        px, py, pz = points[here, 0, s], points[here, 1, s], points[here, 2, s]
        x = x_x * px + x_y * py + x_z * pz + place_x
        y = y_x * px + y_y * py + y_z * pz + place_y
        z = z_x * px + z_y * py + z_z * pz + place_z
        scale = one
        if is_pinhole:
            scale = z if z > nothing else one
        u, v = fx * x / scale + cx, fy * y / scale + cy
        # Beyond the image its border speaks: it is free, unless the object left the field of view.
        inside_u, inside_v = min(max(u, nothing), right), min(max(v, nothing), bottom)
        seen[0, s], seen[1, s], seen[2, s] = inside_v + half, inside_u + half, z
        seen[3, s] = (abs(u - inside_u) / fx + abs(v - inside_v) / fy) * scale
        nx, ny, nz = normals[here, 0, s], normals[here, 1, s], normals[here, 2, s]
        seen[4, s] = x_x * nx + x_y * ny + x_z * nz
        seen[5, s] = y_x * nx + y_y * ny + y_z * nz
        seen[6, s] = z_x * nx + z_y * ny + z_z * nz
    agree, front, contradict, free = weights[0], weights[1], weights[2], weights[3]
    total, agreed = nothing, 0
    for s in range(first, end):
        row, column = np.uint32(np.int32(seen[0, s])), np.uint32(np.int32(seen[1, s]))
        depth, z = cells[row, column, 0], seen[2, s]
        n_x, n_y, n_z = cells[row, column, 1], cells[row, column, 2], cells[row, column, 3]
        cosine = n_x * seen[4, s] + n_y * seen[5, s] + n_z * seen[6, s]
        told = contradict if cosine < contradict_cosine else nothing
        told = agree if cosine > agree_cosine else told
        told = front if z - depth < -tolerance else told
        told = nothing if z - depth > tolerance else told
        beyond = free if n_x + seen[3, s] > tolerance else nothing
        told = beyond if depth == np.inf else told
        told = nothing if (is_pinhole and z <= nothing) else told
        total += told
        agreed += int(told > nothing)
    return total, agreed


@njit(cache=True, nogil=True)
def score_all(
    cells_i: Single,
    camera_i: Single,
    points_i: Single,
    normals_i: Single,
    hung_i: Single,
    places_i: Single,
    cells_j: Single,
    camera_j: Single,
    points_j: Single,
    normals_j: Single,
    hung_j: Single,
    places_j: Single,
    weights: Single,
    looks: FloatArray,
    tolerance: np.float32,
    scores: Single,
) -> None:
    """Fill in scores (A, B, T); those given up, or with too little agreement, are left as they are.

    The samples come in an order in which the first few are spread evenly. Looks (L, 2) are samples
    of each scan and the least sum after so many; the last is after all of them.
    """
    num = int(looks[-1, 0])
    seen = np.empty((7, num), np.float32)
    for a in range(scores.shape[0]):
        for b in range(scores.shape[1]):
            for t in range(scores.shape[2]):
                total, agreed, done = np.float32(0.0), 0, 0
                for look in range(looks.shape[0]):
                    samples = done, int(looks[look, 0])
                    there = _hear(cells_j, camera_j, hung_j, places_j, points_i, normals_i,
                                  (b, t, a), samples, weights, tolerance, seen)  # fmt: skip
                    back = _hear(cells_i, camera_i, hung_i, places_i, points_j, normals_j,
                                 (a, t, b), samples, weights, tolerance, seen)  # fmt: skip
                    total += there[0] + back[0]
                    agreed += there[1] + back[1]
                    if total < looks[look, 1]:
                        break
                    done = samples[1]
                else:
                    if agreed >= MIN_SWEPT_AGREE * 2 * num:
                        scores[a, b, t] = total / (2 * num)
