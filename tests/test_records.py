"""Records as bytes: read back exactly, or not at all."""

from dataclasses import dataclass, make_dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scanweld.app.cache import KEPT
from scanweld.compiled import source
from scanweld.evidence.slippage import Slide, Slippage
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.heat.features import Features
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pairs.symmetry import Likeness, Symmetry
from scanweld.work import stage_log
from scanweld.work.records import RecordError, Records
from scanweld.work.stage_log import work_key
from tests.results import EVIDENCE
from tests.view_graphs import pair_of


class Color(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Inner:
    color: Color
    values: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Outer:
    number: float
    parts: tuple[Inner, ...]


RECORDS = Records(Outer)
OUTER = Outer(number=0.1, parts=(Inner(color=Color.RED, values=np.arange(3.0)),))


def same(a: Any, b: Any) -> bool:
    """Whether two values are alike to the last bit, types and all."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray | np.generic):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if hasattr(a, "__dataclass_fields__"):
        return all(same(getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__)
    return a == b or (a != a and b != b)


def changed(data: bytes, old: str, new: str) -> bytes:
    """Bytes of a record whose JSON says something else."""
    length = int.from_bytes(data[:8], "little")
    told = data[8 : 8 + length].decode()
    assert old in told
    other = told.replace(old, new).encode()
    return len(other).to_bytes(8, "little") + other + data[8 + length :]


def a_result() -> PairResult:
    evidence = replace(EVIDENCE, contradict=1 / 3)
    pose = Alternative(i_from_j=Pose.exp([0.1, 0.2, 0.3, 4, 5, 6]), evidence=evidence)
    return replace(
        pair_of(0, 3, PairKind.AMBIGUOUS, pose, pose),
        reason="two poses, “alike”",
        information=np.random.default_rng(0).normal(size=(6, 6)),
        observability=float("inf"),
        margin=-0.0,
        rms=float("nan"),
        sliding=Slippage(slide=Slide.PLANE, axis=np.array([0.0, 0.0, 1.0]), point=None),
        symmetry=Symmetry(likeness=next(iter(Likeness)), angles_deg=(90.0, 180.0)),
        rests_on_feature=True,
        further_ties=(pose,),
    )


def test_what_a_run_keeps_comes_back_to_the_last_bit():
    three, one = np.random.default_rng(1).normal(size=(4, 3)), np.linspace(0, 1, 4)
    features = Features(
        points=three, normals=three, signatures=three, strengths=one, times=one[:3], found_at=three
    )
    for value in (a_result(), features):
        kept = KEPT.from_bytes(KEPT.to_bytes(value))
        assert same(kept, value)
    assert isinstance(kept, Features) and not kept.points.flags.writeable
    arrays = (np.zeros((0, 3), np.uint8), np.asfortranarray(np.eye(3)), np.float32(0.1))
    frozen = np.arange(3)
    frozen.flags.writeable = False
    kept = RECORDS.from_bytes(RECORDS.to_bytes((*arrays, frozen)))
    assert same(kept, (*arrays, frozen)) and isinstance(kept, tuple)
    assert kept[0].flags.writeable and not kept[3].flags.writeable


@pytest.mark.parametrize(
    "value",
    [None, True, 0, 10**30, 1e-310, float("-inf"), "a\n\u2028", (), ((1, 1.0), None), Color.BLUE],
)
def test_plain_values_come_back(value: object):
    assert same(RECORDS.from_bytes(RECORDS.to_bytes(value)), value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"Inner"', '"Outer"'),
        ('"Inner"', '"Path"'),
        ('"number"', '"amount"'),
        ('"number": 0.1, ', ""),
        ('"number"', '"extra": 1, "number"'),
        ('"red"', '"green"'),
        ('"enum": "Color"', '"enum": "Inner"'),
        ('"array": 0', '"array": 7'),
        ('"<f8"', '"|O"'),
        ('"<f8"', '"<f4"'),
        ("[3]", "[4]"),
        ('"record"', '"what"'),
        ("0.1", "[0.1]"),
    ],
)
def test_what_does_not_fit_the_classes_is_refused(old: str, new: str):
    data = RECORDS.to_bytes(OUTER)
    assert same(RECORDS.from_bytes(changed(data, "0.1", "0.1")), OUTER)
    with pytest.raises(RecordError):
        RECORDS.from_bytes(changed(data, old, new))


def test_a_record_is_refused_where_its_class_or_its_bytes_are_others():
    data = RECORDS.to_bytes(OUTER)
    for names in (["number"], ["number", "parts", "more"], ["number", "pieces"]):
        other = make_dataclass("Outer", [(name, object) for name in names])
        with pytest.raises(RecordError, match="fields"):
            Records(other, Inner).from_bytes(data)
    with pytest.raises(RecordError, match="i < j"):
        KEPT.from_bytes(changed(KEPT.to_bytes(a_result()), '"i": 0', '"i": 3'))
    cut = [data[:length] for length in range(0, len(data), 7)]
    for other_bytes in (*cut, data + b"0", b"PK", b"\x80\x04N.", b"{}"):
        with pytest.raises(RecordError):
            RECORDS.from_bytes(other_bytes)


def test_classes_that_are_not_named_cannot_be_kept():
    for value in (object(), [1], {"a": 1}, Pose.identity(), np.array([None]), np.zeros(1, "i4,f4")):
        with pytest.raises(TypeError):
            RECORDS.to_bytes(value)


def test_work_is_done_anew_when_the_code_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "a.py").write_text("LIMIT = 1\n", encoding="utf-8")
    before = source.code_digest(tmp_path)
    (tmp_path / "a.py").write_text("LIMIT = 2\n", encoding="utf-8")
    source.code_digest.cache_clear()
    after = source.code_digest(tmp_path)
    assert before != after
    monkeypatch.setattr(stage_log, "code_digest", lambda: before)
    key = work_key("pair", "a", 1.0)
    assert key == work_key("pair", "a", 1.0) != work_key("pair", "a", 2.0)
    monkeypatch.setattr(stage_log, "code_digest", lambda: after)
    assert key != work_key("pair", "a", 1.0)
