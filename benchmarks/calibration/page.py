"""The part of docs/trust.md that tells of the calibration."""

from typing import Any

from benchmarks.paper.pages import markdown_table

RELIABILITY, RISK = "calibration-reliability.png", "calibration-risk.png"

Json = dict[str, Any]


def calibration(found: Json) -> str:
    """The calibration in Markdown."""
    both = {"pairs": found["pair"], "scans": found["scan"]}
    told = (
        f"`{found['command']}`, on {found['machine']}: {found['sets']} sets of other objects than "
        "above, and none of them in the part of the calibration that it is measured by.\n\n"
    )
    rows = [
        (
            *(name, str(each["count"]), str(each["right"])),
            *(f"{each['auc']:.4f}", f"{each['error']:.3f}", f"{each['brier']:.3f}"),
        )
        for name, each in both.items()
    ]
    head = ("", "poses", "right", "AUC", "calibration error", "Brier score")
    return "\n".join(
        [
            told + markdown_table(head, rows),
            f"![share of right poses by stated confidence]({RELIABILITY})\n",
            f"![share of wrong poses among the most confident]({RISK})\n",
            *(_kept(name, each) for name, each in both.items()),
            *(_grounds(name, each) for name, each in both.items()),
        ]
    )


def _kept(name: str, found: Json) -> str:
    parts = [
        f"from {kept['least']:g} on {kept['right']} of {found['right']} right ones and "
        f"{kept['wrong']} wrong"
        for kept in found["kept"]
    ]
    return f"Of the {name} have a confidence {'; '.join(parts)}.\n"


def _grounds(name: str, found: Json) -> str:
    """How much worse the model is without each ground, the most important first."""
    lost = {ground: found["auc"] - less["auc"] for ground, less in found["without"].items()}
    ranked = sorted(lost, key=lambda ground: -lost[ground])
    told = ", ".join(f"{ground} {1e4 * lost[ground]:+.0f}" for ground in ranked)
    return f"AUC that {name} lose without a ground, in 0.0001: {told}.\n"
