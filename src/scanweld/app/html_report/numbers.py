"""Numbers as people read them; the exact ones stand beside them on the page."""

import math

from scanweld.io.mesh_write import METRES

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def share(value: float | None) -> str:
    """A share as a percentage."""
    return "–" if _is_missing(value) else f"{100 * value:.0f}\u00a0%"  # type: ignore[operator]


def fine_share(value: float | None) -> str:
    """A small share as a percentage."""
    return "–" if _is_missing(value) else f"{100 * value:.1f}\u00a0%"  # type: ignore[operator]


def score(value: float | None) -> str:
    """A score or ratio with two decimals."""
    return "–" if _is_missing(value) else f"{value:.2f}"


def length(value: float | None, unit: str | None) -> str:
    """A length with three digits, and its unit if that is known; less than a metre in mm."""
    if value is None or _is_missing(value):
        return "–"
    metres = value * METRES[unit] if unit in ("m", "cm") else 0.0
    if 0 < metres < 1:
        value, unit = 1000 * metres, "mm"
    return f"{_plain(value)}\u00a0{unit}" if unit else _plain(value)


def of_diameter(value: float, diameter: float | None) -> str:
    """A length as a percentage of the diameter, with two digits."""
    if not diameter:
        return "–"
    return f"{_plain(100 * value / diameter, digits=2)}\u00a0%"


def count(value: float) -> str:
    """A whole number in groups of three digits, with thin spaces between."""
    return f"{value:,.0f}".replace(",", "\u202f")


def duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 90:
        return f"{seconds:.1f}\u00a0s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def _plain(value: float, digits: int = 3) -> str:
    """So many digits, without an exponent unless the number would be long."""
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -5 <= exponent < 6:
        return f"{value:.{max(digits - 1 - exponent, 0)}f}"
    raised = str(exponent).translate(_RAISED)
    return f"{value / 10.0**exponent:.{digits - 1}f}·10{raised}"


def _is_missing(value: float | None) -> bool:
    return value is None or not math.isfinite(value)
