"""How surely accepted pairs tie the scans of a component together."""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow

from scanweld.graph.view_graph import Component, Edge

STEPS = 1000
"""Flows are counted in this part of a unit: whole numbers give the same answer anywhere."""


def ties_of(component: Component, confidence: Mapping[Edge, float]) -> dict[int, float]:
    """How surely each scan is tied to the reference scan, and that one to the surest other.

    A pair of confidence p carries -log(1 - p). The least that must be cut to part two scans is
    -log of the chance that everything fails at once where they hang together worst: 2.3 is one
    pair of 0.9, or several that come to the same.

    Args:
        component: The scans.
        confidence: Of the accepted pairs.
    """
    scans = sorted(component.poses)
    at = {k: n for n, k in enumerate(scans)}
    carries = np.zeros((len(scans), len(scans)), dtype=np.int32)
    for (i, j), p in confidence.items():
        if i in at and j in at:
            carries[at[i], at[j]] = carries[at[j], at[i]] = round(-STEPS * float(np.log1p(-p)))
    graph, root = csr_array(carries), at[component.reference]
    found = {
        k: int(maximum_flow(graph, root, n).flow_value) / STEPS for k, n in at.items() if n != root
    }
    return {**found, component.reference: max(found.values())}
