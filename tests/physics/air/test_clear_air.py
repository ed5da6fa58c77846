"""Clear air against LOWTRAN7's own results, and against itself: a path in two parts."""

import csv
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from docs.studies.air import IN_WEATHER, in_weather, rows_of, spectrum
from mi_lcair.errors import InputError
from mi_lcair.physics.air.clear_air import ClearPaths, SunDirection, clear_air, ray, ray_end
from mi_lcair.physics.air.levels import bands, levels
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance

NAMES = ("us_standard", "midlat_summer")
X = bands().wavelengths_um


@cache
def expected(kind, name):
    """Geometries (n, 4), bands (n,) and values (n,) of LOWTRAN7."""
    lines = Path(__file__).with_name("lowtran7.csv").read_text().splitlines()
    rows = [
        row
        for row in csv.DictReader(line for line in lines if line[0] != "#")
        if row["kind"] == kind and row["air"] == name
    ]
    geometry = np.array([[float(row[key]) for key in "abcd"] for row in rows])
    return geometry, [row["band"] for row in rows], np.array([float(row["value"]) for row in rows])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("kind", "worst", "median"),
    [
        ("sky", 0.009, 0.0025),
        ("sky_transmittance", 0.008, 0.001),
        ("sun", 0.0065, 0.001),
        ("transmittance", 0.005, 0.0002),
        ("path_up", 0.004, 0.001),
        ("path_down", 0.005, 0.0005),
        ("day_sky", 0.01, 0.002),
    ],
)
def test_in_band_values_of_lowtran7(kind, worst, median, name):
    """Geometries between 0.05 and 12 km that are in no table of the product."""
    geometry, names, values = expected(kind, name)
    computed = []
    for place, of_band in zip(geometry, names):
        rule = band(of_band)
        if kind == "transmittance":
            lower_km, upper_km, elevation_deg, range_km = place
            line = clear_air(name).ray(1000 * lower_km, elevation_deg, 1000 * range_km)
            assert line.heights_km[-1] == pytest.approx(upper_km, abs=0.01)
        ones = rule.integral(X, np.ones_like(X)) if "transmittance" in kind else 1.0
        computed.append(rule.integral(X, spectrum(kind, name, *place)) / ones)
    error = abs(np.array(computed) / values - 1)
    assert error.max() < worst and np.median(error) < median


@pytest.mark.parametrize("name", NAMES)
def test_level_paths_from_7_to_14_um(name):
    """The bands of uncooled cameras, also the parts of them that LWIR lacks."""
    for kind in ("level_transmittance", "level_radiance"):
        for (height_km, range_km, *_), of_band, value in zip(*expected(kind, name)):
            path = (1000 * height_km, 0.0, True, 1000 * range_km)
            line = ClearPaths(name, clear_air(name), *path).path(1000 * range_km)
            spectrum_of = line.transmittance if "trans" in kind else line.radiance
            rule = band(of_band)
            computed = rule.integral(X, spectrum_of)
            if "trans" in kind:
                computed /= rule.integral(X, np.ones_like(X))
            assert computed == pytest.approx(value, rel=1.5e-3, abs=4e-4)


@pytest.mark.parametrize("name", NAMES)
def test_contrast_of_a_black_plate_before_the_night_sky(name):
    """Radiance of plates at 250-290 K through air less the sky behind, within 2 % or 1e-9 W/m^2.

    The plate fills 1 m^2 of the aperture's view. Linear interpolation in degrees between rows of
    the sky missed by up to 27 %.
    """
    geometry, names, values = expected("contrast", name)
    air = clear_air(name)
    for (elevation, range_km, kelvin, _), of_band, value in zip(geometry, names, values):
        if elevation > 30:
            continue  # the older slant table's levels are coarse for the vertical
        path = air.ray(50.0, elevation, 1000 * range_km)
        plate = bands().transmittance(path.amounts[-1]) * spectral_radiance(X, kelvin)
        sky = air.sky(50.0, elevation).radiance
        seen = plate + air.emitted(path).radiance - sky
        # Near zero the difference of two large numbers counts: 0.15 % of the sky
        of_sky = 1.5e-3 * band(of_band).integral(X, sky)
        tolerance = max(0.02 * abs(value), 1e-9 * (1000 * range_km) ** 2, of_sky)
        assert band(of_band).integral(X, seen) == pytest.approx(value, abs=tolerance)


