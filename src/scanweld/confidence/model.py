"""A calibrated model: named grounds to the probability that a pose is right.

Each ground has a curve that never falls: better evidence never makes a pose less probable, and
beyond what was seen in the calibration a curve is flat. The sum of the curves is turned into a
probability by a logistic function that was fitted to sums of held-out examples (Platt 1999), and
no confidence is above what the number of examples supports.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from scanweld.confidence.bounds import Bounds
from scanweld.geometry.arrays import FloatArray, frozen

FORMAT = 4
MAX_CONFIDENCE = 0.999
"""No calibration is so large, and so like the scans at hand, that more could be said."""
_FILE = "calibration.json"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Curve:
    """A function that never falls: linear between its knots, flat beyond them.

    Attributes:
        knots: (K,) increasing.
        values: (K,) not decreasing.
    """

    knots: FloatArray
    values: FloatArray

    def __post_init__(self) -> None:
        for name in ("knots", "values"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, (None,)))
        if len(self.knots) != len(self.values) or len(self.knots) == 0:
            raise ValueError("a curve has as many knots as values, and at least one")
        if np.any(np.diff(self.knots) <= 0) or np.any(np.diff(self.values) < 0):
            raise ValueError("a curve's knots increase and its values never fall")

    def at(self, x: FloatArray | float) -> FloatArray:
        """Values at any places."""
        return np.asarray(np.interp(x, self.knots, self.values))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Model:
    """Grounds -> probability.

    Attributes:
        curves: Of each ground, by name: its part of the sum.
        slope: Of the logarithm of the odds with the sum.
        offset: Logarithm of the odds where the sum is 0.
        most: Largest probability that the number of examples supports.
    """

    curves: Mapping[str, Curve]
    slope: float
    offset: float
    most: float

    def __post_init__(self) -> None:
        if self.slope < 0:
            raise ValueError("odds never fall with the sum of the curves")
        if not 0 <= self.most <= 1:
            raise ValueError("a probability is between 0 and 1")

    def total(self, grounds: Mapping[str, float]) -> float:
        """The sum of the curves.

        Raises:
            ValueError: If the grounds are others than the model knows.
        """
        if grounds.keys() != self.curves.keys():
            raise ValueError(f"grounds {sorted(grounds)}, the model has {sorted(self.curves)}")
        return float(sum(float(curve.at(grounds[name])) for name, curve in self.curves.items()))

    def probability(self, grounds: Mapping[str, float]) -> float:
        """Probability that what has these grounds is right, at most ``MAX_CONFIDENCE``."""
        odds = float(np.exp(self.slope * self.total(grounds) + self.offset))
        return min(odds / (1.0 + odds), self.most, MAX_CONFIDENCE)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Calibration:
    """The models of pairs and of scans, and how they came about.

    Attributes:
        pair: Of the pose of a pair.
        scan: Of the pose of a scan in its component.
        bounds: Of the errors of poses.
        made: Command, counts and digest of the calibration that they come from.
    """

    pair: Model
    scan: Model
    bounds: Bounds
    made: Mapping[str, Any]

    def to_json(self) -> str:
        """The calibration as ``read_calibration`` takes it."""
        document = {
            "format": FORMAT,
            "made": dict(self.made),
            "pair": _model_json(self.pair),
            "scan": _model_json(self.scan),
            "bounds": asdict(self.bounds),
        }
        return json.dumps(document, indent=1) + "\n"


def read_calibration(text: str) -> Calibration:
    """A calibration from its JSON.

    Raises:
        ValueError: If it is of another format, or no calibration.
    """
    document = json.loads(text)
    if document.get("format") != FORMAT:
        raise ValueError(
            f"calibration of format {document.get('format')}, this version reads {FORMAT}; "
            "run python -m benchmarks.calibration"
        )
    return Calibration(
        pair=_read_model(document["pair"]),
        scan=_read_model(document["scan"]),
        bounds=Bounds(**document["bounds"]),
        made=document["made"],
    )


@lru_cache(maxsize=1)
def stored_calibration() -> Calibration:
    """The calibration that comes with the package."""
    return read_calibration(
        files("scanweld.confidence").joinpath(_FILE).read_text(encoding="utf-8")
    )


def _model_json(model: Model) -> dict[str, Any]:
    return {
        "curves": {name: _curve_json(curve) for name, curve in model.curves.items()},
        **{"slope": model.slope, "offset": model.offset, "most": model.most},
    }


def _curve_json(curve: Curve) -> dict[str, list[float]]:
    return {"knots": curve.knots.tolist(), "values": curve.values.tolist()}


def _read_model(entry: Mapping[str, Any]) -> Model:
    return Model(
        curves={name: _read_curve(curve) for name, curve in entry["curves"].items()},
        slope=entry["slope"],
        offset=entry["offset"],
        most=entry["most"],
    )


def _read_curve(entry: Mapping[str, Any]) -> Curve:
    return Curve(knots=np.array(entry["knots"]), values=np.array(entry["values"]))
