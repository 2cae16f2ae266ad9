"""Records as bytes and back, by the names of their fields: no code can hide in the bytes.

What is written is the length of some JSON, the JSON, and the numbers of all arrays one after the
other; the JSON says what arrays these are, and where each belongs. An npz file takes ten times as
long for records of many small arrays. It is read back exactly or not at all.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

_PLAIN = (type(None), bool, int, float, str)
_NUMBERS = "biufcSU"
"""Kinds of arrays' types that can be kept: those that their bytes and a short name tell."""
_LENGTH_SIZE = 8
"""Bytes of the length of the JSON."""


class RecordError(ValueError):
    """Bytes that are not a record of the classes that are known, as these are now."""


class Records:
    """Writes and reads records of some classes, and of those that their fields are made of.

    Values are dataclasses, enums, tuples, arrays, numpy's scalars, and plain numbers, texts and
    None, inside each other to any depth. Read-only arrays come back read-only.

    Args:
        roots: Dataclasses. Classes that their fields' types name are known, too; no others.
    """

    def __init__(self, *roots: type) -> None:
        self._classes: dict[str, type] = {}
        for kind in _classes_within(roots):
            if self._classes.setdefault(kind.__name__, kind) is not kind:
                raise TypeError(f"two classes are called {kind.__name__}")

    def to_bytes(self, value: object) -> bytes:
        """A value as bytes.

        Raises:
            TypeError: If a part of it is of a class that is not known.
        """
        arrays: list[NDArray] = []
        tree = self._taken_apart(value, arrays)
        told = json.dumps({"tree": tree, "arrays": [_layout(array) for array in arrays]}).encode()
        numbers = [array.tobytes(_order(array)) for array in arrays]
        return b"".join([len(told).to_bytes(_LENGTH_SIZE, "little"), told, *numbers])

    def from_bytes(self, data: bytes | memoryview) -> object:
        """The value of some bytes.

        Raises:
            RecordError: If it cannot be read exactly: the bytes are damaged, or a class or a field
                is not known, or a field or an enum's value is missing.
        """
        try:
            start = _LENGTH_SIZE + int.from_bytes(data[:_LENGTH_SIZE], "little")
            told = json.loads(bytes(data[_LENGTH_SIZE:start]))
            arrays = _arrays(data[start:], told["arrays"])
            return self._put_together(told["tree"], arrays)
        except Exception as error:  # whatever is wrong with bytes of unknown origin
            raise RecordError(f"not a record: {error}") from error

    def _taken_apart(self, value: object, arrays: list[NDArray]) -> Any:
        """A value as JSON's types, its arrays put aside."""
        kind = type(value)
        if kind in _PLAIN:
            return value
        if isinstance(value, tuple) and kind is tuple:
            return {"tuple": [self._taken_apart(item, arrays) for item in value]}
        if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in _NUMBERS:
            arrays.append(np.asarray(value))
            if isinstance(value, np.generic):
                return {"scalar": len(arrays) - 1}
            return {"array": len(arrays) - 1, "frozen": not value.flags.writeable}
        if self._classes.get(kind.__name__) is not kind:
            raise TypeError(f"{kind.__qualname__} is not a class of records that are kept")
        if isinstance(value, Enum):
            return {"enum": kind.__name__, "value": value.value}
        parts = {
            field.name: self._taken_apart(getattr(value, field.name), arrays)
            for field in fields(value)  # type: ignore[arg-type]  # classes are dataclasses or enums
        }
        return {"record": kind.__name__, "fields": parts}

    def _put_together(self, tree: Any, arrays: list[NDArray]) -> object:
        if not isinstance(tree, dict):
            if type(tree) not in _PLAIN:
                raise RecordError(f"{tree!r} is no value")
            return tree
        if "tuple" in tree:
            return tuple(self._put_together(item, arrays) for item in tree["tuple"])
        if "scalar" in tree:
            return arrays[tree["scalar"]][()]
        if "array" in tree:
            array = arrays[tree["array"]]
            array.flags.writeable = not tree["frozen"]
            return array
        if "enum" in tree:
            return self._known(tree["enum"], Enum)(tree["value"])
        kind = self._known(tree["record"], object)
        given = {name: self._put_together(part, arrays) for name, part in tree["fields"].items()}
        names = {field.name for field in fields(kind)}
        if given.keys() != names:
            raise RecordError(f"{kind.__name__} has other fields now: {names ^ given.keys()}")
        return kind(**given)

    def _known(self, name: str, base: type) -> Any:
        kind = self._classes[name]
        if not issubclass(kind, base):
            raise RecordError(f"{name} is no {base.__name__}")
        return kind


def _order(array: NDArray) -> Literal["C", "F"]:
    """In which order the numbers of an array lie, or are put."""
    return "F" if array.flags.fnc else "C"


def _layout(array: NDArray) -> tuple[str, tuple[int, ...], str]:
    """What an array's bytes do not tell: its type, its shape and the order of its numbers."""
    return array.dtype.str, array.shape, _order(array)


def _arrays(data: bytes | memoryview, layouts: list[Any]) -> list[NDArray]:
    """The arrays whose numbers stand one after the other, each with memory of its own.

    Raises:
        RecordError: If there are more bytes, or fewer.
    """
    arrays, start = [], 0
    for name, shape, order in layouts:
        kind, count = np.dtype(name), math.prod(shape)
        if kind.kind not in _NUMBERS:
            raise RecordError(f"{name} is no type of numbers")
        flat = np.frombuffer(data, kind, count, start) if count else np.empty(0, kind)
        array = np.empty(shape, kind, order)
        array[...] = flat.reshape(shape, order=order)
        arrays.append(array)
        start += count * kind.itemsize
    if start != len(data):
        raise RecordError(f"{len(data)} bytes of numbers, not {start}")
    return arrays


def _classes_within(roots: tuple[type, ...]) -> Iterator[type]:
    """Dataclasses and enums among some classes and the types of their fields."""
    seen: set[type] = set()
    left: list[Any] = list(roots)
    while left:
        kind = left.pop()
        left += get_args(kind)
        if not isinstance(kind, type) or kind in seen:
            continue
        seen.add(kind)
        if issubclass(kind, Enum):
            yield kind
        elif is_dataclass(kind):
            if any(not field.init for field in fields(kind)):
                raise TypeError(f"{kind.__name__} has a field that cannot be given")
            left += get_type_hints(kind).values()
            yield kind
