"""What contrasts and images approximate: the size of the error, and the remark that states it.

The sizes are a part of a contrast's interval. They are approximate bounds, as the exact errors need
what tables do not state.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.detection.setting import Setting, Sightline
from mi_lcair.physics.air.atmosphere import AirLight, LineOfSight
from mi_lcair.physics.air.clear_air import ClearAir, ClearPaths, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M
from mi_lcair.physics.bands import Spectrum
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.sun import OUTSIDE_AIR
from mi_lcair.plugins.bsdfs.plume import spectral_plumes
from mi_lcair.plugins.emission.source import BinOfSpectrum, Source
from mi_lcair.rendering.scene import Scene
from mi_lcair.tasks import exclusively

# Light that has crossed air before the target, in a product of transmittances
# ----------------------------------------------------------------------------
# The amounts of absorbers of both paths add only if both are known, which tables do not state. What
# a table states, its radiance L, tells how much of it the air near the target has emitted: light of
# the air's own temperature, B, is as smooth as that of a blackbody, and the product is right for
# it. The rest, L - B, has passed air that transmits t. Behind the path, of transmittance T, it is
# (L - B) t(both) / t and not (L - B) T, whether it comes from a cloud, from space or from the sun.
# Clear air at a low elevation stands for t. It has more absorbers than most ways through the air
# below a cloud or to space, so that the size bounds the error. In 1 and 5 km of clear air it is 1
# to 2.7 times that of clear skies from 4.5 degrees up, and at most 0.11 of the light of low clouds.

STAND_IN = "us_standard"  # clear air that stands for air of which only a table is known
STAND_IN_DEG = 10.0  # elevation of the way through it


def shares_of_light(setting: Setting | Sightline, sources: list[Source]) -> np.ndarray:
    """Shares of the light of sources that the product of transmittances adds, (sources,).

    They are negative for light that is too dark, and 0 where the amounts of absorbers add, or where
    no light crosses air before the target.
    """
    shares, sun = np.zeros(len(sources)), setting.one_sun
    if setting.air.is_vacuum:
        return shares
    for k, source in enumerate(sources):
        part = source.spectrum
        light = part.bin_of if isinstance(part, BinOfSpectrum) else part
        if light is not None and light.name != OUTSIDE_AIR and not adds(setting, light):
            of_sun = sun is not None and source.group == sun.group
            shares[k] = share_of_product(setting, light, sun.elevation_deg if of_sun else None)
    return shares


def adds(setting: Setting | Sightline, light: Spectrum) -> bool:
    """Whether the amounts of absorbers before and after a reflection add, as both are known."""
    return isinstance(light, AirLight) and setting.path.amounts is not None


def share_of_reflections(setting: Setting | Sightline) -> float:
    """Share of the hidden background that the product adds to the light that its ground reflects.

    It is the size of an error, as `shares_of_light` has them, on the longer path to the ground.
    """
    behind, range_m = setting.backdrop, setting.path.range_m
    if setting.air.is_vacuum or behind.path_at is None:
        return 0.0
    along, band = replace(setting, path=behind.path_at(range_m)), setting.detector.band
    x = band.rows(along.path.wavelengths_um, behind.rows_um)
    passed, _ = along.path.at(x)
    added = sum(
        factor * share_of_product(along, light, None) * band.integral(x, light.at(x) * passed)
        for factor, light in behind.reflected
        if not adds(along, light)
    )
    return abs(added) / band.integral(x, behind.at_sensor(range_m).at(x)) if added else 0.0


def share_of_product(setting: Setting | Sightline, light: Spectrum, sun_deg: float | None) -> float:
    """Share of a light in the band that the product of transmittances adds, at most 1.

    sun_deg: elevation of the sun [degrees] if the light is the sun's; None for that of a sky.
    """
    sight, band = setting.sight, setting.detector.band
    air = setting.air.air if isinstance(setting.air, ClearPaths) else clear_air(STAND_IN)
    path = path_of(setting, air)
    x = path.wavelengths_um
    band.check_covered(x, f"air '{air.name}'")
    radiance = light.at(x)
    if isinstance(light, AirLight):
        added = radiance * (path.transmittance - light.transmittance(path.amounts))
    else:
        near = 0.0
        if sun_deg is None:
            near = spectral_radiance(x, air.levels.at(np.array([HEIGHT_M / 1000]))[1][0])
            # Of light that a ground has reflected, the same share, seen where air is opaque
            near = near * min(float((radiance / near).max()), 1.0)
        height_m = HEIGHT_M if sight.target_m is None else sight.target_m
        way = air.sun(height_m, STAND_IN_DEG if sun_deg is None else max(sun_deg, 1.0))
        added = (near - radiance) * (way.transmittance(path.amounts) - path.transmittance)
    product = band.integral(x, radiance * path.transmittance)
    return min(float(band.integral(x, added) / product), 1.0) if product > 0 else 0.0


def path_of(setting: Setting | Sightline, air: ClearAir) -> LineOfSight:
    """The path from target to sensor with its amounts of absorbers, those of clear air for a table.

    air: that clear air.
    """
    sight, path = setting.sight, setting.path
    if path.amounts is not None:
        return path
    heights = [height for height in (sight.observer_m, sight.target_m) if height is not None]
    low, up = min(heights, default=HEIGHT_M), abs(sight.elevation_deg)
    return ClearPaths(air.name, air, low, up, True, path.range_m).path(path.range_m)


def multiplied_light(sources: list[Source], shares: np.ndarray) -> list[str]:
    """Remark on the light that a product of transmittances changes most, in a list.

    shares: see `shares_of_light`.
    """
    if not np.any(shares):
        return []
    k = int(np.abs(shares).argmax())
    source, how = sources[k], "bright" if shares[k] > 0 else "dark"
    return [
        f"light of {source.group} ({source.spectrum.name}) has crossed air before the target, "
        "but a table does not contain its absorbers: transmittances are multiplied, which makes "
        f"this light up to about {percent(abs(shares[k]))} too {how}"
    ]


# Plumes by wavelength before a background
# ----------------------------------------


@exclusively
def share_of_background(scene: Scene, lines: Iterable) -> float:
    """Largest error of a background that a plume by wavelength hides, as a share of what it hides.

    It is 0 without such plumes, and before a sky of the scene. lines: lines of sight to the scene,
    each with its `detector`, `path` and `backdrop`.
    """
    errors = (
        error / max(1 - float(plume.transmittance[0]) ** 2, 1e-6)
        for plume, error in errors_behind(scene, lines)
    )
    return max(errors, default=0.0)


@exclusively
def averaged_plumes(scene: Scene, lines: Iterable) -> list[str]:
    """Remark on plumes by wavelength before a background that is no sky of the scene, in a list.

    lines: as for `share_of_background`.
    """
    error = max((error for _, error in errors_behind(scene, lines)), default=0.0)
    if not error:
        return []
    return [
        "where no sky of the scene is behind a plume by wavelength, the background is multiplied "
        "by the plume's mean transmittance; at two crossings this is an error of "
        f"{percent(error)} of the background; use [surroundings] instead"
    ]


def errors_behind(scene: Scene, lines: Iterable) -> list[tuple]:
    """Plumes by wavelength, each with the error of the background behind it, for each line."""
    plumes = [] if scene.mi.environment() is not None else spectral_plumes(scene.mi)
    return [(plume, error_behind(plume, line)) for line in lines for plume in plumes]


def error_behind(plume, line) -> float:
    """Error of the background behind a plume by wavelength, as a share of this background."""
    band, path, backdrop = line.detector.band, line.path, line.backdrop
    fine = np.linspace(band.lower_um, band.upper_um, 257)
    wavelengths_um = band.rows(fine, path.wavelengths_um, backdrop.rows_um)
    behind = backdrop.at_sensor(path.range_m).at(wavelengths_um)
    if not behind.any():
        return 0.0
    passed = 1 - plume.spectrum.at(wavelengths_um)["emissivity"]
    through = band.integral(wavelengths_um, behind * passed**2)
    share = through / band.integral(wavelengths_um, behind)
    return abs(float(share - plume.transmittance[0] ** 2))
