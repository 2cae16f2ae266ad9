"""Fit the calibrated model: curves that never fall, and frequencies counted on held-out objects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Examples:
    """What was seen, to learn from.

    Attributes:
        names: Of the F grounds.
        grounds: (N, F).
        is_right: (N,).
        groups: (N,) number of the set that each comes from: sets have their own objects.
    """

    names: tuple[str, ...]
    grounds: FloatArray
    is_right: BoolArray
    groups: IntArray

    def __len__(self) -> int:
        return len(self.is_right)

    def rows(self) -> list[dict[str, float]]:
        """The grounds of each, by name."""
        return [dict(zip(self.names, row, strict=True)) for row in self.grounds.tolist()]

    def only(self, kept: BoolArray) -> "Examples":
        """Some of them."""
        return Examples(
            names=self.names,
            grounds=self.grounds[kept],
            is_right=self.is_right[kept],
            groups=self.groups[kept],
        )

    def without(self, name: str) -> "Examples":
        """All of them, one ground left out."""
        kept = [k for k, other in enumerate(self.names) if other != name]
        return Examples(
            names=tuple(self.names[k] for k in kept),
            grounds=self.grounds[:, kept],
            is_right=self.is_right,
            groups=self.groups,
        )


def make_examples(
    rows: Sequence[Mapping[str, float]], is_right: Sequence[bool], groups: Sequence[int]
) -> Examples:
    """Examples from named grounds."""
    names = tuple(rows[0])
    return Examples(
        names=names,
        grounds=np.array([[row[name] for name in names] for row in rows]),
        is_right=np.array(is_right, dtype=bool),
        groups=np.array(groups),
    )


def fit(examples: Examples) -> Model:
    """Curves from all examples; frequencies of sums that curves from other objects gave."""
    held_out = np.zeros(len(examples))
    for fold in folds(examples):
        curves = fit_curves(examples.only(~fold))
        held_out[fold] = _totals(curves, examples.only(fold))
    return Model(
        curves=fit_curves(examples), frequencies=count_frequencies(held_out, examples.is_right)
    )


def held_out_probabilities(examples: Examples) -> FloatArray:
    """Probability (N,) of each example by a model that has seen nothing of its object."""
    found = np.zeros(len(examples))
    for fold in folds(examples):
        model = fit(examples.only(~fold))
        found[fold] = [model.probability(row) for row in examples.only(fold).rows()]
    return found


def folds(examples: Examples) -> list[BoolArray]:
    """Parts of the examples that share no set."""
    _, order = np.unique(examples.groups, return_inverse=True)
    return [order % NUM_FOLDS == k for k in range(NUM_FOLDS)]


def fit_curves(examples: Examples) -> dict[str, Curve]:
    """Logistic regression on ramps between knots, none of which may go down."""
    knots = [_knots(column) for column in examples.grounds.T]
    ramps = np.concatenate(
        [_ramps(x, at) for x, at in zip(examples.grounds.T, knots, strict=True)], axis=1
    )
    sign = np.where(examples.is_right, -1.0, 1.0)

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        away = sign * (weights[0] + ramps @ weights[1:])
        pull = sign * expit(away)
        value = np.logaddexp(0.0, away).sum() + 0.5 * PENALTY * weights[1:] @ weights[1:]
        return float(value), np.r_[pull.sum(), pull @ ramps + PENALTY * weights[1:]]

    start = np.zeros(1 + ramps.shape[1])
    limits = [(None, None)] + [(0.0, None)] * ramps.shape[1]
    weights = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=limits).x
    steps = np.split(weights[1:], np.cumsum([len(at) - 1 for at in knots])[:-1])
    values = [np.r_[0.0, np.cumsum(step)] for step in steps]
    values[0] = values[0] + weights[0]
    return {
        name: Curve(knots=at, values=value)
        for name, at, value in zip(examples.names, knots, values, strict=True)
    }


def count_frequencies(totals: FloatArray, is_right: BoolArray) -> Curve:
    """How often what has such a sum is right: isotonic regression of Laplace's estimate."""
    order = np.argsort(totals, kind="stable")
    count = max(len(totals) // MIN_COUNTED, 1)
    pools: list[_Pool] = []
    for part in np.array_split(order, count):
        pools.append(
            _Pool(total=totals[part].sum(), right=int(is_right[part].sum()), count=len(part))
        )
        while len(pools) > 1 and not _rises(pools[-2], pools[-1]):
            last = pools.pop()
            pools[-1] = pools[-1].with_all_of(last)
    return Curve(
        knots=np.array([pool.place for pool in pools]),
        values=np.array([pool.frequency for pool in pools]),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class _Pool:
    """Examples that are counted together."""

    total: float
    right: int
    count: int

    @property
    def place(self) -> float:
        return self.total / self.count

    @property
    def frequency(self) -> float:
        return (self.right + 1) / (self.count + 2)

    def with_all_of(self, other: "_Pool") -> "_Pool":
        return _Pool(
            total=self.total + other.total,
            right=self.right + other.right,
            count=self.count + other.count,
        )


def _rises(before: _Pool, after: _Pool) -> bool:
    return before.place < after.place and before.frequency < after.frequency


def _totals(curves: Mapping[str, Curve], examples: Examples) -> FloatArray:
    columns = zip(examples.names, examples.grounds.T, strict=True)
    return np.sum([curves[name].at(column) for name, column in columns], axis=0)


def _knots(column: FloatArray) -> FloatArray:
    return np.unique(np.quantile(column, QUANTILES))


def _ramps(x: FloatArray, knots: FloatArray) -> FloatArray:
    """(N, K - 1) from 0 to 1 between each knot and the next."""
    low, high = knots[:-1], knots[1:]
    return np.clip((x[:, None] - low) / (high - low), 0.0, 1.0)
