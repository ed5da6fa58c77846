"""A source that few paths meet: a tolerance is not said to be reached, or the source is drawn.

docs/validation/claims.md tries random scenes of this kind.
"""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from docs.studies.claims import planck
from docs.studies.claims.lit import turned_to_front
from docs.studies.claims.scene_file import BLACK, UP, Place, SceneFile, diffuse, mirror, thermal
from docs.studies.claims.sources import corners
from docs.studies.claims.view_factors import by_areas
from mi_lcair.errors import InputError

X, Y = np.eye(3)[:2]
HOT, COLD = 3000.0, 300.0  # K; 60,000 times as bright in MWIR
REFLECTANCE, HEIGHT, SIDE = 0.5, 0.5, 0.004  # of the floor; of the lamp above it, and its side [m]
HALF_WINDOW = 0.25  # m
LAMP = turned_to_front((HEIGHT * UP, SIDE / 2 * X, SIDE / 2 * Y), -UP)


def window_on(inside: str) -> SceneFile:
    """A plate of 4 m and a camera that looks down on its middle."""
    file = SceneFile(Place())
    file.rectangle(np.zeros(3), 2 * X, 2 * Y, inside)
    file.camera(0.2 * UP, -UP, Y, HALF_WINDOW, 4.0)
    return file


def speck() -> SceneFile:
    """1.5 mm at 3000 K, 1 cm above a blackbody that fills the window."""
    file = window_on(BLACK + thermal("plate", COLD))
    file.rectangle(
        np.array([0.1, 0.2, 0.01]), 7.5e-4 * X, 7.5e-4 * Y, BLACK + thermal("speck", HOT)
    )
    return file


def mirrored_speck() -> SceneFile:
    """A mirror before the plate, which shows a source of 3 mm behind the camera."""
    file = window_on(BLACK + thermal("plate", COLD))
    file.rectangle(0.01 * UP, 0.125 * X, 0.25 * Y, mirror(1.0))
    source = turned_to_front((np.array([-0.1, 0.1, 1]), 1.5e-3 * X, 1.5e-3 * Y), -UP)
    file.rectangle(*source, BLACK + thermal("speck", HOT))
    return file


def floor() -> SceneFile:
    return window_on(diffuse(REFLECTANCE) + thermal("floor", COLD))


def lamp_of_facets() -> SceneFile:
    """One of 20,000 facets of a plate of 40 cm is at 3000 K."""
    file, count = floor(), 100
    centre, u, v = LAMP
    parts = [
        corners((centre + (2 * i + 1 - count) * u + (2 * j + 1 - count) * v, u, v))
        for i in range(count)
        for j in range(count)
    ]
    temperatures = np.full(len(parts), 20.0)
    temperatures[count * count // 2 + count // 2] = HOT
    texture = (
        '<texture name="temperature" type="mesh_attribute"> '
        '<string name="name" value="face_temperature"/> </texture>'
    )
    emitter = f'<emitter type="thermal"> <string name="band" value="$band"/> {texture} </emitter>'
    file.mesh(parts, BLACK + emitter, temperatures)
    return file


def lamp_with(emitter: str) -> SceneFile:
    file = floor()
    file.rectangle(*LAMP, BLACK + emitter)
    return file


def area_lamp() -> SceneFile:
    """Mitsuba's own `area` emitter."""
    radiance = planck.in_band_radiance("MWIR", HOT)
    return lamp_with(
        f'<emitter type="area"> <spectrum name="radiance" value="{radiance!r}"/> </emitter>'
    )


BY_CHANCE = {"speck": speck, "mirrored_speck": mirrored_speck}  # drawing emitters finds neither
DRAWN = {"area_lamp": area_lamp, "lamp_of_facets": lamp_of_facets}


def loaded(make, folder, emitter_sampling: bool):
    return mi_lcair.load(make().write(folder, "MWIR", 1, str(emitter_sampling).lower()))


@pytest.mark.slow
@pytest.mark.parametrize("emitter_sampling", [False, True])
@pytest.mark.parametrize("name", BY_CHANCE)
def test_what_is_met_by_chance_alone_is_not_claimed(tmp_path, name, emitter_sampling):
    scene = loaded(BY_CHANCE[name], tmp_path, emitter_sampling)
    for seed in range(2):
        result = mi_lcair.render(scene, tolerance=0.5, max_spp=4096, seed=seed)
        assert not result.reached


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_what_is_drawn_is_right_after_few_samples(tmp_path, name):
    scene = loaded(DRAWN[name], tmp_path, True)
    window = (np.zeros(3), HALF_WINDOW * X, HALF_WINDOW * Y)
    share = by_areas(window, LAMP, 4)
    cold, hot = (planck.in_band_radiance("MWIR", T) for T in (COLD, HOT))
    truth = (1 - REFLECTANCE) * cold + REFLECTANCE * share * hot
    for seed in range(2):
        result = mi_lcair.render(scene, tolerance=0.5, max_spp=4096, seed=seed)
        assert result.reached
        assert result.spp < 256
        assert result.mean == pytest.approx(truth, rel=0.1)
    scene = loaded(DRAWN[name], tmp_path, False)
    assert not mi_lcair.render(scene, tolerance=0.5, max_spp=4096).reached


@pytest.mark.slow
def test_views_know_it_too(tmp_path):
    """Straight down on the speck, no view reaches the tolerance."""
    scene = loaded(speck, tmp_path, True)
    result = mi_lcair.trend(scene, [0], [90], resolution=8, tolerance=0.05, max_spp=64, seed=1)
    assert result.missed == 1


class Unknown(mi.Emitter):
    """A user's emitter whose parameters say nothing of its radiance."""

    def __init__(self, props):
        super().__init__(props)
        self.m_flags = mi.EmitterFlags.Surface

    def eval(self, si, active=True):
        return mi.Spectrum(1.0)

    def to_string(self):
        return "Unknown"


def test_an_emitter_without_a_bound_gets_no_tolerance(tmp_path):
    """A tolerance is refused with the emitter's name; a number of samples is not."""
    mi.register_emitter("unknown", Unknown)
    scene = loaded(lambda: lamp_with('<emitter type="unknown"/>'), tmp_path, False)
    for call in (mi_lcair.render, mi_lcair.signature):
        with pytest.raises(InputError, match="nothing bounds the radiance of Unknown"):
            call(scene, tolerance=0.1)
    assert mi_lcair.render(scene, spp=4).mean > 0
