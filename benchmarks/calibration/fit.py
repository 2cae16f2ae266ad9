"""Fit the calibrated model: curves that never fall, and odds by held-out objects."""

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


class Examples(NamedTuple):
    """What was seen, to learn from."""

    names: tuple[str, ...]  # Of the F grounds
    grounds: FloatArray  # (N, F)
    is_right: BoolArray  # (N,)
    is_known: BoolArray  # (N,) whether it is right or wrong; nothing is learnt from the others
    groups: IntArray  # (N,) number of the set that each comes from: sets have their own objects

    @classmethod
    def of(
        cls,
        rows: Sequence[Mapping[str, float]],
        is_right: Sequence[bool | None],
        groups: Sequence[int],
    ) -> Self:
        """From named grounds; None is what is neither right nor wrong."""
        names = tuple(rows[0])
        grounds = np.array([[row[name] for name in names] for row in rows])
        is_known = np.array([right is not None for right in is_right])
        return cls(names, grounds, np.array(is_right, dtype=bool), is_known, np.array(groups))

    def rows(self) -> list[dict[str, float]]:
        """The grounds of each, by name."""
        return [dict(zip(self.names, row, strict=True)) for row in self.grounds.tolist()]

    def only(self, kept: BoolArray) -> "Examples":
        """Some of them."""
        return Examples(
            self.names,
            self.grounds[kept],
            self.is_right[kept],
            self.is_known[kept],
            self.groups[kept],
        )

    def without(self, name: str) -> "Examples":
        """All of them, one ground left out."""
        k = self.names.index(name)
        names, grounds = self.names[:k] + self.names[k + 1 :], np.delete(self.grounds, k, axis=1)
        return self._replace(names=names, grounds=grounds)


def fit(examples: Examples) -> Model:
    """Curves from all examples; odds by the sums that curves from other objects gave."""
    examples = examples.only(examples.is_known)
    totals = np.zeros(len(examples.groups))
    for fold in folds(examples):
        curves, held_out = fit_curves(examples.only(~fold)), examples.only(fold)
        columns = zip(examples.names, held_out.grounds.T, strict=True)
        totals[fold] = np.sum([curves[name].at(column) for name, column in columns], axis=0)
    slope, offset = log_odds(totals, examples.is_right)
    most = best_supported(totals, examples.is_right)
    return Model(curves=fit_curves(examples), slope=slope, offset=offset, most=most)


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


def log_odds(totals: FloatArray, is_right: BoolArray) -> tuple[float, float]:
    """Slope and offset of the logarithm of the odds with the sum, by maximum likelihood.

    Each example counts as right with a probability that leaves it a doubt, one more success and
    one more failure being added to those seen (Platt 1999).
    """
    right = int(is_right.sum())
    wrong = len(is_right) - right
    aimed_at = np.where(is_right, (right + 1) / (right + 2), 1 / (wrong + 2))

    def loss(w: FloatArray) -> tuple[float, FloatArray]:
        logit = w[0] * totals + w[1]
        pull = expit(logit) - aimed_at
        value = np.logaddexp(0.0, logit).sum() - aimed_at @ logit
        return float(value), np.array([pull @ totals, pull.sum()])

    limits = [(0.0, None), (None, None)]
    slope, offset = minimize(loss, [1.0, 0.0], jac=True, method="L-BFGS-B", bounds=limits).x
    return float(slope), float(offset)


def best_supported(totals: FloatArray, is_right: BoolArray) -> float:
    """Largest of Laplace's estimates for all examples from some sum on."""
    right = np.cumsum(is_right[np.argsort(-totals, kind="stable")])
    return float(((right + 1) / (np.arange(len(right)) + 3)).max())
