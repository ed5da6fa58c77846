"""Tests of contrasts: a blackbody disc in closed form, standard errors, and unusable input."""

import csv
import warnings
from dataclasses import replace
from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

import mi_lcair
from mi_lcair.api.scenarios import contrast
from mi_lcair.detection import contrast as module
from mi_lcair.detection import setting
from mi_lcair.detection.contrast import check_met, check_reachable, remarks
from mi_lcair.detection.irradiance import TERMS, Backdrop, Irradiance, RenderError
from mi_lcair.detection.scenario import RenderTable, Scenario
from mi_lcair.errors import InputError
from mi_lcair.estimate import Estimate
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import TABLES, bands
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Detector
from mi_lcair.physics.sky import spectrum
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.scene import changed
from mi_lcair.rendering.views import Target, View, seen_from
from mi_lcair.signatures.effective_areas import EffectiveAreas
from tests.detection.disc_scenario import AREA, disc, lit, triangles, write_disc

LIMITS = {"MWIR": (3.0, 5.0), "LWIR": (8.0, 12.0)}


@pytest.fixture
def folder(tmp_path):
    write_disc(tmp_path)
    return tmp_path


def planck(x, T):
    """Planck's law, W m^-2 sr^-1 um^-1, with the published constants of CODATA 2018.

    Their units are W um^4 m^-2 sr^-1 and um K.
    """
    return 1.191042972e8 / x**5 / np.expm1(14387.76877 / (x * T))


def integral(band, values):
    """Integral of values(x) over a band, by the trapezoid rule on a very fine grid."""
    x = np.linspace(*LIMITS[band], 100_001)
    return np.trapezoid(values(x), x)


def closed_form(band, T, range_m, transmittance, path_radiance, background):
    """Contrast of the disc, W m^-2, seen along its normal (Eq 3.19)."""
    return (
        integral(band, lambda x: transmittance(x) * planck(x, T) + path_radiance(x) - background(x))
        * AREA
        / range_m**2
    )


def clear(range_km, elevation_deg):
    """Transmittance and path radiance of midlat_summer upward from 50 m.

    Both are functions of the wavelength.
    """
    air = clear_air("midlat_summer")
    along = air.ray(50.0, elevation_deg, 1000 * range_km)
    columns = bands().transmittance(along.amounts[-1]), air.emitted(along).radiance
    return [
        lambda x, column=column: np.interp(x, bands().wavelengths_um, column) for column in columns
    ]


@pytest.mark.slow
@pytest.mark.parametrize("T", [400, 250])  # above and below the background's temperature
@pytest.mark.parametrize("band", ["MWIR", "LWIR"])
def test_disc_in_vacuum(folder, band, T):
    """The contrast is within 0.2 % of (B(T) - B(294)) A / r^2."""
    result = contrast(disc(folder, sensor__band=band, target__parameters__temperature=T)).rows[0]
    expected = closed_form(band, T, 1000, np.ones_like, np.zeros_like, lambda x: planck(x, 294))
    assert (expected > 0) == (T > 294) and result.total.value == pytest.approx(expected, rel=2e-3)
    assert result.intensity.value == pytest.approx(
        AREA * integral(band, lambda x: planck(x, T)), rel=2e-3
    )
    assert result.solid_angle == pytest.approx(AREA / 1000**2, rel=2e-3) and result.path.value == 0


@pytest.mark.slow
@pytest.mark.parametrize("T, range_km", [(400, 2), (250, 1)])
@pytest.mark.parametrize("band", ["MWIR", "LWIR"])
def test_disc_through_a_bundled_atmosphere(folder, band, T, range_km):
    """The contrast before a bundled sky is within 0.2 % of the closed form.

    The line of sight lies between two elevations of the sky's table.
    """
    result = contrast(
        disc(
            folder,
            sensor__band=band,
            target__parameters__temperature=T,
            atmosphere__table="midlat_summer",
            background__sky="midlat_summer_stratus",
            observer__range_m=1000 * range_km,
            observer__elevation_deg=-8,
        )
    )
    sky = spectrum("midlat_summer_stratus", 8.0).at
    transmittance, path_radiance = clear(range_km, 8.0)
    slant = np.cos(np.radians(8))
    expected = slant * closed_form(
        band,
        T,
        1000 * range_km,
        transmittance,
        path_radiance,
        sky,
    )
    row = result.rows[0]
    assert (expected > 0) == (T > 294) and row.total.value == pytest.approx(expected, rel=2e-3)
    parts = {
        "target": lambda x: transmittance(x) * planck(x, T),
        "path": path_radiance,
        "background": sky,
    }
    for name, values in parts.items():
        assert getattr(row, name).value == pytest.approx(
            slant * integral(band, values) * AREA / (1000 * range_km) ** 2, rel=2e-3
        )
    assert result.sight_elevation_deg == 8
    assert result.transmittance == pytest.approx(
        integral(band, transmittance) / np.ptp(LIMITS[band]), rel=1e-5
    )


