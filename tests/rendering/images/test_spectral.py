"""Pictures through an atmosphere: of blackbodies, whose every pixel has a closed form, and of what
must stay as it is.
"""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import AtmosphereTable, atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.rendering.scene import checked
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import SQUARE, camera

BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
BAND, AIR = band("MWIR"), atmosphere("midlat_summer")
RAISED = [
    [0, -5, 300],
    [5, -5, 300],
    [5, 5, 300],
    [0, 5, 300],
]  # the right half, 300 m above the square


def scene(**shapes):
    """Seen from 1000 m above the square."""
    sensor = camera(size=8, height=9.0, origin=(0, 0, 1000))
    return checked(
        mi.load_dict(
            {"type": "scene", "integrator": {"type": "bounce_path"}, "sensor": sensor, **shapes},
            optimize=False,
        ),
        Path("x.xml"),
        {},
    )


def through(temperature, range_m):
    """Radiance of a blackbody through the air, on a grid of a thousandth of a um."""
    x = np.linspace(3, 5, 2001)
    transmittance, path = AIR.path(range_m).at(x)
    return np.trapezoid(transmittance * spectral_radiance(x, temperature) + path, x)


@pytest.mark.parametrize("range_m", [None, 400.0])
def test_two_plates_at_two_ranges(plate, range_m):
    """Each pixel at its own range, 1000 and 700 m, or all at the one that is given."""
    image = mi_lcair.render(
        scene(
            low=plate("low", SQUARE, BLACK, 350.0, "MWIR"),
            high=plate("high", RAISED, BLACK, 600.0, "MWIR"),
        ),
        spp=4,
        atmosphere=AIR,
        range_m=range_m,
    )
    left, right = image.channels["apparent.Y"][:, :4], image.channels["apparent.Y"][:, 4:]
    if np.mean(left) > np.mean(
        right
    ):  # which way the picture's columns run is the camera's business
        left, right = right, left
    np.testing.assert_allclose(left, through(350, range_m or 1000), rtol=2e-5)
    np.testing.assert_allclose(right, through(600, range_m or 700), rtol=2e-5)
    assert image.header["atmosphere"] == "midlat_summer" and image.header["atmosphere_range_m"] == (
        "400" if range_m else "range.Y"
    )


@pytest.mark.slow
def test_more_temperatures_than_can_be_told_apart(plate):
    """Ninety plates of ninety temperatures: recorded by wavelength, each pixel as exact as the
    noise allows.
    """
    shapes = {}
    for k in range(90):
        x = -4.5 + 0.1 * k
        shapes[f"p{k}"] = plate(
            f"p{k}",
            [[x, -5, 0], [x + 0.1, -5, 0], [x + 0.1, 5, 0], [x, 5, 0]],
            BLACK,
            300.0 + k,
            "MWIR",
        )
    image = mi_lcair.render(scene(**shapes), spp=64, atmosphere=AIR, range_m=1000.0)
    ratio = image.channels["apparent.Y"].mean() / np.mean(
        [through(300.0 + k, 1000) for k in range(90)]
    )
    assert ratio == pytest.approx(1, abs=2e-3)  # the noise of which plate a path meets


def test_background_is_as_it_arrives(plate):
    """A sky through which the air is not seen again; of the pixels that show both, the air acts on
    the model's share.
    """
    sky = plate("sky", SQUARE, BLACK, 280.0, "MWIR", group="sky")
    sky["emitter"]["facet_type"] = "sky"
    image = mi_lcair.render(
        scene(sky=sky, high=plate("high", RAISED, BLACK, 600.0, "MWIR")), spp=4, atmosphere=AIR
    )
    columns = sorted(
        [image.channels["apparent.Y"][:, :4], image.channels["apparent.Y"][:, 4:]], key=np.mean
    )
    np.testing.assert_allclose(columns[0], in_band_radiance(BAND, 280.0), rtol=1e-5)
    np.testing.assert_allclose(columns[1], through(600, 700), rtol=2e-5)
    assert (
        sorted([image.channels["path.Y"][:, :4].max(), image.channels["path.Y"][:, 4:].max()])[0]
        == 0
    )


def test_a_pixel_that_shows_both(plate):
    """A model that covers part of some pixels: path and model count by their share, the sky by the
    rest.
    """
    sky = plate("sky", SQUARE, BLACK, 280.0, "MWIR", group="sky")
    sky["emitter"]["facet_type"] = "sky"
    part = [[0.4, -5, 300], [5, -5, 300], [5, 5, 300], [0.4, 5, 300]]
    image = mi_lcair.render(
        scene(sky=sky, high=plate("high", part, BLACK, 600.0, "MWIR")), spp=64, atmosphere=AIR
    )
    share = image.channels["target.Y"] / in_band_radiance(BAND, 600.0)
    assert ((share > 0.2) & (share < 0.9)).sum() == 8
    np.testing.assert_allclose(
        image.channels["apparent.Y"],
        share * through(600, 700) + (1 - share) * in_band_radiance(BAND, 280.0),
        rtol=1e-4,
    )


def test_vacuum_changes_nothing():
    image = mi_lcair.render(
        mi_lcair.load("cylinder_ir_range", resolution=16),
        spp=2,
        atmosphere=atmosphere("vacuum"),
        range_m=1e6,
    )
    np.testing.assert_allclose(image.channels["apparent.Y"], image.channels["Y"], rtol=1e-6)
    assert not image.channels["path.Y"].any()


def test_opaque_air_shows_itself(plate):
    """Air that lets nothing through looks like a blackbody at its temperature, whatever lies behind
    it, grey and reflecting.
    """
    x = np.linspace(2.9, 5.1, 500)
    air = AtmosphereTable(
        "fog",
        np.array([10.0, 2000.0]),
        x,
        np.zeros((2, 500)),
        np.tile(spectral_radiance(x, 290), (2, 1)),
    )
    image = mi_lcair.render(
        mi_lcair.load("furnace", band="MWIR", resolution=8), spp=2, atmosphere=air, range_m=1500.0
    )
    np.testing.assert_allclose(
        image.channels["apparent.Y"], in_band_radiance(BAND, 290.0), rtol=1e-4
    )


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"range_m": 0.0}, "range = 0 m"),
        ({"range_m": 300_000.0}, "beyond its last one, 200000 m"),
        ({"band": "3-6"}, "does not cover band"),
        ({"band": "total"}, "total"),
    ],
)
def test_refused_before_rendering(plate, changes, message):
    name = changes.pop("band", "MWIR")
    square = scene(low=plate("low", SQUARE, BLACK, 350.0, name))
    with pytest.raises(InputError, match=message):
        mi_lcair.render(
            square, atmosphere=AIR, progress=lambda *_: pytest.fail("rendered"), **changes
        )


def test_a_pixel_beyond_the_table(plate):
    far, x = [[x, y, -5000] for x, y, _ in SQUARE], AIR.wavelengths_um
    short = AtmosphereTable("short", np.array([1e3, 5e3]), x, np.full((2, len(x)), 0.5), 0 * x)
    with pytest.raises(InputError, match="m is beyond its last one, 5000 m"):
        mi_lcair.render(scene(far=plate("far", far, BLACK, 350.0, "MWIR")), spp=1, atmosphere=short)
