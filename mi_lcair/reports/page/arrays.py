"""Numbers and scripts of a page as compressed text, which the browser unpacks.

All arrays of a page lie one behind the other in one block of Float32. Its bytes are sorted by
significance before the compression, because the first bytes of neighbouring numbers are alike.
"""

import base64
import gzip
import json

import numpy as np

# Bits of the significand that floats keep: one part in 130,000, more than the pages show.
KEPT_BITS = 16
DROPPED = 23 - KEPT_BITS


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

        NumPy's scalars become Python's. Floats are rounded to KEPT_BITS, integers are not.
        """
        if isinstance(values, np.generic):
            return values.item()
        if not isinstance(values, np.ndarray):
            raise TypeError(f"a page cannot hold {type(values).__name__}")
        block = rounded(values) if values.dtype.kind == "f" else values.astype("<f4").ravel()
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
        block = np.concatenate([np.empty(0, "<f4"), *self._blocks])
        return packed(block.view(np.uint8).reshape(-1, 4).T.tobytes())


def finite(data):
    """The data with None for every float that is not finite."""
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [finite(value) for value in data]
    if isinstance(data, (float, np.floating)) and not np.isfinite(data):
        return None
    return data


def rounded(values: np.ndarray) -> np.ndarray:
    """The values as Float32, rounded to KEPT_BITS of the significand, in one dimension."""
    with np.errstate(over="ignore"):
        values = np.asarray(values, "<f4").ravel()
    bits = np.where(np.isnan(values), np.float32(np.nan), values).view("<u4")
    half = (1 << (DROPPED - 1)) - 1 + ((bits >> DROPPED) & 1)  # ties go to the even number
    return ((bits + half) & np.uint32(~((1 << DROPPED) - 1) & 0xFFFFFFFF)).view("<f4")


def packed(content: bytes) -> str:
    """Compressed bytes as text of 64 characters; the same bytes give the same text."""
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