def test_quadrature(folder):
    """The quadrature agrees with a much finer one to 1e-5 for all bundled tables."""
    for name in LIMITS:
        result = contrast(
            disc(
                folder,
                sensor__band=name,
                atmosphere__table="midlat_summer",
                background__sky="midlat_summer_stratus",
                observer__elevation_deg=-5,
                render__resolution=16,
                render__spp=2,
            )
        )
        row, area = result.rows[0], result.rows[0].projected_area.value
        transmittance, path_radiance = clear(1, 5.0)
        assert row.target.value == pytest.approx(
            integral(name, lambda x: transmittance(x) * planck(x, 400)) * area / 1e6, rel=1e-6
        )
        assert row.path.value == pytest.approx(integral(name, path_radiance) * area / 1e6, rel=1e-6)


def totals(monkeypatch, folder, seeds: int, T=400, **changes):
    """Contrasts of the disc over seeds: errors and half widths as fractions of the closed form."""
    loaded = mi_lcair.load(folder / "disc.xml", temperature=f"{T}", band="MWIR")
    monkeypatch.setattr(setting, "load_with_values", lambda *_, **__: loaded)
    # The search for overlapping triangles takes three times as long as such a render
    monkeypatch.setattr("mi_lcair.rendering.loading.remarks.remarks_on_triangles", lambda _: [])
    changes |= {"target__parameters__temperature": T, "sensor__band": "MWIR"}
    rows = [contrast(disc(folder, **changes, render__seed=seed)).rows[0] for seed in range(seeds)]
    expected = closed_form("MWIR", T, 1000, np.ones_like, np.zeros_like, lambda x: planck(x, 294))
    errors = np.array([row.total.value for row in rows]) / expected - 1
    return rows, errors, np.array([row.half_width for row in rows]) / expected


@pytest.mark.slow
def test_errors_over_seeds(folder, monkeypatch):
    """The standard errors agree with the scatter over seeds.

    The background has nearly the disc's temperature. The scatter is therefore that of the area.
    """
    rows, *_ = totals(monkeypatch, folder, 40, 300, render__resolution=12, render__spp=2)
    for name in ("intensity", "target", "background", "total", "projected_area"):
        values, errors = np.array([getattr(row, name).pair for row in rows]).T
        assert values.var(ddof=1) == pytest.approx(np.mean(errors**2), rel=5 * np.sqrt(2 / 39)), (
            name
        )
    total, target = (
        np.mean([getattr(row, name).standard_error for row in rows]) for name in ("total", "target")
    )
    assert total < 0.3 * target


@pytest.mark.study
@pytest.mark.parametrize("spp", [4])
def test_the_intervals_cover_the_closed_form(folder, monkeypatch, spp):
    """The 95 % intervals of 90 % and more of 100 renders of 256 paths each hold the contrast.

    They are a little wide: where the randomisations agree, an edge may still lie along the film.
    """
    _, errors, half_widths = totals(monkeypatch, folder, 100, render__resolution=8, render__spp=spp)
    assert np.sum(np.abs(errors) <= half_widths) >= 90
    assert half_widths.mean() < 0.1


@pytest.mark.slow
def test_a_tolerance_is_kept(folder, monkeypatch):
    """At least 95 % of 40 renders to 1 % are within 1 % of the closed form, with few paths."""
    rows, errors, half_widths = totals(monkeypatch, folder, 40, render__tolerance=0.01)
    assert all(row.reached for row in rows) and half_widths.max() < 0.0102
    assert np.sum(np.abs(errors) <= 0.01) >= 38
    assert half_widths.mean() > 0.002  # the default, 64 samples per pixel, reaches 0.0005


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes, reached",
    [
        ({"render__tolerance": 0.02}, False),
        ({"render__tolerance_W_m2": 1e-6}, True),
        ({"render__tolerance": 0.02, "render__tolerance_W_m2": 1e-6}, True),
    ],
)
def test_a_contrast_of_zero_needs_an_absolute_tolerance(folder, changes, reached):
    """A disc as warm as its background. Without absolute tolerance the render ends at max_spp."""
    result = contrast(
        disc(
            folder,
            background__temperature=400,
            render__resolution=32,
            render__max_spp=16,
            **changes,
        )
    )
    (row,) = result.rows
    assert result.reached is row.reached is reached
    assert abs(row.total.value) < row.half_width < 1e-6
    (remark,) = result.remarks
    assert ("give tolerance_W_m2 of [render]" in remark) != reached


@pytest.mark.parametrize(
    "changes", [{"render__tolerance": 1e-7}, {"render__tolerance_W_m2": 1e-15}]
)
def test_a_tolerance_below_the_rounding_is_refused(folder, changes):
    with pytest.raises(InputError, match="cannot be reached: Float32's rounding"):
        contrast(disc(folder, render__resolution=16, render__max_spp=64, **changes))


