"""JSON for people and programs: short lists on one line, no NaN, always the same bytes."""

import json
import math
from collections.abc import Mapping
from json.encoder import encode_basestring
from typing import Any

_LEAVES = (float, str, int, bool, type(None))


def json_text(value: Mapping[str, Any]) -> str:
    """A JSON object as text; numbers that are not finite become null."""
    return _text(value, "\n") + "\n"


def _text(value: Any, newline: str) -> str:
    # Most of what there is are numbers and texts, and to ask whether they are mappings is slow.
    if type(value) in _LEAVES:
        return _leaf(value)
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
        if not math.isfinite(value):
            return "null"
        return float.__repr__(value + 0.0)  # + 0.0: no minus zero
    if isinstance(value, str):
        return encode_basestring(value)
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
