"""Components of a camera's noise by time, row and column, from its frames."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import read_bytes
from mi_lcair.rendering.images.radiometric import opened


class NoiseComponents(NamedTuple):
    """Standard deviations of the independent parts of three-dimensional noise, in the frames' unit.

    The letters are those of NVESD's model: t time, v rows, h columns. tvh: each pixel of each
    frame. vh, v, h: fixed pattern of pixels, rows and columns. tv, th, t: rows, columns and the
    whole frame, different in each frame.
    """

    sigma_tvh: float
    sigma_vh: float
    sigma_tv: float
    sigma_th: float
    sigma_v: float
    sigma_h: float
    sigma_t: float

    @staticmethod
    def of(frames: Iterable[np.ndarray]) -> "NoiseComponents":
        """The components of frames (H, W) of an even scene, of which one is held at a time.

        They are those of a three-way analysis of variance, so that no component holds a share of
        another, as those of D'Agostino and Webb (Proc. SPIE 1488, 1991) do for few samples. A
        variance that comes out negative is 0. Raises InputError for less than two frames, rows or
        columns, and for frames of other shapes or without finite numbers.
        """
        rows, columns, total, squares, level = [], [], 0.0, 0.0, None
        for number, frame in enumerate(map(np.atleast_2d, frames), 1):
            if frame.ndim != 2 or level is not None and frame.shape != total.shape:
                raise InputError(
                    f"frame {number} has the shape {frame.shape}; all have (rows, columns), alike"
                )
            if not np.all(np.isfinite(frame)):
                raise InputError(f"frame {number} has values that are not finite numbers")
            level = frame.mean() if level is None else level
            part = frame - level  # small numbers, whose squares keep their digits
            rows.append(part.mean(axis=1))
            columns.append(part.mean(axis=0))
            total, squares = total + part, squares + np.sum(part**2)
        shape = len(rows), *np.shape(total)
        if min(shape) < 2:
            raise InputError(f"noise of {shape} frames, rows, columns; give two or more of each")
        count = dict(zip("tvh", shape))
        mean = {"tv": np.array(rows), "th": np.array(columns), "vh": total / count["t"]}
        mean |= {"t": mean["tv"].mean(axis=1), "v": mean["tv"].mean(axis=0)}
        mean |= {"h": mean["th"].mean(axis=0), "": mean["t"].mean()}
        everything, square, variance = total.size * count["t"], {}, {}
        left = squares - everything * mean[""] ** 2
        for name in ("t", "v", "h", "tv", "th", "vh"):
            effect = mean[name] - mean[""]
            if len(name) == 2:
                effect = mean[name] - mean[name[0]][:, None] - mean[name[1]] + mean[""]
            explained = everything / effect.size * np.sum(effect**2)
            left -= explained
            square[name] = explained / np.prod([count[letter] - 1 for letter in name])
        # A mean square holds the variances of all parts that vary with its letters
        variance["tvh"] = square["tvh"] = left / np.prod([size - 1 for size in shape])
        for name, own in square.items():
            pairs = [square[pair] for pair in ("tv", "th", "vh") if len(name) == 1 and name in pair]
            others = sum(pairs) - variance["tvh"] if pairs else variance["tvh"]
            if name != "tvh":
                variance[name] = (own - others) * mean[name].size / everything
        sigmas = (variance[name.removeprefix("sigma_")] for name in NoiseComponents._fields)
        return NoiseComponents(*(float(np.sqrt(max(value, 0.0))) for value in sigmas))

    def in_mK(self) -> str:
        """The components of frames in kelvin, in words."""
        return ", ".join(f"{name} {1e3 * value:.3g} mK" for name, value in self._asdict().items())


def pages_of(path: str) -> Iterator[np.ndarray]:
    """Yield the pages (H, W) of a TIFF of frames. Raises InputError if it cannot be read."""
    from PIL import ImageSequence

    with opened(read_bytes(path), f"{path}: has no frames that can be read") as picture:
        for page in ImageSequence.Iterator(picture):
            yield np.asarray(page, dtype=float)