@pytest.mark.slow
def test_each_number_of_reflections_ends_at_the_tolerance():
    """The contrasts of the airliner with 0 and 2 reflections, both to 2 %."""
    scenario = Scenario.read(
        "a340_landing/position_3",
        **{"sensor.band": "LWIR", "render.max_bounces": "[0, 2]", "render.tolerance": 0.02},
    )
    result = contrast(scenario)
    assert result.reached
    for row in result.rows:
        assert 0 < row.half_width <= 0.02 * abs(row.total.value)
        assert row.half_width >= 2.36 * row.total.standard_error
    entries = result.as_dict()
    assert (entries["tolerance"], entries["tolerance_W_m2"], entries["reached"]) == (
        0.02,
        None,
        True,
    )
    assert all(row["reached"] and row["half_width_W_m2"] > 0 for row in entries["rows"])


def kernels_by_row(monkeypatch, scenario):
    """Hashes of the kernels that trace paths, which are large, in the render of each row."""
    found, render = [], module.measure_signature

    def counted(*args, **kwargs):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            result = render(*args, **kwargs)
            history = dr.kernel_history([dr.KernelType.JIT])
            found.append({entry["hash"] for entry in history if entry["operation_count"] > 200})
        return result

    monkeypatch.setattr(module, "measure_signature", counted)
    contrast(scenario)
    return found


@pytest.mark.parametrize("sampling", [{"render__spp": 4}, {"render__tolerance": 0.1}])
def test_one_compile_for_all_numbers_of_reflections(folder, monkeypatch, sampling):
    """Renders of rows of their own: those with 2 to 4 reflections use the kernels of the first, 10
    need one more at most.
    """
    monkeypatch.setattr(module, "is_one_pass", lambda *_: False)
    scenario = disc(folder, render__max_bounces=[1, 2, 3, 4, 10], render__resolution=16, **sampling)
    many, first, *few = kernels_by_row(monkeypatch, scenario)[:5]
    assert first and len(few) == 3
    assert all(row <= first for row in few)
    assert len(many - first) <= 1


def test_a_tolerance_chooses_the_number_of_reflections(folder):
    """A disc before the void needs none; the scene's own number is back afterwards."""
    scenario = disc(folder, render__max_bounces="auto", render__tolerance=0.05)
    assert [row.max_bounces for row in contrast(scenario).rows] == [0]
    with pytest.raises(InputError, match="max_bounces = 'otto'; must be a whole number, or auto"):
        disc(folder, render__max_bounces="otto")


@pytest.mark.slow
def test_numbers_of_reflections_share_their_paths_also_with_a_tolerance():
    """Both rows of the airliner have the same emission and first reflections, to the rounding."""
    scenario = Scenario.read(
        "a340_landing/position_3",
        **{"sensor.band": "LWIR", "render.max_bounces": "[1, 4]", "render.tolerance": 0.03},
    )
    rows = module.rendered(module.setting_of(scenario), scenario.render, None)
    (_, _, few), (_, _, many) = rows
    assert few.reached and many.reached and few.paths == many.paths
    assert few.target.by_bounce == pytest.approx(many.target.by_bounce[:2], rel=1e-6)


@pytest.mark.parametrize(
    "name, entries",
    [
        ("a340_landing/position_1", {"render.spp": 4, "render.resolution": 64}),
        ("a340_landing/position_1", {"render.tolerance": 0.9}),
    ],
)
def test_one_pass_has_the_rows_of_separate_renders(name, entries, monkeypatch):
    """Contrasts, errors and half widths to the rounding, in the order that was asked for."""
    rows, measured = {}, module.measure_signature
    for way in ("one pass", "apart"):
        calls = []
        monkeypatch.setattr(
            module,
            "measure_signature",
            lambda *args, **options: calls.append(1) or measured(*args, **options),
        )
        if way == "apart":
            monkeypatch.setattr(module, "is_one_pass", lambda *_: False)
        scenario = Scenario.read(name, **entries, **{"render.max_bounces": [4, 1, 2]})
        rows[way] = module.measure_contrast(scenario, None).rows
        assert (len(calls) == 1) == (way == "one pass")
    for one, apart in zip(*rows.values(), strict=True):
        assert one.max_bounces == apart.max_bounces and one.reached == apart.reached
        assert one.total.pair == pytest.approx(apart.total.pair, rel=1e-5)
        assert one.half_width == pytest.approx(apart.half_width, rel=1e-4)
    assert [row.max_bounces for row in rows["one pass"]] == [4, 1, 2]
    totals = [row.total.value for row in rows["one pass"]]
    assert totals[1] < totals[2] < totals[0]


