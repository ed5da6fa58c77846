"""Invented probes, for tests without a render."""

from types import SimpleNamespace

import numpy as np

from mi_lcair.physics.bands import band
from mi_lcair.planning.probe import Probe, Settings

LWIR = band("LWIR")
FULL = Settings(lobe={"paint": "brdf"}, max_bounces=32, emitter_sampling=False)
SCATTER = np.random.default_rng(0).normal(size=(64, 1))
SCATTER = (SCATTER - SCATTER.mean()) / SCATTER.std(ddof=1)  # mean 0, standard deviation 1


def probe(mean=1.0, noise=0.0, **changes) -> Probe:
    """A probe of a window with 64 randomisations that scatter by `noise`."""
    value = mean + noise * SCATTER
    return Probe(
        **{
            "value": value,
            "by_bounce": value[:, None, :],
            "closure": np.zeros((64, 1)),
            "reflections": 0,
            "segments": None,
            "paths": 2**13,
            "chance": 0.0,
        }
        | changes
    )


class Probes:
    """A series of probes that a function of the settings gives; `asked` lists the settings."""

    def __init__(self, give, each_pixel=False):
        self.give, self.each_pixel, self.asked, self.counts = give, each_pixel, [], []
        self.scene = SimpleNamespace(name="scene", band=LWIR, surfaces=list)
        self.factor = 1

    def __call__(self, settings, **counts):
        self.asked.append(settings)
        self.counts.append(counts)
        return self.give(settings)
