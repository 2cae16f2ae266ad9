"""JSON for people and programs: short lists on one line, no NaN, always the same bytes."""

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(value: Mapping[str, Any]) -> str:
    """A JSON object as text; numbers that are not finite become null."""
    return _text(value, "\n") + "\n"


def _text(value: Any, newline: str) -> str:
    inner = newline + " "
    if isinstance(value, Mapping) and value:
        items = (f"{_leaf(str(key))}: {_text(item, inner)}" for key, item in value.items())
        return "{" + inner + ("," + inner).join(items) + newline + "}"
    if isinstance(value, list | tuple):
        items = [_text(item, inner) for item in value]
        if any(isinstance(item, Mapping | list | tuple) for item in value):
            return "[" + inner + ("," + inner).join(items) + newline + "]"
        return "[" + ", ".join(items) + "]"
    return _leaf(value)


def _leaf(value: Any) -> str:
    if isinstance(value, float):
        value = value + 0.0 if math.isfinite(value) else None  # + 0.0: no minus zero
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