def test_a_closure_has_a_render_for_each_row(folder):
    """What the closure adds depends on the number of reflections that are followed."""
    scenario = disc(folder, render__max_bounces=[1, 3], render__spp=2, render__resolution=8)
    view = module.setting_of(scenario).view
    assert module.is_one_pass(view, 3) and not module.is_one_pass(view, 100)
    with changed(view, closure="ambient", ambient_temperature=300.0):
        assert not module.is_one_pass(view, 3)


def test_what_no_path_has_met_counts():
    """The half width is Student's interval plus the source that no path has met."""
    sky = Backdrop("sky", lambda x: spectral_radiance(x, 290.0), np.empty(0))
    response = np.array([[8.0, 10.0, 12.0], [0.0, 0.5, 0.0]])
    of_response = replace(band_of("LWIR"), response=response)
    areas = EffectiveAreas(
        band=band_of("LWIR"),
        sources=[Source("self", "330 K", 1.0, 330.0)],
        amounts=np.full((2, 2), 10.0),
        error=np.full((2, 1), 0.1),
        covariance=np.full((2, 2, 2), 0.01),
        nodes_um=np.empty(0),
    )
    vacuum = atmosphere("vacuum")

    def make(*uncertain):
        return Irradiance(areas, RenderError(*uncertain), of_response, vacuum, sky)

    path = vacuum.path(100.0)
    error = make().at(path)["total"].standard_error
    assert make().half_width(path) == pytest.approx(1.959964 * error)
    assert make(7).half_width(path) == pytest.approx(2.364624 * error)
    assert make(7, 3.0).half_width(path) == pytest.approx(
        2.364624 * error + 3.0 * 0.5 / 100.0**2, rel=1e-3
    )


@pytest.mark.slow
def test_temperatures_that_are_too_many(tmp_path):
    """Many temperatures give the closed form, and errors that are at least the scatter."""
    corners = triangles()
    temperatures = 300 + np.arange(len(corners)) % 100
    write_disc(tmp_path, temperatures)
    rows = [
        contrast(disc(tmp_path, render__resolution=12, render__spp=2, render__seed=seed)).rows[0]
        for seed in range(20)
    ]
    areas = (
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        / 2
    )
    expected = (
        sum(
            areas[temperatures == T].sum() * integral("MWIR", lambda x: planck(x, T))
            for T in range(300, 400)
        )
        / 1e6
    )
    values, errors = np.array([row.target.pair for row in rows]).T
    assert abs(values.mean() - expected) < 4 * errors.mean() / np.sqrt(20)
    total, total_errors = np.array([row.total.pair for row in rows]).T
    assert total.var(ddof=1) < np.mean(total_errors**2) * (1 + 5 * np.sqrt(2 / 19))
    # A window that holds more of the target hides more of the background
    row = rows[0]
    assert row.total.standard_error < row.target.standard_error + row.background.standard_error


@pytest.mark.slow
def test_detector(folder):
    """Field of view and noise (Eqs 3.14, 3.15, 3.18), with a response within the band."""
    (folder / "detector.csv").write_text("wavelength_um,response\n3.2,0\n4,0.8\n4.6,0\n")
    result = contrast(
        disc(
            folder,
            sensor__response=str(folder / "detector.csv"),
            sensor__optics_transmittance=0.7,
            sensor__field_of_view_deg=2,
            sensor__nei=1e-9,
            sensor__snr=5,
            render__max_bounces=[0, 2],
        )
    )
    first, last = result.rows
    response = lambda x: np.interp(x, [3.2, 4, 4.6], [0, 0.8, 0])  # noqa: E731
    expected = (
        integral("MWIR", lambda x: response(x) * (planck(x, 400) - planck(x, 294))) * AREA / 1e6
    )
    assert first.total.value == pytest.approx(expected, rel=2e-3)
    assert first.nei_max.value == pytest.approx(0.7 * first.total.value / 5) and first.detected
    background = integral("MWIR", lambda x: response(x) * planck(x, 294))
    assert result.no_target == pytest.approx(
        background * 2 * np.pi * (1 - np.cos(np.radians(1))), rel=1e-5
    )
    assert first.observed == pytest.approx(result.no_target + first.total.value)
    assert (
        (first.max_bounces, last.max_bounces) == (0, 2)
        and first.target.pair == pytest.approx(last.target.pair, rel=1e-6)
        and first.target.value == last.target.value
        and not result.remarks
    )
    dim = contrast(disc(folder, sensor__nei=1, sensor__field_of_view_deg=0.1, render__resolution=8))
    assert (
        not dim.rows[0].detected
        and "wider than the field of view" in dim.remarks[0]
        and dim.rows[0].observed is None
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "range_m, remark",
    [(50.0, None), (1000.0, "terrain is in front of up to 50 %"), (10.0, "only 5 radii")],
)
def test_what_stands_between_and_what_is_near_is_remarked(folder, range_m, remark):
    """A wall in front of the target, and a short range, are remarked.

    The wall at x = 100 m hides the half of the disc with y > 0 from an observer beyond it.
    """
    wall = """<shape type="rectangle">
        <transform name="to_world">
            <scale x="5" y="5"/> <lookat origin="100, 5, 0" target="0, 5, 0" up="0, 0, 1"/>
        </transform>
        <bsdf type="diffuse"/>
        <emitter type="thermal">
            <string name="band" value="$band"/> <float name="temperature" value="280"/>
            <string name="facet_type" value="terrain"/>
        </emitter>
    </shape> </scene>"""
    xml = folder / "disc.xml"
    xml.write_text(xml.read_text().replace("</scene>", wall))
    said = contrast(disc(folder, observer__range_m=range_m, render__resolution=16)).remarks
    assert len(said) == (remark is not None) and (remark is None or remark in said[0])


