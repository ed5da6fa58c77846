"""Recorder of the radiance by what emitted it."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.sources import WAVELENGTHS, Sources
from mi_lcair.plugins.recorders.recorder import Emission, Recorder, add_to, entries, zeros


@dataclass
class BySource(Recorder):
    """Radiance by source [W m^-2 sr^-1].

    by_wavelength: radiance from blackbodies at the wavelengths of `Sources` [W m^-2 sr^-1 um^-1],
    where there are too many blackbodies to record each separately. labels: the groups. most: the
    largest number of reflections that counts; None: all count. Its channels are group.LABEL and,
    in a tracer with sources by spectrum, source.N and wavelength.N. They begin with the prefix
    `up_to_prefix`.
    """

    sources: Sources
    labels: list
    sums: dr.Local
    by_wavelength: list
    most: int | None = None

    @staticmethod
    def of(sources: Sources, labels: list, most: int | None = None) -> "BySource":
        count = 0 if sources.share is None else WAVELENGTHS
        wavelengths, sums = [mi.Float(0) for _ in range(count)], zeros(len(sources.recorded))
        return BySource(sources, labels, sums, wavelengths, most)

    def emission(self, emission: Emission) -> None:
        value = dr.select(emission.beyond, 0, emission.radiance)
        if self.most is not None:
            value = dr.select(emission.bounce <= self.most, value, 0)
        for part, share_of_part in emission.parts:
            entry, of_part = self.sources.entry(emission.emitter, part), value * share_of_part
            add_to(self.sums, self.sources.number(entry), of_part)
            if self.by_wavelength:
                for k, share in enumerate(self.sources.shares(entry)):
                    self.by_wavelength[k] += of_part * share

    def samples(self, L) -> dict:
        groups = {label: mi.Float(0) for label in self.labels}
        by_source = entries(self.sums)
        for source, value in zip(self.sources.recorded, by_source):
            groups[source.group] += value
        channels = {f"group.{label}": value for label, value in groups.items()}
        if self.sources.by_spectrum and not self.sources.by_bin:
            channels |= {f"source.{k}": value for k, value in enumerate(by_source)}
        channels |= {f"wavelength.{k}": value for k, value in enumerate(self.by_wavelength)}
        return {f"{up_to_prefix(self.most)}{name}": value for name, value in channels.items()}


def up_to_prefix(most: int | None) -> str:
    """Beginning of the names of channels of at most so many reflections; "" for all."""
    return "" if most is None else f"upto.{most}."
