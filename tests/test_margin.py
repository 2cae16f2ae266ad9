"""Margins over rivals: what counts is how well these explain the scans, not how far they meet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanweld.config import PairsConfig
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.rivals import as_rival
from scanweld.pairs.result import Alternative, PairKind, margin_among, refutation_among
from scanweld.pairs.verdict import Measured, classify_pair
from tests.results import turned


def evidence(agree: float, front: float = 0.0, free: float = 0.0) -> Evidence:
    left = 1.0 - agree - front - free
    return Evidence(agree=agree, front=front, contradict=0.0, free=free, occluded=left, unknown=0.0)


def options_of(evidences: list[Evidence]) -> list[Alternative]:
    return [Alternative(i_from_j=turned(k), evidence=e) for k, e in enumerate(evidences)]


def margin(best: Evidence, rivals: list[Evidence]) -> float:
    options = options_of([best, *rivals])
    return margin_among(options[0], options)


def refuted(best: Evidence, rivals: list[Evidence]) -> float:
    options = options_of([best, *rivals])
    return refutation_among(options[0], options)


def test_a_rival_that_nothing_contradicts_is_as_good_though_it_overlaps_less():
    """The next turn of a toothed wheel: fewer teeth meet, and all that meet fit."""
    assert margin(evidence(0.9, front=0.005), [evidence(0.5, front=0.003)]) < 0.05
    assert margin(evidence(0.9), [evidence(0.35)]) == pytest.approx(0.0, abs=1e-12)
    assert margin(evidence(0.8, free=0.2), [evidence(0.4, free=0.11)]) < 0.1, "as dirty"
    best, rival = evidence(0.6, front=0.01), evidence(0.5, front=0.1, free=0.1)
    assert margin(best, [rival]) == pytest.approx((best.score - rival.score) / best.score)
    options = options_of([evidence(0.9, front=0.01), evidence(0.4, front=0.005)])
    found = classify_pair((0, 1), options, Measured(information=np.eye(6), rms=0.1), PairsConfig())
    assert found.kind is PairKind.AMBIGUOUS and len(found.alternatives) == 2


def test_slivers_are_no_rivals():
    best = evidence(0.6, front=0.01)
    assert margin(best, [evidence(0.04)]) > 0.9
    assert margin(best, [evidence(0.18)]) > 0.6, "a narrow view fits a third as well elsewhere"
    assert margin(evidence(0.15), [evidence(0.06)]) == pytest.approx(0.0, abs=1e-12)
    assert margin(evidence(0.3), []) == 1.0
    assert margin(evidence(0.1, front=0.2), []) == 0.0
    assert as_rival(-0.1, (0.0, 0.0), (0.0, 0.0)) == -0.1, "where nothing agrees, its score alone"
    assert as_rival(0.2, (0.0, 0.5), (0.0, 0.0)) == 0.2


@given(st.floats(0.06, 1.0), st.floats(0.01, 1.0), st.floats(0, 0.3), st.floats(0, 0.3))
def test_one_more_rival_never_makes_a_pose_surer(a: float, b: float, front: float, free: float):
    best, first = evidence(a, front=0.02 * a), evidence(0.3, front=0.05)
    rival = evidence(b, front=front, free=free)
    assert margin(best, [first, rival]) <= margin(best, [first])


def test_how_clearly_rivals_are_refuted_is_told_by_the_least_contradicted_one():
    best, poor, poorer = evidence(0.6), evidence(0.2, front=0.1), evidence(0.3, front=0.3)
    assert refuted(best, [poor, poorer]) == pytest.approx(0.5)
    assert refuted(best, [poorer]) == 1.0
    assert refuted(best, [poorer, evidence(0.3)]) == 0.0
    assert refuted(best, [evidence(0.08)]) == 1.0, "a sliver is no rival"
    assert refuted(best, []) == 1.0
