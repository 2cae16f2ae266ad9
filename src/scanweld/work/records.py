"""Records as bytes and back, by the names of their fields: no code can hide in the bytes.

What is written is an npz file: the arrays, and the rest as JSON that says where each array belongs.
It is read back exactly or not at all.
"""

import io
import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

_PLAIN = (type(None), bool, int, float, str)
_TREE = "tree"
"""Name of the array that holds the JSON."""


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
        tree = json.dumps(self._taken_apart(value, arrays))
        stored = {f"a{k}": array for k, array in enumerate(arrays)}
        stored[_TREE] = np.frombuffer(tree.encode(), np.uint8)
        buffer = io.BytesIO()
        np.savez(buffer, **stored)  # type: ignore[arg-type]  # its other keyword is not ours
        return buffer.getvalue()

    def from_bytes(self, data: bytes | memoryview) -> object:
        """The value of some bytes.

        Raises:
            RecordError: If it cannot be read exactly: the bytes are damaged, or a class or a field
                is not known, or a field or an enum's value is missing.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                arrays = dict(stored)
            return self._put_together(json.loads(arrays[_TREE].tobytes()), arrays)
        except Exception as error:  # whatever is wrong with bytes of unknown origin
            raise RecordError(f"not a record: {error}") from error

    def _taken_apart(self, value: object, arrays: list[NDArray]) -> Any:
        """A value as JSON's types, its arrays put aside."""
        kind = type(value)
        if kind in _PLAIN:
            return value
        if isinstance(value, tuple) and kind is tuple:
            return {"tuple": [self._taken_apart(item, arrays) for item in value]}
        if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
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

    def _put_together(self, tree: Any, arrays: dict[str, NDArray]) -> object:
        if not isinstance(tree, dict):
            if type(tree) not in _PLAIN:
                raise RecordError(f"{tree!r} is no value")
            return tree
        if "tuple" in tree:
            return tuple(self._put_together(item, arrays) for item in tree["tuple"])
        if "scalar" in tree:
            return arrays[f"a{tree['scalar']}"][()]
        if "array" in tree:
            array = arrays[f"a{tree['array']}"]
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
