"""The list of bundled scenes.

It needs no Mitsuba. Every parameter has a description. The headers state the exact answers.
"""

import re
import subprocess
import sys

import pytest

import mi_lcair
from benchmarks.methods.propagation import exact
from mi_lcair import scenes
from mi_lcair.errors import InputError

NAMES = ["a340_landing", "cavity", "cylinder_ir_range", "furnace", "open_box", "two_plates"]

# sigma T^4 / pi with CODATA 2018, W m^-2 sr^-1
L_800, L_300 = 7393.018822, 146.1998351


def used(name):
    """Return the names after a $ in the scene's XML and in the files that it may include."""
    text = scenes.path(name).read_text()
    included = [
        file
        for pattern in re.findall(r'<include filename="([^"]+)"', text)
        for file in scenes.FOLDER.glob(re.sub(r"\$\w+", "*", pattern))
    ]
    texts = [text, *(file.read_text() for file in included)]
    return {key for text in texts for key in re.findall(r"\$(\w+)", text)}


def test_names_are_the_bundled_scenes():
    assert scenes.names() == NAMES
    assert all(scenes.path(name).is_file() for name in NAMES)


def test_unknown_scene_names_the_nearest():
    for function in (scenes.path, scenes.title, scenes.parameters):
        with pytest.raises(InputError, match="unknown bundled scene 'cavty'; known: cavity"):
            function("cavty")


def test_listing_needs_no_renderer():
    code = (
        "import sys; from mi_lcair import scenes;"
        "[(scenes.title(n), scenes.parameters(n)) for n in scenes.names()];"
        "sys.exit('mitsuba' in sys.modules or 'drjit' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=scenes.FOLDER.parent).returncode == 0


@pytest.mark.parametrize("name", NAMES)
def test_title_and_parameters_are_one_line_each(name):
    assert re.fullmatch(r"[A-Z].{20,110}\.", scenes.title(name))
    for parameter, (default, description) in scenes.parameters(name).items():
        assert default, parameter
        assert description and "\n" not in description, parameter


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_used_and_declared(name):
    poses = {"yaw_deg", "roll_deg"}  # of every imported model; a scene may leave them at 0
    assert (
        set(scenes.parameters(name)) <= used(name)
        and used(name) - set(scenes.parameters(name)) <= poses
    )
    declared = re.findall(r'<default name="(\w+)"', scenes.path(name).read_text())
    assert list(scenes.parameters(name)) == declared


@pytest.mark.parametrize(
    "name, expected",
    [
        ("two_plates", {"band": "total", "lobe": "brdf"}),
        ("open_box", {"reflector": "diffuse", "band": "total", "lobe": "brdf"}),
        ("cavity", {"opening": "2", "band": "total"}),
        (
            "furnace",
            {"material": "bare_aluminum", "band": "MWIR", "lobe": "brdf", "temperature": "300"},
        ),
    ],
)
def test_parameters_that_the_scene_is_about(name, expected):
    defaults = {parameter: default for parameter, (default, _) in scenes.parameters(name).items()}
    assert expected.items() <= defaults.items()
    assert {"max_bounces", "emitter_sampling", "resolution", "spp", "sampler"} <= defaults.keys()


@pytest.mark.parametrize("name", NAMES)
def test_sampler(name):
    """Every bundled scene uses the lattice, and independent numbers where these are asked for."""
    assert mi_lcair.load(name).sampler == "lattice"
    assert mi_lcair.load(name, sampler="independent").sampler == "independent"


# -------------------------------------------------------------------- Exact answers


def test_view_factors():
    """They agree with a separate quadrature, and with reciprocity for unequal plates."""
    assert exact.perpendicular_view_factor(0.1, 0.2, 0.2) == pytest.approx(
        0.1492997958867619, rel=1e-12
    )
    assert exact.perpendicular_view_factor(0.2, 0.1, 0.1) == pytest.approx(
        0.24063600617696168, rel=1e-12
    )
    forth, back = exact.perpendicular_view_factor(1, 2, 3), exact.perpendicular_view_factor(1, 3, 2)
    assert 2 * forth == pytest.approx(3 * back, rel=1e-12)
    # For a long edge the method of crossed strings gives the limit.
    assert exact.perpendicular_view_factor(1e5, 1, 1) == pytest.approx(1 - 0.5**0.5, rel=1e-4)


def test_intensities_and_emissivities():
    assert exact.two_plates_intensity(L_800) == pytest.approx(22.07552402, rel=1e-9)
    assert exact.open_box_intensity(L_800, L_300) == pytest.approx(
        12.57961718 + 1.03378895, rel=1e-9
    )
    for opening in exact.CAVITY_BLOCKS:
        f = exact.cavity_opening_fraction(opening)
        partial_sums = [0.5 * sum((0.5 * (1 - f)) ** k for k in range(N + 1)) for N in (0, 1, 4)]
        assert [exact.cavity_emissivity(opening, N) for N in (0, 1, 4)] == pytest.approx(
            partial_sums, rel=1e-12
        )
        assert exact.cavity_emissivity(opening) == pytest.approx(
            0.5 / (0.5 * (1 - f) + f), rel=1e-12
        )


def test_headers_state_the_exact_answers():
    def header(name):
        return scenes.path(name).read_text()

    assert f"{exact.two_plates_intensity(L_800):.5f} W/sr" in header("two_plates")
    assert f"{exact.open_box_intensity(L_800, L_300):.5f} W/sr" in header("open_box")
    fractions = ", ".join(
        f"{exact.cavity_opening_fraction(opening):.6f}" for opening in exact.CAVITY_BLOCKS
    )
    assert fractions in header("cavity")
