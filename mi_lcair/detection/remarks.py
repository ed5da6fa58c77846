"""Remarks on what a contrast and an image approximate, with the size of the error."""

from collections.abc import Iterable

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.detection.setting import Setting
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.clear_paths import ClearPaths
from mi_lcair.physics.air.levels import HEIGHT_M
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.sun.sunlight import OUTSIDE_AIR
from mi_lcair.plugins.bsdfs.plume import spectral_plumes
from mi_lcair.plugins.emission.source import BinOfBlackbody, Source
from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.rendering.scene import Scene
from mi_lcair.startup.threads import exclusively

STAND_IN = "us_standard"  # clear air that stands for air of which only a table is known
STAND_IN_DEG = 45.0  # elevation of light that stands for a table's


def multiplied_light(setting: Setting, sources: list[Source]) -> list[str]:
    """Remark on the light that the product of transmittances changes most, in a list.

    It has crossed air before the target. The amounts of absorbers of both paths add only if both
    are known, which tables do not state. The size of the error is that of clear air.

    Parameters
    ----------
    setting : Setting
    sources : list of Source
        Sources of the scene.
    """
    if setting.air.is_vacuum:
        return []
    sun = one_sun(setting.view.mi.emitters())
    errors = {}
    for source in sources:
        light = source.spectrum
        is_known = isinstance(light, AirLight) and setting.path.amounts is not None
        is_emitted = light is None or isinstance(light, BinOfBlackbody)
        if is_emitted or light.name == OUTSIDE_AIR or is_known:
            continue
        of_sun = sun is not None and source.group == sun.group
        errors[f"{source.group} ({light.name})"] = product_error(setting, light, of_sun)
    if not errors:
        return []
    name = max(errors, key=lambda key: abs(errors[key]))
    sign = "bright" if errors[name] > 0 else "dark"
    return [
        f"light of {name} has crossed air before the target, but a table does not state its "
        "absorbers: transmittances are multiplied, which in clear air makes this light "
        f"{abs(errors[name]):.0%} too {sign}"
    ]


def product_error(setting: Setting, light, of_sun: bool) -> float:
    """Relative error of the product of spectrum and transmittance in the band, in clear air."""
    sight, path, band = setting.sight, setting.path, setting.detector.band
    clear = clear_air(STAND_IN)
    if path.amounts is None:
        heights = [h for h in (sight.observer_m, sight.target_m) if h is not None]
        low, up = min(heights, default=HEIGHT_M), abs(sight.elevation_deg)
        path = ClearPaths(STAND_IN, clear, low, up, True, path.range_m).path(path.range_m)
    if not isinstance(light, AirLight):
        height_m = HEIGHT_M if sight.target_m is None else sight.target_m
        light = (clear.sun if of_sun else clear.sky)(height_m, STAND_IN_DEG)
    band.check_covered(path.wavelengths_um, f"air '{STAND_IN}'")
    product = band.integral(path.wavelengths_um, light.radiance * path.transmittance)
    return float(product / band.integral(path.wavelengths_um, light.through(path.amounts)) - 1)


@exclusively
def averaged_plumes(scene: Scene, lines: Iterable) -> list[str]:
    """Remark on plumes by wavelength before a background that is no sky of the scene, in a list.

    lines: lines of sight to the scene, each with its `detector`, `path` and `backdrop`.
    """
    plumes = [] if scene.mi.environment() is not None else spectral_plumes(scene.mi)
    error = max((error_behind(plume, line) for line in lines for plume in plumes), default=0.0)
    if not error:
        return []
    return [
        "where no sky of the scene is behind a plume by wavelength, the background shines through "
        f"with its mean transmittance, {percent(error)} of this background off at two "
        "crossings; [surroundings] in place of [background] is by wavelength"
    ]


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
