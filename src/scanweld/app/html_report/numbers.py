"""Numbers as people read them; the exact ones stand beside them on the page."""

import math


def share(value: float | None) -> str:
    """A share as a percentage."""
    return "–" if _is_missing(value) else f"{100 * value:.0f} %"  # type: ignore[operator]


def fine_share(value: float | None) -> str:
    """A small share as a percentage."""
    return "–" if _is_missing(value) else f"{100 * value:.1f} %"  # type: ignore[operator]


def score(value: float | None) -> str:
    """A score or ratio with two decimals."""
    return "–" if _is_missing(value) else f"{value:.2f}"


def length(value: float | None, unit: str | None) -> str:
    """A length with three digits, and its unit if that is known."""
    if _is_missing(value):
        return "–"
    return f"{_plain(value)} {unit}" if unit else _plain(value)  # type: ignore[arg-type]


def count(value: float) -> str:
    """A whole number in groups of three digits, with thin spaces between."""
    return f"{value:,.0f}".replace(",", "\u202f")


def duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 90:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def _plain(value: float) -> str:
    """Three digits without an exponent, unless that would be long."""
    if value == 0 or 1e-4 <= abs(value) < 1e6:
        digits = 2 - math.floor(math.log10(abs(value))) if value else 0
        return f"{value:.{max(digits, 0)}f}"
    return f"{value:.2e}"


def _is_missing(value: float | None) -> bool:
    return value is None or not math.isfinite(value)
