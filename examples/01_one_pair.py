"""Learn to register one pair of scans by hand, and to read the evidence for its pose.

No start pose is given. Several distinct poses come back, each with its score; the best one is held
against the truth.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import scanweld

if __name__ == "__main__":
    with TemporaryDirectory() as name:
        folder = Path(name) / "scans"
        truth = scanweld.simulate(scanweld.creature(voxels=70), folder, num_scans=8, pixels=140)
        first, second, *_ = scanweld.read_scans(folder)
    pair = scanweld.register_pair(first, second)

    print(f"{pair.kind}: margin {pair.margin:.2f}, observability {pair.observability:.1e}")
    for alternative in pair.alternatives[:3]:
        print(f"score {alternative.score:5.2f}: {alternative.i_from_j.angle_deg():5.1f} deg")
    if pair.i_from_j is not None and pair.evidence is not None:
        print(f"best: agree {pair.evidence.agree:.2f}, front {pair.evidence.front:.2f}")
        i_from_j = truth.poses[pair.i].inverse() @ truth.poses[pair.j]
        error = i_from_j.inverse() @ pair.i_from_j
        print(f"the best pose is {error.angle_deg():.2f} deg off the truth")
