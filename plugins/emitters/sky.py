r"""Emitter `sky`: sky and ground around a scene, at infinity and without a mesh."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import excludes, needs, rule
from mi_lcair.physics.air.levels import Weather, model_names
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.materials import hemispherical_emissivity
from mi_lcair.physics.sky import air_mass
from mi_lcair.physics.sun import ClearSky
from mi_lcair.physics.surroundings import ATMOSPHERE, Blackbody, Ground, surroundings
from mi_lcair.plugins.derivatives import attached, held, same_variables
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter, check_fits
from mi_lcair.plugins.emitters.thermal_emitter import EmitterParameter
from mi_lcair.plugins.properties import BRIGHTEST, HOTTEST, Property, beside_scene

# Cells of the tables of radiances, above the horizon and below it, over the square root of the
# distance of the direction's z from that of the horizon; and over the square root of the angle from
# the sun above the horizon, and over the azimuth from the sun below it
ROWS, COLUMNS = 128, 90
NODES = np.linspace(0, 1, ROWS + 1) ** 2
NEAREST_DEG = 1e-6  # angle below the horizon of the first row of the ground's tables
MOST_KEPT = 32  # results that are kept for other values of the parameters
STEP = 0.1  # of a temperature, for its derivative [K]
LEAST = 1e-6  # what black ground reflects, so that its light has a derivative in the emissivity
NO_SKY = "none"
KELVIN, EMISSIVITY = ("temperature", "temperature", "K"), ("emissivity", "emissivity", "1")
# Angles above and below the horizon whose spectra stand for the directions between them [degrees]
SKY_RINGS_DEG = 0.05, 1, 2.2, 4, 6.5, 10, 15, 22, 32, 45, 62, 90
GROUND_RINGS_DEG = 0.1, 1, 3.5, 9, 20, 45, 90
ACROSS_DEG = 90.0  # azimuth from the sun of the spectra below the horizon
# Scattered sunlight has two spectra at an elevation: of light that is scattered by ASIDE_DEG or
# more, and of light from the sun's own direction, which are mixed so that the transmittance of
# MORE_AIR_M of air is right.
ASIDE_DEG, MORE_AIR_M = 25.0, 5000.0
TOWARD_SUN = 2  # number of the component of light from the sun's own direction
ANGLES = 26  # angles from the sun, 0..ASIDE_DEG, at which the mixture is computed


class Sky(DistantEmitter):
    r"""Sky above the horizon and ground below it, around everything.

    ================== ====== ======================================================================
    sky                string clear; overcast (low clouds); a temperature in K; a bundled sky; or a
                              CSV file of spectra, with or without elevations and azimuths from
                              the sun; none                                                (clear)
    ground_temperature float  temperature of the ground [K]; without it there is no ground
    ground_emissivity  float  emissivity of the ground, which reflects diffusely              (1.0)
    ground_material    string in its place: an emissivity, or a material, whose hemispherical
                              emissivity is taken
    atmosphere         string us_standard or midlat_summer                            (us_standard)
    sun_azimuth_deg    float  azimuth of the sun of a clear sky by day, from +x toward +y     (0.0)
    sun_elevation_deg  float  elevation of that sun, 1 or more; without it, it is night
    sun_file           string CSV file of the irradiance of that sun, which the ground reflects, as
                              for `air` of the emitter `sun`; without it, that of the atmosphere
    height_m           float  height of the scene above the ground [m]. Without it the sky is that
                              at 50 m, and no air is before the ground; a scenario gives the height
                              of its target
    band               string MWIR, LWIR, or a band that the sky covers
    group              string label of the sky, `[A-Za-z0-9_-]+`, at most 64 characters       (sky)
    ground_group       string label of the ground                                          (ground)
    ================== ====== ======================================================================

    .. code-block:: xml

        <emitter type="sky">
            <string name="band" value="LWIR"/> <string name="sky" value="clear"/>
            <float name="ground_temperature" value="288"/>
        </emitter>

    Rays that escape see the sky in directions above the horizon, and the ground below it. This
    emitter is the environment of the scene. A scene has at most one environment. With a height, the
    horizon is lower, and there is air in front of the ground. A ground that is not black reflects
    the mean radiance of the sky and, by day, the sun. This emitter does not include the disc of the
    sun: add a `sun` at the same azimuth.

    The parameters are `scale` of the sky, or `temperature` of a sky with one temperature, and
    `temperature` and `emissivity` of the ground. `scale` also multiplies the light that the ground
    reflects and the light of the air in front of the ground. With `emitter_sampling`, directions
    are sampled according to the radiance as a function of elevation. If sources are resolved by
    their spectra, the spectra of neighbouring rings of elevation are mixed. Emission and scattered
    sunlight are then separate sources. Near the sun, scattered light also contains the spectrum
    toward the sun.
    """

    is_divided = has_spectrum = True
    PROPERTIES = (
        Property("sky", "string", "clear", is_file=True),
        Property("ground_temperature", "float", is_positive=True, upper=HOTTEST, unit="K"),
        Property("ground_emissivity", "float", is_positive=True, upper=1),
        Property("ground_material", "string", is_file=True),
        Property("atmosphere", "string", ATMOSPHERE, choices=tuple(model_names())),
        Property("sun_azimuth_deg", "float", 0.0),
        Property("sun_elevation_deg", "float", lower=1, upper=90),
        Property("sun_file", "string", is_file=True),
        Property("height_m", "float", lower=0, upper=100_000),
        Property("band", "string", is_file=True),
        Property("group", "string", "sky", is_label=True),
        Property("ground_group", "string", "ground", is_label=True),
    )
    RULES = (
        excludes("ground_emissivity", "ground_material"),
        needs("ground_emissivity", "ground_temperature"),
        needs("ground_material", "ground_temperature"),
        rule(
            lambda t: t.sky != NO_SKY or t.ground_temperature is not None,
            f"sky = {NO_SKY} needs ground_temperature",
        ),
    )

    def __init__(self, props):
        super().__init__(props)
        values = self.values
        self.sun_azimuth_deg = values["sun_azimuth_deg"]
        self.sun_elevation_deg = values["sun_elevation_deg"]
        self.sun_file = values["sun_file"] and beside_scene(values["sun_file"])
        emissivity, material = values["ground_emissivity"], values["ground_material"]
        self.temperature = self.ground_temperature = self.ground_emissivity = None
        if values["ground_temperature"] is not None:
            if material is not None:
                emissivity = hemispherical_emissivity(material, self.band)
            self.ground_temperature = mi.Float(values["ground_temperature"])
            self.ground_emissivity = mi.Float(1.0 if emissivity is None else emissivity)
        azimuth, up = np.radians([self.sun_azimuth_deg, self.sun_elevation_deg or 0.0])
        across = np.cos(azimuth) * np.cos(up), np.sin(azimuth) * np.cos(up)
        self.toward_sun = mi.Vector3f(*map(float, (*across, np.sin(up))))
        self.height_m, self.tables, self.kept = values["height_m"], None, {}
        self.mixture = None
        around = self.around()
        if around.sky is not None:
            for light in around.components(45.0):
                light.in_band_radiance(self.band)  # raises InputError if it does not cover the band
            if around.sky.temperature is not None:
                self.temperature = mi.Float(around.sky.temperature)

    def keep(self, key: tuple, function, *arguments):
        """Result of a function, which is computed once for a key."""
        if key not in self.kept:
            if len(self.kept) > MOST_KEPT:
                self.kept.clear()
            self.kept[key] = function(*arguments)
        return self.kept[key]

    def around(
        self,
        sky_warmer=0.0,
        ground_warmer=0.0,
        emissivity: float | None = None,
        weather: Weather | None = None,
    ):
        """The `Surroundings` for the present parameters, or others.

        sky_warmer, ground_warmer: added to the temperatures [K]. emissivity: that of the ground.
        """

        def number(array):
            return float(dr.detach(array)[0])

        values, ground = self.values, None
        sky = None if values["sky"] == NO_SKY else values["sky"]
        if self.temperature is not None:
            sky = number(self.temperature) + sky_warmer
        if self.ground_temperature is not None:
            if emissivity is None:
                emissivity = number(self.ground_emissivity) - LEAST
            ground = Ground(number(self.ground_temperature) + ground_warmer, emissivity)
        words = sky, ground, self.sun_elevation_deg, values["atmosphere"], self.height_m
        words = *words, self.weather if weather is None else weather, self.sun_file
        return self.keep(words, surroundings, *words)

    @property
    def clear_air(self) -> str:
        return self.values["atmosphere"]

    def in_air(self, height_m, weather):
        if self.values["height_m"] is not None or height_m is None:
            height_m = self.height_m
        if (height_m, weather) != (self.height_m, self.weather):
            self.height_m, self.weather, self.tables = height_m, weather, None

    # ---------------------------------------------------------------- Tables

    @property
    def has_tables(self) -> bool:
        return self.tables is not None and self.derived is not None

    def shine(self) -> None:
        """Set all tables, if they are not set for the height."""
        if self.tables is not None:
            return
        around = self.around(emissivity=1.0)
        self.sin_horizon = float(np.sin(np.radians(around.horizon_deg)))
        self.columns = 0 if self.sun_elevation_deg is None else COLUMNS
        emitted, other, mean = self.tabulated(around)
        reflected = np.zeros(ROWS + 1)
        if self.ground_temperature is not None:
            half = self.tabulated(self.around(emissivity=0.5), [1])[1]
            reflected = 2 * (half[0] - other[1])[:, 0]
        self.tables = emitted, other, reflected
        self.other, self.reflected = mi.Float(other.ravel()), mi.Float(reflected)
        self.set_density(mean)
        self.set_rings(around)
        self.derived = self.derived_from = None

    def tabulated(self, around, halves=(0, 1)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """In-band radiance of both components at the nodes, (2, ROWS + 1) and (..., columns + 1).

        The first axis is that of `halves`, 0 for the sky and 1 for the ground. Behind them stands
        the mean of their sum over the azimuth, (2, ROWS + 1).
        """
        return self.keep(("table", around, *halves), self._tabulated, around, halves)

    def _tabulated(self, around, halves):
        azimuth, elevation = np.linspace(0, 180, self.columns + 1), self.elevations()
        elevation[0, 0] = around.horizon_deg
        elevation[1] = np.minimum(elevation[1], around.horizon_deg - NEAREST_DEG)
        directions = np.broadcast_arrays(elevation[list(halves), :, None], azimuth)
        emitted, other = around.in_band_components(self.band, *directions)
        emitted, mean = emitted[..., 0], other.mean(axis=2)
        if 0 in halves and around.sky is not None and around.sky.by_azimuth:
            angles = np.broadcast_arrays(elevation[0, :, None], 180 * (azimuth / 180) ** 2)
            other[0] = around.sky.in_band_by_angle(self.band, *angles)[1]
        return emitted, other, emitted + mean

    def elevations(self) -> np.ndarray:
        """Elevations of the nodes of the tables [degrees], (2, ROWS + 1)."""
        z = self.sin_horizon + np.outer([1 - self.sin_horizon, -1 - self.sin_horizon], NODES)
        return np.degrees(np.arcsin(np.clip(z, -1, 1)))

    def set_density(self, radiance: np.ndarray) -> None:
        """Set the density of drawn directions, which is even in cells of z.

        radiance: at the nodes, (2, ROWS + 1).
        """
        below = self.sin_horizon - (1 + self.sin_horizon) * NODES[:0:-1]
        edges = np.append(below, self.sin_horizon + (1 - self.sin_horizon) * NODES)
        of_cells = (radiance[:, 1:] + radiance[:, :-1]) / 2
        weights = np.concatenate([of_cells[1, ::-1], of_cells[0]]) * np.diff(edges)
        weights /= weights.sum()
        self.edges, self.summed = mi.Float(edges), mi.Float(np.append(0, np.cumsum(weights)))
        self.per_angle = mi.Float(weights / np.diff(edges) / (2 * np.pi))

    def set_rings(self, around) -> None:
        """Set the rings whose spectra stand for all directions, and the places of nodes among them.

        A part is a component of a ring, (half, component, elevation). Half 0 is the sky.
        """
        horizon, has_rings = around.horizon_deg, (False, around.is_through_air)
        if around.sky is not None:
            has_rings = around.sky.by_elevation, around.is_through_air
        angles = [
            np.array(rings if many else [45.0])
            for rings, many in zip((SKY_RINGS_DEG, GROUND_RINGS_DEG), has_rings)
        ]
        elevations = (
            np.minimum(horizon + angles[0] * (1 - horizon / 90), 90),
            np.maximum(horizon - angles[1] * (1 + horizon / 90), -90),
        )
        day = around.sky is not None and around.sky.by_azimuth
        present = [around.sky is not None] * (1 + day), [around.ground is not None] * 2
        self.parts, first = [], []  # first: number of the first part of each half and component
        for half in (0, 1):
            for component in (0, 1):
                first.append(len(self.parts))
                if component < len(present[half]) and present[half][component]:
                    self.parts += [(half, component, float(e)) for e in elevations[half]]
        self.first, self.rings = first, [len(of_half) for of_half in elevations]
        self.near = None  # first and last ring with a spectrum toward the sun
        if day and isinstance(around.sky, ClearSky):
            self.set_mixture(around.sky)
            from_sun = abs(elevations[0] - self.sun_elevation_deg)
            near = np.flatnonzero(from_sun <= max(ASIDE_DEG / 2, from_sun.min()))
            self.near = int(near[0]), int(near[-1])
            self.parts += [(0, TOWARD_SUN, float(e)) for e in elevations[0][near]]

        def at(angle):
            return -np.log(air_mass(np.abs(angle)))

        places = [
            np.interp(at(nodes - horizon), at(of_half - horizon), np.arange(len(of_half)))
            for nodes, of_half in zip(self.elevations(), elevations)
        ]
        self.places = mi.Float(np.concatenate(places))

    def set_mixture(self, sky) -> None:
        """Set the share of light from the sun's own direction in what is scattered by an angle.

        sky: the clear sky by day.
        """
        more = sky.air.ray(sky.height_m, 0.0, MORE_AIR_M).amounts[-1]

        def share(angle: float) -> float:
            light = sky.scattered_by(self.sun_elevation_deg, angle)
            rest = self.band.integral(light.wavelengths_um, light.through(more))
            return rest / light.in_band_radiance(self.band)

        shares = np.array([share(angle) for angle in np.linspace(0, ASIDE_DEG, ANGLES)])
        mixture = (shares - shares[-1]) / (shares[0] - shares[-1])
        self.mixture = mi.Float(np.clip(mixture, 0, 1))

    # ---------------------------------------------------------------- Parameters

    def sources(self) -> tuple:
        given = self.temperature, self.ground_temperature
        return tuple(parameter for parameter in given if parameter is not None)

    def derive(self) -> None:
        """Compute the table of emission, with derivatives with respect to both temperatures, and
        the factor of the light of the sky that the ground reflects.
        """
        self.derived_from = held(self.sources())
        emitted, steps = self.tables[0], np.zeros((2, ROWS + 1))
        if self.sources():
            emitted = self.tabulated(self.around(emissivity=1.0))[0]
        if attached(self.sources()):
            warm, cold = (self.tabulated(self.around(s, s, 1.0))[0] for s in (STEP, -STEP))
            steps = (warm - cold) / (2 * STEP)
        factor, count = mi.Float(1), ROWS + 1
        table, slopes = mi.Float(emitted.ravel()), mi.Float(steps.ravel())
        if self.temperature is not None:
            factor = mi.Float(in_band_radiance(self.band, self.temperature))
            factor /= float(in_band_radiance(self.band, float(self.values["sky"])))
        parameters = [
            mi.Float(0) if p is None else p for p in (self.temperature, self.ground_temperature)
        ]
        of_sky = dr.arange(mi.UInt32, 2 * count) < count
        table = dr.replace_grad(table, slopes * dr.select(of_sky, *parameters))
        self.derived = table, factor
        dr.make_opaque(table, factor)

    def refresh(self) -> None:
        super().refresh()
        self.shine()
        dr.make_opaque(self.places, self.toward_sun, self.edges, self.summed, self.per_angle)
        dr.make_opaque(self.mixture)
        dr.make_opaque(self.other, self.reflected, self.ground_emissivity, *self.sources())
        if self.derived_from is None or not same_variables(self.sources(), self.derived_from):
            self.derive()

    def parameters_changed(self, keys=()):
        self.shine()
        self.derive()

    def parameters(self) -> list[EmitterParameter]:
        described = []
        if self.temperature is not None:
            described.append(EmitterParameter(*KELVIN, HOTTEST, "temperature"))
        elif self.values["sky"] != NO_SKY:
            described.append(EmitterParameter("scale", "radiance", "1", BRIGHTEST, "scale"))
        if self.ground_temperature is not None:
            group = self.values["ground_group"]
            described += [
                EmitterParameter(*KELVIN, HOTTEST, "ground_temperature", group=group),
                EmitterParameter(*EMISSIVITY, 1.0, "ground_emissivity", group=group),
            ]
        return described

    def traverse(self, cb):
        mi.Emitter.traverse(self, cb)
        for parameter in self.parameters():
            cb.put(parameter.key, vars(self)[parameter.key], mi.ParamFlags.Differentiable)

    def relative_slopes(self, key: str) -> np.ndarray:
        """Derivative of each part's radiance with respect to a parameter, divided by it."""
        if key == "scale":
            return self.is_scaled / float(dr.detach(self.scale)[0])

        def radiances(*changes):
            lights = self.lights(self.around(*changes))
            return np.array([0.0 if x is None else x.in_band_radiance(self.band) for x in lights])

        if key == "ground_emissivity":  # in which all is linear
            now = float(dr.detach(self.ground_emissivity)[0])
            high, low, width = radiances(), radiances(0.0, 0.0, now / 2), now / 2
        else:
            step = (STEP, 0.0) if key == "temperature" else (0.0, STEP)
            high, low, width = radiances(*step), radiances(*np.negative(step)), 2 * STEP
        present = radiances()
        return np.divide((high - low) / width, present, np.zeros(len(present)), where=present > 0)

    def check_fits(self, sun) -> None:
        if self.sun_elevation_deg is not None:
            check_fits(sun, self, "the sky")

    def radiance_bound(self) -> np.ndarray:
        self.refresh()
        scale = float(dr.detach(self.scale)[0])
        emitted = dr.detach(self.derived[0]).numpy().reshape(2, -1).astype(float)
        other = np.where(self.is_met(), self.tables[1], 0).max(axis=2)
        if self.ground_emissivity is not None:
            reflectance = 1 - float(dr.detach(self.ground_emissivity)[0])
            factor = float(dr.detach(self.derived[1])[0])
            other[1] += reflectance * factor * self.tables[2]
            emitted[1] *= 1 - reflectance
        largest = emitted * [[scale], [1]] + scale * other
        return np.array([largest.max() * (1 + 1e-6)])

    def is_met(self) -> np.ndarray:
        """Which values of the table of scattered light directions have, (2, ROWS + 1, columns + 1).

        The angle from the sun is at least the difference of the elevations.
        """
        met = np.ones((2, ROWS + 1, self.columns + 1), bool)
        if self.near is not None:
            elevation = self.elevations()[0]
            least = abs(elevation - self.sun_elevation_deg) - np.diff(elevation).max()
            angles = 180 * np.linspace(0, 1, self.columns + 1) ** 2
            met[0] = np.append(angles[1:], 180) >= least[:, None]
        return met

    # ---------------------------------------------------------------- Parts

    @property
    def groups(self) -> list[str]:
        self.shine()
        names = self.group, self.values["ground_group"]
        return [names[half] for half, _, _ in self.parts]

    @property
    def is_scaled(self) -> np.ndarray:
        """Which parts the scale of the sky multiplies."""
        return np.array([half == 0 or component == 1 for half, component, _ in self.parts])

    def lights(self, around) -> list:
        """The spectrum of each part; None for a part without light."""
        self.shine()
        return self.keep(("lights", around), self._lights, around)

    def _lights(self, around):
        known, lights = {}, []
        for half, component, elevation in self.parts:
            if half == 0 and component > 0:
                aside = max(ASIDE_DEG, abs(elevation - self.sun_elevation_deg))
                angle = 0.0 if component == TOWARD_SUN else aside
                lights.append(around.sky.scattered_by(elevation, angle))
                continue
            if elevation not in known:
                known[elevation] = around.components(elevation, ACROSS_DEG)
            of_ring = known[elevation]
            lights.append(of_ring[component] if component < len(of_ring) else None)
        return lights

    def spectra(self) -> list[Source]:
        return self.spectra_in(self.weather)

    def spectra_in(self, weather):
        around, scale = self.around(weather=weather), float(dr.detach(self.scale)[0])
        return self.keep(("spectra", around, scale), self._spectra, around, scale)

    def _spectra(self, around, scale):
        sources = []
        of_parts = zip(self.parts, self.groups, self.lights(around), self.is_scaled)
        for (_, _, elevation), group, light, from_sky in of_parts:
            if isinstance(light, Blackbody):
                (source,) = Source.of_blackbodies(group, self.band, [light.temperature])
            elif light is None:
                source = Source(group, f"nothing {elevation:.4g} deg", 0.0)
            else:
                light = light.scaled(scale if from_sky else 1.0)
                name = f"{light.name.partition(' deg')[0]}, {elevation:.3g} deg"
                source = Source(group, name, light.in_band_radiance(self.band), spectrum=light)
            of_group = self.group if from_sky else group
            sources.append(replace(source, light_of=of_group))
        return sources

    def facet_radiance(self):
        return mi.Float([source.in_band for source in self.spectra()])

    def is_ground(self, d):
        """Whether a direction is below the horizon."""
        return d.z < self.sin_horizon

    def row(self, d):
        """Place of a direction among the nodes, its cell, and whether it is below the horizon."""
        height, below = d.z - self.sin_horizon, self.is_ground(d)
        span = dr.select(below, 1 + self.sin_horizon, 1 - self.sin_horizon)
        row = dr.sqrt(dr.minimum(dr.abs(height) / span, 1)) * ROWS
        return row, dr.minimum(mi.UInt32(row), ROWS - 1), below

    def along(self, d, active):
        """Radiance from the direction `d` [W m^-2 sr^-1]."""
        emitted, other, _, _ = self.components(d, active)
        return mi.Spectrum(emitted + other)

    def components(self, d, active):
        """Radiance of both components from `d`; whether it is that of the ground; its place among
        the rings.
        """
        row, i, below = self.row(d)
        up, first = row - mi.Float(i), i + dr.select(below, mi.UInt32(ROWS + 1), 0)
        table, factor = self.derived

        def at(values, index, stride=1):
            low, high = (dr.gather(mi.Float, values, k, active) for k in (index, index + stride))
            return dr.lerp(low, high, up)

        stride = self.columns + 1
        if self.columns:
            along, beside = dr.dot(d.xy, self.toward_sun.xy), d.y * self.toward_sun.x
            beside -= d.x * self.toward_sun.y
            azimuth, angle = dr.abs(dr.atan2(beside, along)), self.from_sun(d)
            column = dr.select(below, azimuth / dr.pi, dr.sqrt(angle / dr.pi)) * self.columns
            j = dr.minimum(mi.UInt32(column), self.columns - 1)
            near = at(self.other, first * stride + j, stride)
            far = at(self.other, first * stride + j + 1, stride)
            other = dr.lerp(near, far, column - mi.Float(j))
        else:
            other = at(self.other, first)
        emitted = at(table, first)
        if self.ground_emissivity is None:
            emitted = dr.select(below, emitted, self.scale * emitted)
        else:
            reflectance = 1 - self.ground_emissivity + LEAST
            emitted *= dr.select(below, 1 - reflectance, self.scale)
            other += dr.select(below, reflectance * factor * at(self.reflected, i), 0)
        other *= self.scale
        emitted, other = (dr.select(active, part, 0) for part in (emitted, other))
        return emitted, other, below, at(self.places, first)

    def parts_along(self, d, active) -> list:
        """Numbers and shares of the parts that make up the radiance from `d`."""
        emitted, other, below, place = self.components(d, active)
        total, shares = emitted + other, []
        most = dr.select(below, mi.UInt32(self.rings[1] - 1), self.rings[0] - 1)
        low = dr.minimum(mi.UInt32(place), most)
        up = place - mi.Float(low)
        for component, value in enumerate((emitted, other)):
            share = dr.select(total > 0, value / total, 0)
            first = dr.select(below, mi.UInt32(self.first[2 + component]), self.first[component])
            last = mi.UInt32(max(len(self.parts) - 1, 0))
            if component == 1 and self.near is not None:
                start, end = self.near
                toward = dr.select(below, 0, share * self.mixed(d, active))
                for ring, part in ((low, 1 - up), (low + 1, up)):
                    number = len(self.parts) - 1 - end + dr.clip(ring, start, end)
                    shares.append((number, toward * part))
                share -= toward
            shares.append((dr.minimum(first + low, last), share * (1 - up)))
            shares.append((dr.minimum(first + dr.minimum(low + 1, most), last), share * up))
        return shares

    def from_sun(self, d):
        """Angle of a direction from the sun."""
        return dr.safe_acos(dr.dot(d, self.toward_sun))

    def mixed(self, d, active):
        """Share of the spectrum toward the sun in what is scattered from the direction `d`."""
        step = dr.minimum(self.from_sun(d) / np.radians(ASIDE_DEG), 1) * (ANGLES - 1)
        k = dr.minimum(mi.UInt32(step), ANGLES - 2)
        near, far = (dr.gather(mi.Float, self.mixture, k + n, active) for n in (0, 1))
        return dr.lerp(near, far, step - mi.Float(k))

    # ---------------------------------------------------------------- Directions

    def drawn(self, sample):
        """A direction, by its radiance over the elevation."""
        cells = dr.width(self.per_angle)
        cell = dr.binary_search(
            0, cells, lambda k: dr.gather(mi.Float, self.summed, k + 1) <= sample.x
        )
        cell = dr.minimum(cell, cells - 1)
        low, high = (dr.gather(mi.Float, self.summed, cell + k) for k in (0, 1))
        share = dr.clip((sample.x - low) / dr.maximum(high - low, 1e-30), 0, 1)
        z = dr.lerp(*(dr.gather(mi.Float, self.edges, cell + k) for k in (0, 1)), share)
        sin, cos = dr.sincos(dr.two_pi * sample.y)
        across = dr.safe_sqrt(1 - dr.square(z))
        return mi.Vector3f(across * cos, across * sin, z)

    def density(self, d):
        _, i, below = self.row(d)
        return dr.gather(mi.Float, self.per_angle, dr.select(below, ROWS - 1 - i, ROWS + i))

    def to_string(self):
        return f"Sky[sky = {self.values['sky']}, scale = {self.scale}]"
