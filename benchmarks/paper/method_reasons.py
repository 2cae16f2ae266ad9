"""Why the readings of docs/method.md were taken: the numbers of the ablations and the basins."""

from collections.abc import Callable
from functools import partial

from benchmarks.paper.basins import CONVERGED
from benchmarks.paper.method_page import Results

WIDE_GAP, FAR_START = 90, 40


def _basin(results: Results, method: str) -> str:
    """Right answers of a method from far off at the widest gap."""
    told = [
        record.result["answers"][str(FAR_START)][method]
        for record in results.table("basins")
        if record.unit["gap"] == WIDE_GAP
    ]
    return f"{sum(map(CONVERGED.holds, told))} of {len(told)}"


REASONS: dict[str, Callable[[Results], str]] = {
    "wide-gap": lambda _: str(WIDE_GAP),
    "far-start": lambda _: str(FAR_START),
    **{
        f"basin-{method}": partial(_basin, method=method)
        for method in ("mm-icc", "m-icc", "trimmed-icp", "gicp", "point-to-plane", "joint")
    },
}
"""Name in the template -> what computes its text."""
