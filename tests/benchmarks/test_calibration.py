"""The calibration: objects that can be scanned, fits that find what is known, what is told."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from benchmarks.blocks import rendered
from benchmarks.calibration.collect import NUM_SETS, Sets
from benchmarks.calibration.fit import (
    Examples,
    best_supported,
    fit,
    held_out_probabilities,
    log_odds,
)
from benchmarks.calibration.learn import learn
from benchmarks.calibration.report import calibration_told, measures
from benchmarks.calibration.scenes import OTHER, make_set
from benchmarks.calibration.solids import SOLIDS
from benchmarks.judging.other_tools import OtherTools
from benchmarks.judging.trial import Runs
from benchmarks.kept import Record
from benchmarks.scores import Stated
from benchmarks.seeds import spent_among
from benchmarks.virtual.bodies import Body
from benchmarks.virtual.disturbances import LIKE
from scanweld.confidence.model import read_calibration
from scanweld.geometry.arrays import BoolArray, FloatArray


@pytest.mark.parametrize("make", SOLIDS, ids=lambda make: make.__name__)
def test_solids_face_outwards_and_differ_by_seed(make: Callable[[np.random.Generator], Body]):
    a, b, again = (make(np.random.default_rng([seed, 7])).mesh for seed in (0, 1, 0))
    assert trimesh.Trimesh(a.vertices, a.faces, process=False).volume > 1000
    assert a.vertices.shape != b.vertices.shape or not np.allclose(a.vertices, b.vertices)
    assert again.vertices.tobytes() == a.vertices.tobytes()


def test_sets_repeat_themselves():
    a, b = make_set(3), make_set(3)
    assert [scan.points.tobytes() for scan in a.scans] == [s.points.tobytes() for s in b.scans]
    assert 3 <= len(a.scans) <= 6 and sum(SOLIDS.values()) == pytest.approx(1)


def test_trust_has_no_seed_that_decided_something():
    learned = {unit["seed"] for unit in Sets().units(False)}
    both = learned | {seed + OTHER for seed in learned}
    asked = {unit["seed"] for unit in [*Runs().units(False), *OtherTools().units(False)]}
    asked |= {seed + LIKE for seed in asked}
    assert len(learned) == NUM_SETS and not spent_among(asked)
    assert all(spent_among([seed]) for seed in both)


def known(count: int, seed: int) -> tuple[list[dict[str, float]], FloatArray, BoolArray]:
    """Examples whose probability is known: one ground tells, one is idle, one misleads."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(count, 3))
    probability = 1 / (1 + np.exp(-2.5 * x[:, 0] + 0.7 * x[:, 2]))
    rows = [{"tells": a, "idle": b, "against": c} for a, b, c in x.tolist()]
    return rows, probability, rng.random(count) < probability


def test_the_fit_finds_probabilities_that_are_known():
    rows, _, is_right = known(4000, 0)
    model = fit(Examples.of(rows, is_right.tolist(), list(range(4000))))
    seen, probability, came = known(4000, 1)
    said = np.array([model.probability(row) for row in seen])
    # What tells the wrong way cannot be used: a model must not doubt what looks better.
    assert np.ptp(model.curves["against"].values) < 0.3
    assert np.ptp(model.curves["idle"].values) < 0.5 < 3 < np.ptp(model.curves["tells"].values)
    assert Stated(said, came).calibration_error() < 0.03
    assert np.corrcoef(said, probability)[0, 1] > 0.9


def test_held_out_probabilities_know_nothing_of_their_set():
    """Grounds that are only a set's number, and sets that are all right or all wrong."""
    rng = np.random.default_rng(0)
    groups = np.repeat(np.arange(40), 10)
    is_right = (rng.random(40) < 0.5)[groups]
    rows = [{"number": float(g), "noise": float(rng.normal())} for g in groups]
    said = held_out_probabilities(Examples.of(rows, is_right.tolist(), groups.tolist()))
    assert Stated(said, is_right).auc < 0.65


def test_few_examples_do_not_make_certain():
    totals, all_right = np.arange(30.0), np.ones(30, dtype=bool)
    assert best_supported(totals, all_right) == pytest.approx(31 / 32)
    slope, offset = log_odds(totals - 15.0, all_right)
    assert slope == pytest.approx(0.0, abs=0.01) and offset == pytest.approx(np.log(31), rel=0.01)
    first_wrong = best_supported(np.arange(200.0), np.arange(200) >= 100)
    assert first_wrong == pytest.approx(101 / 102)
    top_wrong = best_supported(np.arange(200.0), np.arange(200) % 50 != 49)
    assert top_wrong == pytest.approx(197 / 202), "one in fifty is wrong wherever one looks"


def test_odds_are_those_that_examples_have():
    rng = np.random.default_rng(2)
    totals = rng.normal(size=20_000)
    is_right = rng.random(20_000) < 1.0 / (1.0 + np.exp(-(1.7 * totals - 0.6)))
    slope, offset = log_odds(totals, is_right)
    assert slope == pytest.approx(1.7, abs=0.1) and offset == pytest.approx(-0.6, abs=0.1)
    assert log_odds(totals, ~is_right)[0] == 0.0, "more is never worse"


def made_record(seed: int) -> Record:
    """A set of three scans: two pairs right, one wrong; or of a stranger, all wrong."""
    rng = np.random.default_rng(seed)
    is_right, pairs, scans = bool(rng.random() < 0.6), [], []
    for k, edge in enumerate(("ab", "bc", "ac")):
        grounds = {"agree": float(rng.normal(2.0 * (k < 2 and is_right))), "support": 0.0}
        told = {"kind": "good", "observability": 1.0, "accepted": k < 2, "grounds": grounds}
        pairs.append({"i": edge[0], "j": edge[1], "right": bool(k < 2 and is_right), **told})
    for name in "abc":
        grounds = {"agree": float(rng.normal(2.0 * is_right)), "margin": 1.0, "link": 0.0}
        told = {"component": 0, "reference": name == "b", "right": is_right}
        scans.append({"name": name, **told, "grounds": {**grounds, "observability": -1.0}})
    return Record(unit={"seed": seed}, result={"pairs": pairs, "scans": scans})


def test_scans_learn_from_the_confidence_of_their_pairs():
    learned = learn([made_record(seed) for seed in range(150)], "the command")
    assert len(learned.pairs.groups) == len(learned.scans.groups) == 450
    links = learned.scans.grounds[:, learned.scans.names.index("link")]
    assert links[learned.scans.is_right].mean() > links[~learned.scans.is_right].mean() + 0.3
    assert learned.stated_pairs.auc > 0.85
    assert learned.stated_scans.auc > 0.9
    again = read_calibration(learned.calibration.to_json())
    assert again.made["sets"] == 150 and again.made["command"] == "the command"
    text = rendered("calibration", **calibration_told(measures(learned)))
    assert "`the command`" in text and "150 sets" in text
    assert "Of the pairs have a confidence from 0.5 on" in text
