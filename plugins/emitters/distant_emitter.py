"""Base class of emitters at infinity that have no mesh: the sun and the sky."""

import drjit as dr
import mitsuba as mi

from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import Weather
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emitters.thermal_emitter import EmitterParameter, ThermalEmitter
from mi_lcair.plugins.properties import BRIGHTEST

# Distance of a point of the emitter in Mitsuba's samples of directions [m]. Its square must be a
# Float32 number.
DISTANCE = 1e12
# Largest difference of the elevations of a sun and of the sun of a daytime sky [degrees].
ELEVATION_RANGE_DEG = 5.0


class DistantEmitter(ThermalEmitter):
    """An emitter at infinity, part of the background, whose radiance depends on the direction.

    A subclass needs the property `band`, sets `scale` and `spectrum`, and defines `along` and
    `facet_radiance`. By default, directions toward it are drawn uniformly over the hemisphere
    z > 0.

    scale : mi.Float
        The parameter that multiplies the radiance. In scenes it has the name SCALE and the unit
        SCALE_UNIT.
    """

    SCALE, SCALE_UNIT = "scale", "1"
    facet_type = "sky"
    clear_air = None  # name of the model atmosphere through which it shines, if it does
    weather = Weather()
    sin_radius = 0.0  # sine of the angular radius of a small disc

    def __init__(self, props):
        super().__init__(props)
        self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying
        if self.band is None:
            raise InputError(f"{props.plugin_name()}: give its `band`")
        self.scale, self.given_emissivity = mi.Float(1.0), mi.Float(1.0)

    def along(self, d, active):
        """Radiance from the direction `d`; 0 where it does not shine [W m^-2 sr^-1]."""
        raise NotImplementedError

    def drawn(self, sample):
        """A direction toward the emitter, from a uniform 2D sample."""
        return mi.warp.square_to_uniform_hemisphere(sample)

    def density(self, d):
        """Density with which `drawn` draws a direction [1/sr]."""
        return dr.select(d.z > 0, mi.Float(0.5 * dr.inv_pi), 0)

    def in_air(self, height_m: float | None, weather: Weather) -> None:
        """Take the light at a height above the ground [m] and in a weather, if it has `clear_air`.

        A height of its own stays. None: the height is not known.
        """

    def spectra_in(self, weather: Weather) -> list[Source]:
        """Its sources, as `spectra` gives them, in another weather of its `clear_air`."""
        return self.spectra()

    def parameters(self) -> list[EmitterParameter]:
        return [EmitterParameter(self.SCALE, "radiance", self.SCALE_UNIT, BRIGHTEST, self.SCALE)]

    def traverse(self, cb):
        mi.Emitter.traverse(self, cb)
        cb.put(self.SCALE, self.scale, mi.ParamFlags.Differentiable)

    @property
    def has_tables(self) -> bool:
        """Whether its radiance is known, as it is in a scene that is rendered."""
        return True

    def refresh(self) -> None:
        dr.make_opaque(self.scale, self.given_emissivity)

    # ---------------------------------------------------------------- Mitsuba's interface

    # Mitsuba calls all emitters of a process, also those of scenes that were never rendered

    def eval(self, si, active=True):
        if not self.has_tables:
            return mi.Spectrum(0)
        return self.along(-si.wi, active)  # of a ray that hits nothing, `wi` is in world space

    def toward(self, it, d, density):
        """Mitsuba's sample of the direction `d`, drawn with this density [1/sr]."""
        ds = dr.zeros(mi.DirectionSample3f, dr.width(d))
        ds.d, ds.p, ds.n = d, dr.fma(d, DISTANCE, it.p), mi.Normal3f(-d)
        ds.dist, ds.pdf = mi.Float(DISTANCE), density
        ds.time, ds.delta = it.time, False
        ds.emitter = mi.EmitterPtr(self)
        return ds

    def sample_direction(self, it, sample, active=True):
        if not self.has_tables:
            return dr.zeros(mi.DirectionSample3f), mi.Spectrum(0)
        d = self.drawn(sample)
        density = self.density(d)
        value = dr.select(density > 0, self.along(d, active) / density, 0)
        return self.toward(it, d, density), value

    def pdf_direction(self, it, ds, active=True):
        return dr.select(active, self.density(ds.d), 0) if self.has_tables else mi.Float(0)

    def eval_direction(self, it, ds, active=True):
        return self.along(ds.d, active) if self.has_tables else mi.Spectrum(0)

    def sample_position(self, time, sample, active=True):
        return dr.zeros(mi.PositionSample3f), mi.Float(0)  # it has no position

    def pdf_position(self, ps, active=True):
        return mi.Float(0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        return dr.zeros(mi.Ray3f), mi.Spectrum(0)

    def sample_wavelengths(self, si, sample, active=True):
        return dr.zeros(mi.Color0f), self.eval(si, active)

    def bbox(self):
        return mi.ScalarBoundingBox3f()  # empty: it is not a part of the scene's extent


def check_fits(sun, sky, name: str) -> None:
    """Raise InputError if the sun is not where a daytime sky has it.

    `sky` has a `sun_azimuth_deg` and a `sun_elevation_deg`; `name` says in the message what it is.
    """
    turn = (sun.azimuth_deg - sky.sun_azimuth_deg + 180) % 360 - 180
    if abs(turn) >= 0.01 or abs(sun.elevation_deg - sky.sun_elevation_deg) > ELEVATION_RANGE_DEG:
        raise InputError(
            f"the sun at azimuth {sun.azimuth_deg:g} and elevation {sun.elevation_deg:g} degrees "
            f"does not fit {name}, whose sun is at {sky.sun_azimuth_deg:g} and "
            f"{sky.sun_elevation_deg:g} degrees; it must have the same azimuth, and an elevation "
            f"within {ELEVATION_RANGE_DEG:g} degrees"
        )