def test_contrast_within_the_noise_is_remarked(folder):
    result = contrast(disc(folder, render__resolution=8))
    row, target = result.rows[0], SimpleNamespace(radius=2.0)
    for total, count in ((Estimate(-2.9, 1.0), 1), (Estimate(-3.1, 1.0), 0)):
        for reached, remedy in (
            (None, "raise spp"),
            (True, "lower the tolerance"),
            (False, "give tolerance_W_m2 of [render]"),
        ):
            rows = [replace(row, total=total, reached=reached)]
            said = module.remarks(rows, result.detector, target, 1000)
            assert len(said) == count and all(
                "with 1 reflections the contrast is less than 3" in remark
                and remark.endswith(remedy)
                for remark in said
            )


@pytest.mark.parametrize(
    "changes, message",
    [
        (
            {"atmosphere__table": "midlat_summer", "sensor__band": "SWIR"},
            "atmosphere 'midlat_summer': does not cover band SWIR",
        ),
        (
            {
                "background__sky": "us_standard_clear",
                "observer__elevation_deg": -5,
                "sensor__band": "4-6",
            },
            "does not cover band 4-6",
        ),
        (
            {"atmosphere__table": "midlat_summer", "observer__range_m": 300_000},
            "range 300000 m is beyond its last one, 200000 m",
        ),
        (
            {"atmosphere__table": "midlat_sumer"},
            "unknown atmosphere 'midlat_sumer'; known: midlat_summer",
        ),
        (
            {"background__sky": "midlat_summer_clear", "observer__elevation_deg": 5},
            "scenario 'disc': the line of sight looks down, by 5 degrees, .* give "
            "\\[background\\] a temperature",
        ),
        ({"background__sky": "midlat_summer"}, "unknown sky table 'midlat_summer'"),
    ],
)
def test_refused_before_anything_is_loaded(folder, monkeypatch, changes, message):
    monkeypatch.setattr(setting, "load_with_values", None)
    with pytest.raises(InputError, match=message):
        contrast(disc(folder, **changes))


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes, message",
    [
        (
            {"observer__range_m": 1.9},
            "observer is inside the target: range 1.9 m, but the target reaches 2 m",
        ),
        ({"render__lobe": "mirrror"}, "unknown lobe 'mirrror'"),
        ({"pose__yaw_deg": 5}, "unknown parameter of disc.xml 'yaw_deg'"),
        ({"render__resolution": 10**6}, "resolution = 1000000; must lie in 1..8192"),
        ({"observer__azimuth_deg": 90}, "no ray hit the target"),
    ],
)
def test_refused_before_the_rest(folder, changes, message):
    with pytest.raises(InputError, match=message):
        contrast(disc(folder, **changes))


def test_bands_that_do_not_meet(folder):
    """The band of a scene without a parameter for it must include the sensor's band."""
    text = (
        (folder / "disc.xml")
        .read_text()
        .replace('<default name="band" value="MWIR"/>', "")
        .replace("$band", "3-5")
    )
    (folder / "disc.xml").write_text(text)
    assert (
        contrast(disc(folder, sensor__band="3.5-4.5", render__resolution=8)).detector.band.label
        == "3.5-4.5 um"
    )
    with pytest.raises(InputError, match="band LWIR 8-12 um is not within that of disc, 3-5 um"):
        contrast(disc(folder, sensor__band="LWIR"))


def test_a_scene_without_lobes(folder):
    text = (folder / "disc.xml").read_text()
    start, end = text.index("<bsdf"), text.index("</bsdf>") + len("</bsdf>")
    (folder / "disc.xml").write_text(
        text[:start]
        + '<bsdf type="diffuse"> <spectrum name="reflectance" value="0"/> </bsdf>'
        + text[end:]
    )
    with pytest.raises(InputError, match="no material with a fidelity ladder"):
        contrast(disc(folder, render__lobe="mirror"))


