"""Numbers and scripts of a page as compressed text, which the browser unpacks.

All arrays of a page lie one behind the other in one block of Float32.
"""

import base64
import gzip
import json

import numpy as np


class Arrays:
    """The arrays of a page, each held once.

    `as_json` writes data in which arrays may lie at any depth, and puts references in their place.
    """

    def __init__(self):
        self._blocks: list[np.ndarray] = []
        self._first: dict[bytes, int] = {}  # content of each block: its first number
        self._count = 0

    def reference(self, values) -> object:
        """What stands for an array in the JSON: the place of its first number, and its shape.

        NumPy's scalars become Python's.
        """
        if isinstance(values, np.generic):
            return values.item()
        if not isinstance(values, np.ndarray):
            raise TypeError(f"a page cannot hold {type(values).__name__}")
        with np.errstate(over="ignore"):
            block = values.astype("<f4").ravel()
        key = block.tobytes()
        if key not in self._first:
            self._first[key] = self._count
            self._blocks.append(block)
            self._count += block.size
        return {"first": self._first[key], "shape": list(values.shape)}

    def as_json(self, data) -> str:
        """The data as JSON for a script element; no text in it can end the element.

        Numbers that are not finite become null. Arrays keep them.
        """
        text = json.dumps(finite(data), default=self.reference, allow_nan=False, ensure_ascii=False)
        return text.replace("<", "\\u003c")

    def packed(self) -> str:
        """All arrays as compressed text."""
        return packed(np.concatenate([np.empty(0, "<f4"), *self._blocks]).tobytes())


def finite(data):
    """The data with None for every float that is not finite."""
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [finite(value) for value in data]
    if isinstance(data, (float, np.floating)) and not np.isfinite(data):
        return None
    return data


def packed(content: bytes) -> str:
    """Compressed bytes as text of 64 characters; the same bytes give the same text."""
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
