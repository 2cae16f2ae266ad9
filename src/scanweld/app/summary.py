"""What a run found out, in a few lines."""

from pathlib import Path

from scanweld.app.outputs import PREVIEW
from scanweld.io import natural_key
from scanweld.io.local_origin import about_note, find_shift
from scanweld.reconstruction import Reconstruction, ScanVerdict, Verdict


def summary(result: Reconstruction, output: Path) -> str:
    """Verdict in a sentence, what could not be placed and why, and where the files are."""
    by = "" if result.config.method == "robust" else f" (method: {result.config.method})"
    lines = [f"{result.verdict.value}: {sentence(result)}{by}"]
    lines += [f"  unplaced {name}: {reason}" for name, reason in _in_order(dict(result.unplaced))]
    doubtful = {
        name: scan.reason
        for name, scan in result.scans.items()
        if scan.verdict is ScanVerdict.DOUBTFUL
    }
    lines += [f"  doubtful {name}: {reason}" for name, reason in _in_order(doubtful)]
    if len(result.components) > 1:
        lines += [f"  component {k + 1}: {', '.join(c)}" for k, c in enumerate(result.components)]
    lines += [f"  {fact.verdict} {fact.fact}: {fact.reason}" for fact in result.knowledge]
    lines += _least_sure(result)
    lines += _exact_to(result)
    if result.preview is not None:
        lines.append(f"  no model: all of its scans are doubtful; {PREVIEW} shows where they lie")
    elif result.poses and result.mesh is None:
        lines.append("  no model: the placed scans could not be fused")
    mesh = result.mesh or result.preview
    shift = None if mesh is None else find_shift(mesh.vertices)
    if shift is not None:
        lines.append(f"  {about_note([PREVIEW if result.mesh is None else 'model.ply'], shift)}")
    lines.append(f"  {output}: {', '.join(_files(result))}")
    return "\n".join(lines)


def sentence(result: Reconstruction) -> str:
    """How many scans are placed, and in how many pieces."""
    return verdict_sentence(
        result.verdict, len(result.scans), len(result.poses), len(result.components)
    )


def verdict_sentence(verdict: Verdict, total: int, placed: int, pieces: int) -> str:
    """The verdict in words, from the numbers of scans, of those placed, and of components."""
    if verdict is Verdict.NOTHING:
        return f"no two of the {total} scans could be brought together"
    if verdict is Verdict.GIVEN:
        return f"all {total} scans are fused with the poses that were given"
    share = f"all {total} scans are" if placed == total else f"{placed} of {total} scans are"
    return f"{share} placed" + (f", in {pieces} separate components" if pieces > 1 else "")


def _least_sure(result: Reconstruction) -> list[str]:
    """The placed scan in whose pose there is least confidence."""
    known = [
        (scan.confidence, name)
        for name, scan in result.scans.items()
        if scan.confidence is not None
    ]
    return [f"  least sure {name}: confidence {least:.3f}" for least, name in sorted(known)[:1]]


def _exact_to(result: Reconstruction) -> list[str]:
    """The bounds that hold for all good scans."""
    bounds = [
        (scan.rotation_bound_deg, scan.translation_bound)
        for scan in result.scans.values()
        if scan.verdict is ScanVerdict.GOOD
    ]
    turns = [turn for turn, _ in bounds if turn is not None]
    shifts = [shift for _, shift in bounds if shift is not None]
    if result.sensor is None or not turns or not shifts:
        return []
    share = max(shifts) / result.sensor.diameter
    return [
        f"  good scans are exact to {max(turns):.2g} deg and {share:.2%} of the diameter (95 %)"
    ]


def _in_order(reasons: dict[str, str]) -> list[tuple[str, str]]:
    return sorted(reasons.items(), key=lambda item: natural_key(item[0]))


def _files(result: Reconstruction) -> list[str]:
    mesh = result.mesh
    model = [] if mesh is None else [f"model.ply ({len(mesh.vertices):,} vertices)"]
    if result.preview is not None:
        model.append(f"{PREVIEW} ({len(result.preview.vertices):,} vertices)")
    return [*model, "report.html", "poses.json", "graph.json", "report.json", "config.toml"]
