"""Fit the calibrated model: curves that never fall, and frequencies counted on held-out objects."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from scanweld.confidence.model import Curve, Model
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

QUANTILES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
"""Where a curve may bend."""
PENALTY = 1.0
"""Of the squares of the curves' steps: steep only where many examples ask for it."""
NUM_FOLDS = 5
MIN_COUNTED = 20
"""Examples behind each frequency, at least."""


class Examples(NamedTuple):
    """What was seen, to learn from."""

    names: tuple[str, ...]  # Of the F grounds
    grounds: FloatArray  # (N, F)
    is_right: BoolArray  # (N,)
    groups: IntArray  # (N,) number of the set that each comes from: sets have their own objects

    @classmethod
    def of(
        cls, rows: Sequence[Mapping[str, float]], is_right: Sequence[bool], groups: Sequence[int]
    ) -> Self:
        """From named grounds."""
        names = tuple(rows[0])
        grounds = np.array([[row[name] for name in names] for row in rows])
        return cls(names, grounds, np.array(is_right, dtype=bool), np.array(groups))

    def rows(self) -> list[dict[str, float]]:
        """The grounds of each, by name."""
        return [dict(zip(self.names, row, strict=True)) for row in self.grounds.tolist()]

    def only(self, kept: BoolArray) -> "Examples":
        """Some of them."""
        return Examples(self.names, self.grounds[kept], self.is_right[kept], self.groups[kept])

    def without(self, name: str) -> "Examples":
        """All of them, one ground left out."""
        k = self.names.index(name)
        names, grounds = self.names[:k] + self.names[k + 1 :], np.delete(self.grounds, k, axis=1)
        return self._replace(names=names, grounds=grounds)


def fit(examples: Examples) -> Model:
    """Curves from all examples; frequencies of sums that curves from other objects gave."""
    totals = np.zeros(len(examples.groups))
    for fold in folds(examples):
        curves, held_out = fit_curves(examples.only(~fold)), examples.only(fold)
        columns = zip(examples.names, held_out.grounds.T, strict=True)
        totals[fold] = np.sum([curves[name].at(column) for name, column in columns], axis=0)
    frequencies = count_frequencies(totals, examples.is_right)
    return Model(curves=fit_curves(examples), frequencies=frequencies)


def held_out_probabilities(examples: Examples) -> FloatArray:
    """Probability (N,) of each example by a model that has seen nothing of its object."""
    found = np.zeros(len(examples.groups))
    for fold in folds(examples):
        model = fit(examples.only(~fold))
        found[fold] = [model.probability(row) for row in examples.only(fold).rows()]
    return found


def folds(examples: Examples) -> list[BoolArray]:
    """Parts of the examples that share no set; none that leaves nothing to learn from."""
    _, order = np.unique(examples.groups, return_inverse=True)
    parts = (order % NUM_FOLDS == k for k in range(NUM_FOLDS))
    return [part for part in parts if not part.all()]


def fit_curves(examples: Examples) -> dict[str, Curve]:
    """Logistic regression on ramps from each knot to the next, none of which may go down."""
    columns = examples.grounds.T
    knots = [np.unique(np.quantile(column, QUANTILES)) for column in columns]
    each = zip(columns, knots, strict=True)
    ramps = [np.clip((x[:, None] - at[:-1]) / np.diff(at), 0.0, 1.0) for x, at in each]
    matrix = np.concatenate(ramps, axis=1)
    sign = np.where(examples.is_right, -1.0, 1.0)

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        away = sign * (weights[0] + matrix @ weights[1:])
        pull = sign * expit(away)
        value = np.logaddexp(0.0, away).sum() + 0.5 * PENALTY * weights[1:] @ weights[1:]
        return float(value), np.r_[pull.sum(), pull @ matrix + PENALTY * weights[1:]]

    start = np.zeros(1 + matrix.shape[1])
    limits = [(None, None)] + [(0.0, None)] * matrix.shape[1]
    weights = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=limits).x
    steps = np.split(weights[1:], np.cumsum([len(at) - 1 for at in knots])[:-1])
    values = [np.r_[0.0, np.cumsum(step)] for step in steps]
    values[0] = values[0] + weights[0]
    named = zip(examples.names, knots, values, strict=True)
    return {name: Curve(knots=at, values=value) for name, at, value in named}


def count_frequencies(totals: FloatArray, is_right: BoolArray) -> Curve:
    """How often what has such a sum is right: isotonic regression of Laplace's estimate."""
    order = np.argsort(totals, kind="stable")
    pools: list[FloatArray] = []  # Sum, number right, number
    for part in np.array_split(order, max(len(totals) // MIN_COUNTED, 1)):
        pools.append(np.array([totals[part].sum(), is_right[part].sum(), len(part)]))
        while len(pools) > 1 and not np.all(_point(pools[-2]) < _point(pools[-1])):
            last = pools.pop()
            pools[-1] = pools[-1] + last
    places, frequencies = np.array([_point(pool) for pool in pools]).T
    return Curve(knots=places, values=frequencies)


def _point(pool: FloatArray) -> FloatArray:
    """Mean sum and frequency of examples that are counted together."""
    total, right, count = pool
    return np.array([total / count, (right + 1) / (count + 2)])
