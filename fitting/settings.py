"""Settings of a fit."""

from dataclasses import dataclass, field

import numpy as np

from mi_lcair.declared import check_fields, within
from mi_lcair.errors import check_known
from mi_lcair.fitting.loss import SCALES


@dataclass(frozen=True)
class FitSettings:
    """What is compared and how it is searched; see `fit`.

    Raises InputError for the first setting that is out of its range.
    """

    model: str
    form: str
    starts: int = field(metadata=within(lower=1))
    seed: int
    loss: str
    robust: bool
    max_angle_deg: float = field(metadata=within(is_positive=True, upper=90))
    min_brdf: float = field(metadata=within(lower=0))
    source_half_angle_deg: float = field(metadata=within(lower=0, upper=np.nextafter(90.0, 0)))

    def __post_init__(self):
        check_known("loss", SCALES, self.loss)
        check_fields(self)

    @property
    def half_angle(self) -> float:
        """Angular radius of the source [radians]."""
        return float(np.radians(self.source_half_angle_deg))
