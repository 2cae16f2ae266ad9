"""Facts that users give: from files, and such as cannot be meant."""

import json
from pathlib import Path

import pytest

from scanweld.errors import KnowledgeError
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet, write_poses
from scanweld.knowledge.facts import Knowledge, read_knowledge
from tests.test_knowledge import FIRST, run, seen_from


@pytest.mark.parametrize(
    ("known", "told"),
    [
        (Knowledge(fix=("nobody",)), "fix: no scan is called nobody; there are scan_01"),
        (Knowledge(together=((FIRST, "nobody"),)), "together: no scan is called nobody"),
        (Knowledge(apart=(("nobody", FIRST),)), "apart: no scan is called nobody"),
        (
            Knowledge(start=PoseSet(poses={"x": Pose.identity()}, components=(("x",),))),
            "start: has a pose for none of the scans",
        ),
    ],
)
def test_facts_about_no_scan_are_errors(known: Knowledge, told: str):
    with pytest.raises(KnowledgeError, match=told):
        run(seen_from(42, 100).scans, known)


def test_facts_that_deny_each_other_are_errors():
    with pytest.raises(KnowledgeError, match="a and b are said to be both together and apart"):
        Knowledge(together=(("a", "b"),), apart=(("b", "a"),))
    with pytest.raises(KnowledgeError, match="a is named twice"):
        Knowledge(apart=(("a", "a"),))


def test_facts_from_a_file(tmp_path: Path):
    poses = PoseSet(poses={"a": Pose.identity()}, components=(("a",),))
    write_poses(tmp_path / "poses.json", poses)
    file = tmp_path / "facts.json"
    told = {"fix": ["a"], "start": "poses.json", "together": [["b", "a"]], "turntable": True}
    file.write_text(json.dumps(told))
    known = read_knowledge(file)
    assert known.fix == ("a",) and known.together == (("a", "b"),) and known.turntable
    assert known.start is not None and set(known.start.poses) == {"a"}
    more = known.joined(Knowledge(fix=("c",), apart=(("a", "c"),)))
    assert more.fix == ("a", "c") and more.start is known.start and more.apart == (("a", "c"),)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "cannot be read as JSON"),
        ('{"turn_table": true}', "turn_table"),
        ('{"together": [["a"]]}', "together"),
        ("[]", "the file"),
    ],
)
def test_files_that_are_no_facts_are_named(tmp_path: Path, text: str, told: str):
    file = tmp_path / "facts.json"
    file.write_text(text)
    with pytest.raises(KnowledgeError, match=told) as raised:
        read_knowledge(file)
    assert str(file) in str(raised.value) and "\n" not in str(raised.value)


def test_a_file_of_facts_that_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(KnowledgeError, match=r"facts\.json: No such file") as raised:
        read_knowledge(tmp_path / "facts.json")
    assert "correct it" not in str(raised.value)
