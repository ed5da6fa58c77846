"""Settings of a fit."""

from dataclasses import asdict, dataclass

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.fitting.loss import SCALES


@dataclass(frozen=True)
class FitSettings:
    """What is compared and how it is searched; see `fit`.

    half_angle: angular radius of the source [radians]. Raises InputError for the first setting that
    is out of its range.
    """

    model: str
    form: str
    starts: int
    seed: int
    loss: str
    robust: bool
    max_angle_deg: float
    min_brdf: float
    half_angle: float

    def __post_init__(self):
        if self.loss not in SCALES:
            raise unknown("loss", self.loss, list(SCALES))
        half_angle_deg = np.degrees(self.half_angle)
        for name, value, valid, right in (
            ("starts", self.starts, self.starts >= 1, "at least 1"),
            (
                "max_angle_deg",
                self.max_angle_deg,
                0 < self.max_angle_deg <= 90,
                "in 0..90, 0 excluded",
            ),
            ("min_brdf", self.min_brdf, self.min_brdf >= 0, "at least 0"),
            (
                "source_half_angle_deg",
                half_angle_deg,
                0 <= self.half_angle < 0.5 * np.pi,
                "in 0..90, 90 excluded",
            ),
        ):
            if not valid:
                raise InputError(f"{name} = {value:g} is out of range; it must be {right}")

    def as_dict(self) -> dict:
        """The settings by the names that `fit` gives them."""
        entries = asdict(self)
        return entries | {"source_half_angle_deg": float(np.degrees(entries.pop("half_angle")))}
