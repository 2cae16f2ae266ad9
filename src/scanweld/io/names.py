"""The order in which people expect names: 2 before 10."""

import re


def natural_key(text: str) -> tuple[list[str | int], str]:
    """Sort key by which numbers inside a text compare as numbers; the text itself breaks ties."""
    parts = re.split(r"([0-9]+)", text)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], text