def test_extrapolation_warns_once(folder):
    rows = [f"{R},{x},{0.8**R},0.1" for R in (1, 5) for x in np.linspace(3, 5, 99)]
    header = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um"
    (folder / "air.csv").write_text("\n".join([header, *rows]))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        contrast(
            disc(
                folder,
                atmosphere__table=str(folder / "air.csv"),
                atmosphere__extrapolate="true",
                observer__range_m=6000,
                render__resolution=8,
            )
        )
    assert len(caught) == 1 and "6000 m is beyond" in str(caught[0].message)


@pytest.mark.slow
def test_a_sky_without_elevations_is_taken_as_it_is(folder):
    x = np.linspace(2.9, 5.1, 2001)
    (folder / "sky.csv").write_text(
        "wavelength_um,radiance_W_m2_sr_um\n"
        + "".join(f"{a:.6f},{b:.9e}\n" for a, b in zip(x, planck(x, 294)))
    )
    options = {"observer__elevation_deg": 20, "render__resolution": 16}
    flat = contrast(disc(folder, background__sky=str(folder / "sky.csv"), **options)).rows[0]
    assert flat.total.value == pytest.approx(
        contrast(disc(folder, **options)).rows[0].total.value, rel=1e-5
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3])
def test_bundled_positions(number):
    """The observers of the bundled scenarios are in the directions of the scene's sensors."""
    from mi_lcair.rendering.window import window

    scenario = Scenario.read(
        f"a340_landing/position_{number}",
        **{"render.resolution": 32, "render.spp": 2, "render.max_bounces": 1},
    )
    *_, forward = window(mi_lcair.load("a340_landing", position=number, resolution=4).sensor(0))
    azimuth, elevation = np.radians(
        [scenario.observer.azimuth_deg, scenario.observer.elevation_deg]
    )
    toward = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    np.testing.assert_allclose(toward, -np.array(forward), atol=1e-5)
    expected = [(-1000, 500, -50), (0, 500, -100), (1000, 500, -150)][number - 1]
    np.testing.assert_allclose(scenario.observer.range_m * toward, expected, atol=1e-3)
    assert contrast(scenario).rows[0].total.value > 0


@pytest.mark.slow
def test_plot(folder, figures, tmp_path):
    result = contrast(
        disc(
            folder,
            atmosphere__table="midlat_summer",
            target__parameters__temperature=250,
            render__resolution=8,
        )
    )
    result.plot(tmp_path / "spectra.png")
    intensity, through, parts, beside = figures[0].axes
    lines = {
        line.get_label(): line.get_ydata()
        for axes in (through, parts, beside)
        for line in axes.lines
    }
    np.testing.assert_allclose(
        lines["target"] + lines["path"] + lines["background, hidden"], lines["contrast"], atol=1e-15
    )
    assert (
        lines["background, hidden"].max() < 0
        and "W/sr in band" in intensity.get_title()
        and "MWIR 3-5 um" in figures[0].get_suptitle()
    )


@pytest.mark.slow
def test_spectra_of_a_plot_are_times_the_response(folder, tmp_path):
    """The area below a curve is the value in band that its title states."""
    response = tmp_path / "response.csv"
    response.write_text("wavelength_um,response\n3,0.1\n4,1\n5,0.3\n")
    given = {"sensor__response": str(response), "atmosphere__table": "vacuum"}
    result = contrast(disc(folder, **given, render__resolution=8))
    picture = result.plot()
    assert "spectra times the response" in picture.get_suptitle()
    line = next(curve for curve in picture.axes[0].lines if curve.get_label() == "intensity")
    area = np.trapezoid(line.get_ydata(), line.get_xdata())
    assert area == pytest.approx(result.rows[-1].intensity.value, rel=0.02)


@pytest.mark.slow
def test_titles_of_a_plot_fit_into_it(folder):
    result = contrast(
        disc(
            folder,
            atmosphere__table="midlat_summer",
            observer__elevation_deg=-11.3,
            render__resolution=8,
        )
    )
    picture = result.plot()
    for axes in picture.axes:
        box = axes.title.get_window_extent()
        assert picture.bbox.x0 <= box.x0 and box.x1 <= picture.bbox.x1, axes.get_title()


@pytest.mark.slow
def test_each_row_is_rendered_with_its_own_reflections():
    """The rows use the same random numbers as one signature with all reflections.

    Their intensities are therefore the cumulative intensities of that signature.
    """
    changes = {
        "sensor.band": "LWIR",
        "render.resolution": 24,
        "render.spp": 4,
        "render.seed": 3,
        "render.lobe": "mirror",
    }
    scenario = Scenario.read(
        "a340_landing/position_3", **changes, **{"render.max_bounces": [2, 0, 1]}
    )
    scene = mi_lcair.load("a340_landing", band="LWIR", lobe="mirror", max_bounces=2)
    seen = seen_from(
        scene, View(scenario.observer.azimuth_deg, scenario.observer.elevation_deg), 24
    )
    up_to = mi_lcair.signature(seen, spp=4, seed=3).target.up_to_bounce
    rows = contrast(scenario).rows
    assert [row.intensity.value for row in rows] == pytest.approx(
        [up_to[2], up_to[0], up_to[1]], rel=1e-4
    )
    assert up_to[0] < 0.9 * up_to[1] < up_to[2]