def test_in_band_values_of_lowtran7_in_other_weather():
    """Warm, cold, humid, dry and hazy air, other pressures and carbon dioxide.

    Sunlight that white ground reflects tests the summed amounts of two paths. Humid air was off by
    up to 4 % where the aerosol kept the humidity of the model atmosphere. Of the day sky, one case
    in humid haze near the sun differs by 3.3 %.
    """
    worst = {"sky": 0.0, "sky_transmittance": 0.0, "reflected_sun": 0.0, "day_sky": 0.0}
    for row in rows_of(IN_WEATHER):
        value, kind = float(row["value"]), row["kind"]
        error = abs(in_weather(row) - value)
        if kind == "sky_transmittance":  # of a small one LOWTRAN7's mean humidity is worth 1 %
            error = max(error - 8e-4, 0)
        if kind == "day_sky" and row["humidity"] == "0.9" and row["azimuth"] == "10":
            error -= 0.03 * value * (row["height"] == "0.05")
        worst[kind] = max(worst[kind], error / value)
    assert worst["sky"] < 0.007
    assert worst["sky_transmittance"] < 0.002
    assert worst["reflected_sun"] < 0.009
    assert worst["day_sky"] < 0.008


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("elevation", [10.0, 30.0, 90.0])
def test_amounts_add_along_a_path_in_two_parts(elevation, name):
    """What lies beyond the first part, through its amounts, is what the whole shows.

    The product of the transmittances is off by 1.7 % and more.
    """
    air = clear_air(name)
    near = air.ray(50.0, elevation, 2000.0)
    height, turned = 1000 * near.heights_km[-1], near.elevations_deg[-1]
    amounts = near.amounts[-1]
    for whole, beyond, before in (
        (air.sun(50.0, elevation), air.sun(height, turned), 0.0),
        (air.sky(50.0, elevation), air.sky(height, turned), air.emitted(near).radiance),
    ):
        through = before + beyond.through(amounts)
        product = before + beyond.radiance * bands().transmittance(amounts)
        for of_band in ("MWIR", "LWIR"):
            total, sum_of_amounts, multiplied = (
                band(of_band).integral(X, values) - band(of_band).integral(X, before + 0 * X)
                for values in (whole.radiance, through, product)
            )
            assert sum_of_amounts == pytest.approx(total, rel=4e-3)
            assert abs(multiplied / total - 1) > 0.015
    share = air.sun(height, turned).transmittance(amounts)
    assert (share >= bands().transmittance(amounts) - 1e-12).all() and share.max() <= 1


def test_sky_from_horizontal_in_opaque_air_is_a_blackbody():
    """At 4.3 um the horizon shows the air at the viewer."""
    x = X[np.argmin(abs(X - 4.301))]
    sky = clear_air("us_standard").sky(50.0, 0.5)
    row = np.searchsorted(X, x)
    assert sky.radiance[row] == pytest.approx(float(spectral_radiance(x, 287.875)), rel=1e-3)


def test_scattered_light_of_thin_air_in_closed_form():
    """A short path scatters sun * phase * scattering amount * transmittance to the sun."""
    air, model = clear_air("us_standard"), bands()
    along = air.ray(2000.0, 0.0, 10.0)
    light = air.scattered(along, SunDirection(45.0, 60.0))
    angle = np.degrees(np.arccos(np.cos(np.radians(45)) * np.cos(np.radians(60))))
    density = air.levels.at(np.array([2.0]))[0][0]
    phases = [
        model.phase(k, np.array([angle]))[0] * model.scattering[k] * density[k] * 0.01
        for k in range(len(density))
        if model.scattering[k].any()
    ]
    direct = air.sun(2000.0, 45.0).radiance
    row = np.searchsorted(X, 3.9)  # a window, where 10 m of air lose nothing
    assert light.radiance[row] == pytest.approx(sum(phases)[row] * direct[row], rel=2e-3)


def test_what_cannot_be_computed():
    air = clear_air("us_standard")
    for call, message in (
        (lambda: clear_air("tropical"), "unknown air 'tropical'; known: .*midlat_summer"),
        (lambda: air.sky(-1.0, 10.0), r"height above the ground = -1 m; must lie in 0\.\.100000"),
        (lambda: air.sky(1e6, 10.0), r"must lie in 0\.\.100000"),
        (lambda: air.ray(0.0, 91.0), r"elevation = 91; must lie in -90\.\.90"),
        (lambda: air.sky(3000.0, -10.0), "ends at the ground, not in the sky"),
        (lambda: air.sun(0.0, 0.5), r"elevation of the sun = 0.5 degrees; must lie in 1\.\.90"),
    ):
        with pytest.raises(InputError, match=message):
            call()


def test_speed_of_a_scenario():
    """A sky of 12 rings, the sun and a path by day take 35 ms; 0.5 s allows for slow processors."""
    air, sun = clear_air("us_standard"), SunDirection(45.0, 60.0)

    def scenario():
        rings = [air.sky(50.0, elevation) for elevation in np.linspace(3, 87, 12)]
        return rings, air.sun(50.0, 45.0), air.emitted(air.ray(50.0, 10.0, 5000.0), sun)

    scenario()
    durations = []
    for _ in range(5):
        start = time.process_time()
        scenario()
        durations.append(time.process_time() - start)
    assert min(durations) < 0.5


