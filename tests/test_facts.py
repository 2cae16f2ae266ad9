"""Facts that users give: from files, and such as cannot be meant."""

import json
from pathlib import Path
from typing import Any

import pytest

from scanweld.errors import KnowledgeError
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet, write_poses
from scanweld.knowledge.facts import Knowledge, read_knowledge
from scanweld.pipeline import run as pipeline
from tests.scenes import primitive_scene

STRANGERS = PoseSet(poses={"x": Pose.identity()}, components=(("x",),))


@pytest.mark.parametrize(
    ("known", "told"),
    [
        ({"fix": ("nobody",)}, "fix: no scan is called nobody; there are scan_01"),
        ({"together": (("scan_01", "nobody"),)}, "together: no scan is called nobody"),
        ({"apart": (("nobody", "scan_01"),)}, "apart: no scan is called nobody"),
        ({"start": STRANGERS}, "start: has a pose for none of the scans"),
        ({"together": (("a", "b"),), "apart": (("b", "a"),)}, "a and b are .*together and apart"),
        ({"apart": (("a", "a"),)}, "a is named twice"),
    ],
)
def test_facts_about_no_scan_or_that_deny_each_other_are_errors(known: dict[str, Any], told: str):
    with pytest.raises(KnowledgeError, match=told):
        pipeline.run(primitive_scene("box", pixels=30).scans, knowledge=Knowledge(**known))


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
        (None, r"facts\.json: No such file"),
    ],
)
def test_files_that_are_no_facts_are_named(tmp_path: Path, text: str | None, told: str):
    file = tmp_path / "facts.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(KnowledgeError, match=told) as raised:
        read_knowledge(file)
    assert str(file) in str(raised.value) and "\n" not in str(raised.value)
    assert text is not None or "correct it" not in str(raised.value)