@pytest.mark.slow
def test_the_pixels_of_the_picture_add_up_to_it():
    """The contrast of the airliner agrees with a sum over the pixels of an image.

    The image takes a mean transmittance for each spectrum. Its paths are others, so that the sums
    agree within 4 standard errors, which are below 0.5 %.
    """
    result = contrast(
        Scenario.read(
            "a340_landing/position_3",
            **{
                "sensor.band": "LWIR",
                "render.max_bounces": 2,
                "render.resolution": 64,
                "render.spp": 128,
            },
        )
    )
    observer, row = result.scenario.observer, result.rows[0]
    view = View(observer.azimuth_deg, observer.elevation_deg)
    scene = mi_lcair.load("a340_landing", band="LWIR", max_bounces=2, sky="midlat_summer_stratus")
    image = mi_lcair.render(
        seen_from(scene, view, 64), spp=128, atmosphere=result.air, range_m=observer.range_m
    )
    arrives = image.channels["apparent.Y"] - (image.channels["Y"] - image.channels["target.Y"])
    solid_angle = Target.of(scene).window_area(view) / observer.range_m**2
    expected = row.target.value + row.path.value
    error = np.hypot(
        row.target.standard_error + row.path.standard_error, image.mean_error * solid_angle
    )
    assert error < 5e-3 * expected
    assert arrives.mean(dtype=float) * solid_angle == pytest.approx(expected, abs=4 * error)
    of_air = image.channels["path.Y"]
    assert of_air.mean(dtype=float) * solid_angle == pytest.approx(
        row.path.value, rel=4 * error / expected
    )
    assert of_air.max() == pytest.approx(result.path_radiance, rel=2e-5)  # only target in the pixel


# Parts of a contrast, calculated by hand


def one_row(value, error, reached=None, bounces=2):
    return SimpleNamespace(total=Estimate(value, error), reached=reached, max_bounces=bounces)


def test_remarks():
    """On contrasts within 3 standard errors, wide targets and near ranges."""
    narrow, target = Detector("MWIR", field_of_view_deg=10), SimpleNamespace(radius=2.0)
    rows = [one_row(3.1, 1.0), one_row(-2.9, 1.0), one_row(0.1, 1.0, True), one_row(0, 1, False)]
    lines = remarks(rows, narrow, target, 500.0)
    assert [line.split("; ")[1][:20] for line in lines] == [
        "raise spp", "lower the tolerance", "a fraction of zero c",
    ]  # fmt: skip
    assert lines[0].startswith("with 2 reflections the contrast is less than 3 standard")
    # The sphere has 10 degrees at 2 / sin(5 degrees) = 22.947 m
    assert remarks([], narrow, target, 22.95) == []
    (wide,) = remarks([], narrow, target, 22.94)
    assert "2 m in radius, is wider than the field of view" in wide
    assert remarks([], Detector("MWIR"), target, 20.0) == []
    (near,) = remarks([], Detector("MWIR"), target, 19.9)
    assert near.startswith("the range is only 9.9 radii of the target")


def irradiance_of(contrast, half_width, least):
    """In place of `Irradiance`: a contrast of 40 W m^-2 sr^-1 background, of 3 m^2."""
    return SimpleNamespace(
        at=lambda path: dict.fromkeys(TERMS, Estimate(1.0, 0.5)) | {"total": contrast},
        half_width=lambda path: half_width,
        least_half_width=lambda path: least,
        approximated=lambda path: 0.0,
        projected_area=Estimate(3.0, 0.1),
        background=lambda path: np.full(2, 20.0),
        in_band=lambda spectrum: float(spectrum.sum()),
    )


def test_tolerances_that_no_number_of_samples_reaches():
    """The largest contrast of the interval, 1.1, times the tolerance, against the least width."""
    sampling = RenderTable(tolerance=0.01)
    check_reachable(sampling, irradiance_of(Estimate(-1.0, 0.1), 0.1, 0.0109), None)
    with pytest.raises(InputError, match="a tolerance of 0.011 W m.-2 cannot be reached"):
        check_reachable(sampling, irradiance_of(Estimate(-1.0, 0.1), 0.1, 0.0111), None)
    # A contrast that may be zero is not judged by a fraction
    check_reachable(sampling, irradiance_of(Estimate(-1.0, 0.1), 1.0, 9.0), None)
    absolute = RenderTable(tolerance_W_m2=0.5)
    check_reachable(absolute, irradiance_of(Estimate(0.0, 0.1), 1.0, 0.49), None)
    with pytest.raises(InputError, match="leave half a 95 % interval of 0.51 W"):
        check_reachable(absolute, irradiance_of(Estimate(0.0, 0.1), 1.0, 0.51), None)