# Clear air along one line of sight: between the computed ranges, and on to the ground
# ------------------------------------------------------------------------------------

AIR, CLEAR_PATHS_X = clear_air("us_standard"), bands().wavelengths_um
BANDS = [band(name) for name in ("MWIR", "LWIR")]


def line(elevation, looks_up, stated_m=None):
    return ClearPaths("air", AIR, 300.0, elevation, looks_up, stated_m)


@pytest.mark.parametrize("looks_up", [True, False])
@pytest.mark.parametrize("elevation", [0.0, 20.0])
def test_between_the_computed_ranges(looks_up, elevation):
    """In band within 0.2 % of a path that is computed itself, from 1 m to 30 km."""
    air = line(elevation, looks_up)
    for range_m in (1.0, 140.0, 2500.0, 30_000.0):
        path, exact = air.path(range_m), line(elevation, looks_up, range_m).path(range_m)
        ray = line(elevation, looks_up).ray(range_m)
        np.testing.assert_allclose(exact.amounts, ray.amounts[-1])
        for rule in BANDS:
            for name in ("transmittance", "radiance"):
                computed, expected = (
                    rule.integral(CLEAR_PATHS_X, getattr(p, name)) for p in (path, exact)
                )
                assert computed == pytest.approx(expected, rel=2e-3)


def test_the_stated_range_is_met_everywhere():
    air = line(20.0, False, 3210.0)
    path = air.path(3210.0)
    transmittance, radiance = air.along(np.array([3210.0, 3300.0]), slice(None))
    np.testing.assert_allclose(transmittance[0], path.transmittance, rtol=1e-9)
    np.testing.assert_allclose(radiance[0], path.radiance, rtol=1e-9)
    (mean,) = air.band_transmittance(BANDS[0], [np.ones_like(CLEAR_PATHS_X)], [3210.0])
    assert mean[0] == pytest.approx(
        BANDS[0].integral(CLEAR_PATHS_X, path.transmittance) / 2, rel=1e-6
    )


