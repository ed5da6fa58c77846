"""What is recorded of the paths of a measurement beside their radiance."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from mi_lcair.plugins.columns.tables import ColumnTables
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.rays import ParallelRays
from mi_lcair.plugins.paths.sums import Sums
from mi_lcair.plugins.recorders.channels import Channels


@dataclass(frozen=True)
class Measurands:
    """What is recorded of the paths of a measurement.

    Attributes
    ----------
    channels : Channels
        Parts of the radiance, by name.
    facets : object or None
        Receiver of the samples by facet, see `PathTracer.trace`.
    by_spectrum : bool
        Whether emission is recorded for each spectrum of a group, not only for each group.
    reduced : callable or None
        Gives the `Sums` that are kept from those of a launch.
    """

    channels: Channels
    facets: object = None
    by_spectrum: bool = False
    reduced: Callable[[Sums], Sums] | None = None

    @staticmethod
    def of(split: str | None, by_spectrum: bool = False) -> "Measurands":
        """The channels of a split, see `Channels`."""
        return Measurands(Channels(split), by_spectrum=by_spectrum)

    def with_columns(self, tables: ColumnTables | None) -> "Measurands":
        """These measurands, and the derivatives with respect to the parameters of the tables."""
        return replace(self, channels=replace(self.channels, tables=tables))

    def trace(self, tracer, sensor, launch: Launch, rays: ParallelRays | None = None) -> Sums:
        """The sums of a launch through a sensor; rays: those of the sensor, if they are known."""
        sums = tracer.trace(sensor, launch, self.channels, self.facets, rays)
        return sums if self.reduced is None else self.reduced(sums)