def test_a_target_that_no_path_has_met():
    """Less than a millionth of the radius squared is the rounding of Float32."""
    target = SimpleNamespace(radius=2.0)
    met, missed = (
        SimpleNamespace(effective_areas=SimpleNamespace(projected_area=area))
        for area in (4.1e-6, 3.9e-6)
    )
    check_met(met, target)
    with pytest.raises(InputError, match="no ray hit the target"):
        check_met(missed, target)


def test_a_row():
    """Solid angle A / R^2, NEI by optics and ratio, and the field of view with the target."""
    path, target = SimpleNamespace(range_m=100.0), SimpleNamespace(radius=2.0)
    irradiance = irradiance_of(Estimate(-0.3, 0.06), 0.12, 0.0)
    detector = Detector("MWIR", 0.5, field_of_view_deg=10, nei=0.014, snr=10)
    made = module.row(3, irradiance, path, detector, target, True)
    assert (made.max_bounces, made.reached, made.half_width) == (3, True, 0.12)
    assert made.solid_angle == pytest.approx(3e-4) and made.total.pair == (-0.3, 0.06)
    assert made.nei_max.pair == pytest.approx((0.015, 0.003)) and made.detected
    field = 2 * np.pi * (1 - np.cos(np.radians(5)))
    assert made.observed == pytest.approx(40 * field - 0.3, rel=1e-12)
    weak = Detector("MWIR", 0.5, nei=0.016, snr=10)
    assert not module.row(3, irradiance, path, weak, target, None).detected
    assert module.row(3, irradiance, path, weak, target, None).observed is None
    near = SimpleNamespace(range_m=20.0)
    assert module.row(3, irradiance, near, detector, target, None).observed is None  # overfills it
    assert module.row(3, irradiance, path, Detector("MWIR"), target, None).detected is None


# Reflected sunlight and skylight through the air: summed amounts, and remarks where none are
# -------------------------------------------------------------------------------------------


def amounts_of_levels(heights, lengths):
    """Amounts along straight pieces at some heights, apart from the product [density km]."""
    lines = [
        line
        for line in (TABLES / "band_levels_us_standard.csv").read_text().splitlines()
        if line[0] != "#"
    ]
    rows = [list(map(float, row)) for row in csv.reader(lines[1:])]
    names, table = lines[0].split(","), np.array(rows)
    amounts = {}
    for k, name in enumerate(names[6:], 6):
        density = np.exp(np.interp(heights, table[:, 0], np.log(np.maximum(table[:, k], 1e-99))))
        amounts[name] = float(density @ lengths)
    return amounts


def transmittance(amounts):
    """Wavelengths and transmittance from the rows of the tables, apart from the product."""
    lines = [
        line for line in (TABLES / "band_terms.csv").read_text().splitlines() if line[0] != "#"
    ]
    depths = {}
    for row in csv.DictReader(lines):
        amount = float(row["coefficient"]) * amounts[row["column"]]
        wavelength = float(row["wavelength_um"])
        depths[wavelength] = depths.get(wavelength, 0) + amount ** float(row["exponent"])
    return np.array(list(depths)), np.exp(-np.array(list(depths.values())))


@pytest.mark.slow
@pytest.mark.parametrize("range_m", [500.0, 2000.0, 10_000.0])
def test_reflected_sun_has_the_amounts_of_both_paths(tmp_path, range_m):
    """The share of the reflected sun that arrives, within 1.5 % of an own sum of amounts.

    The product of both transmittances is 10 to 15 % too dark.
    """
    folder = lit(tmp_path)
    given = {"observer__elevation_deg": 0, "observer__range_m": range_m, "sensor__band": "MWIR"}
    row = contrast(
        disc(folder, **given, atmosphere__table="us_standard", target__parameters__temperature=1)
    ).rows[0]
    share = row.target.value * range_m**2 / row.intensity.value
    edges = 0.05 + 99.9 * np.linspace(0, 1, 4001) ** 2
    heights, lengths = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / np.sin(np.radians(45))
    to_sun = amounts_of_levels(heights, lengths)
    near = amounts_of_levels(np.array([0.0501]), np.array([range_m / 1000]))
    x, before = transmittance(to_sun)
    _, after = transmittance({name: to_sun[name] + near[name] for name in to_sun})
    _, alone = transmittance(near)
    sun = np.interp(x, *np.loadtxt(TABLES / "band_sun.csv", delimiter=",", skiprows=7).T)
    rule = band("MWIR")
    expected, product = (
        rule.integral(x, sun * values) / rule.integral(x, sun * before)
        for values in (after, before * alone)
    )
    assert share == pytest.approx(expected, rel=0.015)
    assert product < 0.92 * expected