@pytest.mark.parametrize("ranges", [[500.0, 4000.0], list(np.geomspace(100, 20_000, 200))])
def test_light_that_has_crossed_air(ranges):
    """Its mean transmittance at each range is that of summed amounts, also of many ranges."""
    air, light = line(5.0, True), AIR.sky(300.0, 45.0)
    for rule in BANDS:
        with_light, plain = air.band_transmittance(rule, [light, light.radiance], ranges)
        for k in (0, len(ranges) // 2, -1):
            rest = light.through(air.path(ranges[k]).amounts)
            expected = rule.integral(CLEAR_PATHS_X, rest) / rule.integral(
                CLEAR_PATHS_X, light.radiance
            )
            assert with_light[k] == pytest.approx(expected, rel=3e-3)
        assert np.all(with_light < plain)


@pytest.mark.parametrize("to_ground", [False, True])
def test_share_of_a_light_between_ranges(to_ground):
    """Within 0.2 % of summed amounts in band, and at the stated range exactly."""
    air, light = line(20.0, False, 3000.0), AIR.sky(0.0, 45.0)
    for range_m, tolerance in ((777.0, 2e-3), (3000.0, 1e-9), (12_345.0, 2e-3)):
        path = air.to_ground(range_m) if to_ground else air.path(range_m)
        for rule in BANDS:
            computed = rule.integral(
                CLEAR_PATHS_X, path.share(light, CLEAR_PATHS_X) * light.radiance
            )
            expected = rule.integral(CLEAR_PATHS_X, light.through(path.amounts))
            assert computed == pytest.approx(expected, rel=tolerance)


def test_on_to_the_ground():
    """From the sensor past the target; the path to the target is a part of it."""
    air = line(20.0, False, 3000.0)
    for range_m in (3000.0, 2222.0):
        whole, exact = air.to_ground(range_m), line(20.0, False, range_m).to_ground(range_m)
        height = AIR.ray(300.0, 20.0, range_m).heights_km[-1] * 1000
        assert whole.range_m == pytest.approx(height / np.sin(np.radians(20)), rel=2e-3)
        for rule in BANDS:
            for name in ("transmittance", "radiance"):
                computed, expected = (
                    rule.integral(CLEAR_PATHS_X, getattr(p, name)) for p in (whole, exact)
                )
                assert computed == pytest.approx(expected, rel=2e-3)
        assert np.all(whole.transmittance <= air.path(range_m).transmittance + 1e-9)
    with pytest.raises(InputError, match="goes past the ground"):
        line(20.0, True).to_ground(3000.0)
    with pytest.raises(InputError, match="goes past the ground"):
        line(0.0, False).to_ground(3000.0)


def test_ranges():
    air = line(20.0, True)
    with pytest.raises(InputError, match="range 300000 m is beyond its last one, 200000 m"):
        air.path(300_000.0)
    with pytest.warns(UserWarning, match="is beyond its last one"):
        beyond = air.path(300_000.0, extrapolate=True)
    np.testing.assert_allclose(beyond.amounts, AIR.ray(300.0, 20.0).amounts[-1], rtol=1e-6)


# Rays through the air against the differential equation of a ray, solved apart
# -----------------------------------------------------------------------------

RAY_AIR = levels("us_standard")


def solved(height_km, elevation_deg, length_km):
    """Height [km] and elevation [degrees] at a ray's end, and amounts along it."""

    def slope(_, y):
        index, rate = RAY_AIR.refraction(np.array(y[0]))
        turn = np.cos(y[1]) * (1 / (6371.23 + y[0]) + rate / (1 + index))
        return [np.sin(y[1]), turn, *RAY_AIR.at(np.array(y[0]))[0]]

    start = [height_km, np.radians(elevation_deg), *np.zeros(RAY_AIR.densities.shape[1])]
    y = solve_ivp(slope, (0, length_km), start, rtol=1e-8, max_step=0.2).y[:, -1]
    return y[0], np.degrees(y[1]), y[2:]


@pytest.mark.parametrize(
    ("height", "elevation", "length"),
    [(0.05, 1, 50), (0.05, 30, 20), (8, -2, 120), (3, -30, 3), (0.5, 0, 10)],
)
def test_ray_of_the_differential_equation(height, elevation, length):
    along = ray(RAY_AIR, height, elevation, length)
    end, turned, amounts = solved(height, elevation, length)
    assert along.lengths_km[-1] == pytest.approx(length, rel=4e-4)
    assert along.heights_km[-1] == pytest.approx(end, abs=1e-3)
    assert along.elevations_deg[-1] == pytest.approx(turned, abs=0.03)
    ends = ray_end(RAY_AIR, height, elevation, length)
    last = along.lengths_km[-1], along.heights_km[-1], along.elevations_deg[-1]
    assert ends == pytest.approx(last, rel=4e-4, abs=1e-6)
    gases = [not name.startswith("aerosol") for name in bands().columns]
    np.testing.assert_allclose(along.amounts[-1][gases], amounts[gases], rtol=1e-3)
    # The aerosols change their class within layers. Their sum counts.
    aerosols = np.logical_not(gases)
    assert along.amounts[-1][aerosols].sum() == pytest.approx(amounts[aerosols].sum(), rel=2e-3)


def test_layers_grow_from_the_viewer():
    along = ray(RAY_AIR, 0.05, 90.0)
    thickness = np.diff(along.lengths_km)
    assert along.heights_km[-1] == pytest.approx(100) and thickness[0] < 0.0061
    assert (thickness < 0.21 * along.lengths_km[1:] + 0.006).all()
    low = along.heights_km[1:] < 30
    assert thickness[low].max() < 0.51 and thickness.max() < 2.1
    assert along.temperatures[0] == pytest.approx(287.86, abs=0.02)


def test_temperature_of_a_layer():
    """The mean by mass, which lies low in a thick layer: 0.1 K below the middle's."""
    along = ray(RAY_AIR, 0.05, 90.0)
    for low, high, temperature in zip(along.heights_km, along.heights_km[1:], along.temperatures):
        heights = np.linspace(low, high, 200)
        _, at_heights, pressure = RAY_AIR.at(heights)
        mean = np.average(at_heights, weights=pressure / at_heights)
        assert temperature == pytest.approx(mean, abs=0.02)


def test_ends_at_the_ground_and_at_the_top():
    down = ray(RAY_AIR, 3.0, -30.0)
    assert down.heights_km[-1] == pytest.approx(0, abs=1e-6)
    assert down.lengths_km[-1] == pytest.approx(6.0, rel=2e-3)
    grazing = ray(RAY_AIR, 10.0, -1.0)
    assert grazing.heights_km[-1] == pytest.approx(100) and 8 < grazing.heights_km.min() < 10
    assert ray(RAY_AIR, 100.0, 10.0).lengths_km[-1] < 1e-9


def test_angle_at_the_centre_of_the_earth():
    """Without refraction it would be atan(L cos / (R + h + L sin))."""
    along = ray(RAY_AIR, 0.05, 10.0, 40.0)
    cos, sin = 40 * np.cos(np.radians(10)), 40 * np.sin(np.radians(10))
    assert along.turned_deg[-1] == pytest.approx(np.degrees(cos / (6371.28 + sin)), rel=1e-3)
