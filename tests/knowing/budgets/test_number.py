"""A number that is linear in the radiances of its sources, without a render."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.derivatives.common_numbers import CommonNumbers
from mi_lcair.errors import InputError
from mi_lcair.knowing.budgets.number import Linear, Number
from mi_lcair.physics.bands import Spectrum, band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.parameters.entries import NEAREST, Parameter
from mi_lcair.signatures.effective_areas import EffectiveAreas

LWIR = band("LWIR")
AREAS = np.array([2.0, 3.0, 0.5])
COVARIANCE = np.diag([0.01, 0.04, 0.09])
SKY = Spectrum("sky", np.array([8.0, 12.0]), np.array([5.0, 7.0]))


def B(T):
    return float(in_band_radiance(LWIR, T))


def parameter(name, kind, value, lower=0.0, upper=np.inf):
    return Parameter(name, kind, value, "1", lower, upper)


class Sum(Number):
    """gain x (2 m^2 B(300 K) + 3 m^2 B(350 K) of `body`, and 0.5 m^2 of a sky of 24) + offset.

    The paint is rendered: twice its value is the factor of all areas.
    """

    def __init__(self):
        self.scene = SimpleNamespace(band=LWIR)
        self.known = {
            one.name: one
            for one in (
                parameter("body.temperature", "temperature", 325.0),
                parameter("body@350.temperature", "temperature", 350.0),
                parameter("sky.radiance", "radiance", 24.0),
                parameter("paint.b", "material", 0.5, 0.0, 1.0),
                parameter("scenario.gain", "scenario", 1.0, 0.0, 2.0),
                parameter("scenario.offset", "scenario", 0.0, -np.inf),
            )
        }
        sources = [
            Source("body", "300 K", B(300), 300.0),
            Source("body", "350 K", B(350), 350.0),
            Source("sky", "sky", 24.0, spectrum=SKY),
        ]
        self.areas = EffectiveAreas(
            band=LWIR,
            sources=sources,
            amounts=np.append(AREAS, 1.0)[None],
            error=None,
            covariance=COVARIANCE,
            nodes_um=np.empty(0),
        )
        self.is_linear, self.total = (
            True,
            SimpleNamespace(
                factor=1.0, unscattered_error=lambda channel: [UNSCATTERED] * (channel == "target")
            ),
        )
        self.numbers = SimpleNamespace(render=self.render, count=3, prefix="target.", area=10.0)
        self.base = self.linear(self.total, self.areas, {})

    def render(self, values):
        return SimpleNamespace(factor=2 * values["paint.b"])

    def areas_of(self, total):
        return self.areas

    def linear(self, total, areas, quantities):
        gain = quantities.get("scenario.gain", 1.0) * total.factor
        factors = [gain * source.in_band for source in areas.sources]
        covariance = np.zeros((4, 4))
        covariance[:3, :3] = areas.covariance
        return Linear(
            np.append(factors, 1.0),
            np.append(areas.area[0], quantities.get("scenario.offset", 0.0)),
            covariance,
        )


UNSCATTERED = 0.9  # error of the mean radiance that its scatter does not show, W m^-2 sr^-1
NUMBER = Sum()
VALUE = 2 * B(300) + 3 * B(350) + 12


def test_value_and_error():
    assert NUMBER.value == pytest.approx(VALUE)
    squares = [B(300) ** 2 * 0.01, B(350) ** 2 * 0.04, 24**2 * 0.09, (UNSCATTERED * 10.0) ** 2]
    assert NUMBER.error == pytest.approx(np.sqrt(sum(squares)))
    NUMBER.columns = 2
    assert NUMBER.renders == 5


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"body.temperature": 335.0}, 2 * B(310) + 3 * B(360) + 12),
        ({"body@350.temperature": 340.0}, 2 * B(300) + 3 * B(340) + 12),
        ({"sky.radiance": 30.0}, VALUE + 3),
        ({"scenario.gain": 1.5, "sky.radiance": 30.0}, 1.5 * (VALUE + 3)),
        ({"scenario.offset": -4.0}, VALUE - 4),
        ({"paint.b": 0.6}, 1.2 * VALUE),
        ({"paint.b": 0.6, "sky.radiance": 30.0, "scenario.offset": 1.0}, 1.2 * (VALUE + 3) + 1),
    ],
)
def test_other_values(values, expected):
    assert NUMBER.at(values) == pytest.approx(expected)


def test_what_needs_a_render():
    assert [name for name in NUMBER.known if NUMBER.needs_render(name)] == ["paint.b"]
    several = Sum()
    several.is_linear = False
    assert [name for name in several.known if not several.needs_render(name)] == [
        "scenario.gain",
        "scenario.offset",
    ]


def test_light_of_a_group_that_air_has_changed():
    """Its source is a spectrum, so that another temperature of the group needs a render.

    Another radiance does not, nor another temperature of a group whose light stays a blackbody's.
    """
    number = Sum()
    reflected = Source("ground", "sky", 3.0, spectrum=SKY, light_of="body")
    number.areas = replace(number.areas, sources=[*number.areas.sources, reflected])
    assert number.needs_render("body.temperature") and not number.needs_render("sky.radiance")
    reflected = replace(reflected, light_of="sky")
    number.areas = replace(number.areas, sources=[*number.areas.sources[:-1], reflected])
    assert not number.needs_render("body.temperature") and not number.needs_render("sky.radiance")
    black = Source("ground", "300 K", B(300), 300.0, light_of="body")
    number.areas = replace(number.areas, sources=[*number.areas.sources[:-1], black])
    assert not number.needs_render("body.temperature")


def test_derivatives_in_closed_form():
    """Their errors come from the noise of the areas alone."""
    slope = lambda T: (B(T + 0.1) - B(T - 0.1)) / 0.2
    expected = {
        "body.temperature": (
            2 * slope(300) + 3 * slope(350),
            np.hypot(0.1 * slope(300), 0.2 * slope(350)),
        ),
        "body@350.temperature": (3 * slope(350), 0.2 * slope(350)),
        "sky.radiance": (0.5, 0.3),
        "scenario.gain": (VALUE, NUMBER.base.error),
        "scenario.offset": (1.0, 0.0),
    }
    names = list(expected)
    for sigma in (1e-9, 1.0, 1e6):
        derivative, error = NUMBER.derivatives(names, [sigma] * 5)
        np.testing.assert_allclose(derivative, [d for d, _ in expected.values()], rtol=1e-3)
        np.testing.assert_allclose(error, [e for _, e in expected.values()], rtol=1e-3, atol=1e-9)
    assert NUMBER.source_slope(1) == pytest.approx(3 * slope(350), rel=1e-4)
    assert NUMBER.source_slope(0) == pytest.approx(2 * slope(300), rel=1e-4)


def test_derivatives_that_are_rendered(monkeypatch):
    """Of the weighted intensity; the first error is that of the intensity itself."""
    calls = []

    def differentiated(scene, names, repeated, part, weights):
        calls.append((names, part, weights))
        return SimpleNamespace(derivative=np.array([7.0]), error=np.array([9.0, 0.7]))

    monkeypatch.setattr("mi_lcair.derivatives.window.differentiate_intensity", differentiated)
    monkeypatch.setattr("mi_lcair.derivatives.window.without_column", lambda scene, names: set())
    number = Sum()
    number.numbers.repeated = None
    derivative, error = number.derivatives(["scenario.offset", "paint.b"], [0.1, 0.1])
    assert derivative == pytest.approx([1.0, 7.0]) and error == pytest.approx([0.0, 0.7])
    assert calls == [(["paint.b"], "target", None)] and number.renders == 4


@pytest.mark.parametrize("nodes, is_linear", [([], True), ([8.0, 12.0], False), (None, False)])
def test_whether_the_sources_are_told_apart(nodes, is_linear):
    """They are not if a part of the emission is known by wavelengths only, or nothing is known."""
    number = Sum()
    areas = None if nodes is None else replace(number.areas, nodes_um=np.array(nodes))
    number.areas_of = lambda total: areas
    number.numbers.render = lambda: SimpleNamespace(factor=2.0)
    number.linear = lambda total, areas, quantities: SimpleNamespace(value=total.factor, error=0.5)
    number.start()
    assert number.is_linear == is_linear and (number.value, number.base.error) == (2.0, 0.5)


def test_derivatives_by_differences():
    """Over a standard deviation on each side, or up to a bound."""
    number = Sum()
    type(number).has_weights = property(lambda self: False)
    try:
        derivative, error = number.derivatives(["scenario.gain", "paint.b"], [0.1, 0.1])
        assert derivative == pytest.approx([VALUE, 2 * VALUE]) and np.isnan(error[1])
        assert number.differences(["paint.b"], [3.0])[0] == pytest.approx([2 * VALUE])
    finally:
        del type(number).has_weights
    assert number.within("paint.b", 1.7) == 1 and number.within("paint.b", 0.7) == 0.7
    lowest = NEAREST * 325  # a temperature stays above its bound
    assert number.within("body.temperature", -1.0) == pytest.approx(lowest)
    number.known["body.temperature"] = parameter("body.temperature", "temperature", 325.0, 200.0)
    lowest = 200 + NEAREST * 125
    assert number.within("body.temperature", 100.0) == pytest.approx(lowest)


def test_feasible_values(monkeypatch):
    """Bounds of what needs no render; the scene judges the rest."""

    def checked(scene, values):
        assert set(values) <= {"paint.b"}
        if values.get("paint.b", 0) > 0.9:
            raise InputError("too rough")

    monkeypatch.setattr("mi_lcair.knowing.budgets.number.checked", checked)
    assert NUMBER.is_feasible({"paint.b": 0.8})
    assert not NUMBER.is_feasible({"paint.b": 0.95, "sky.radiance": 1.0})
    assert NUMBER.is_feasible({"scenario.gain": 2.0, "sky.radiance": 0.0})
    assert not NUMBER.is_feasible({"scenario.gain": 2.01})
    assert not NUMBER.is_feasible({"sky.radiance": -0.01})


def test_what_further_reflections_would_add():
    """8, 4, 2 W m^-2 sr^-1 on 10 m^2: another 2 beyond, of 14, less what a closure adds."""
    number, closure = Sum(), 0.0
    means = {"target.bounce.0": 8.0, "target.bounce.1": 4.0, "target.bounce.2": 2.0}

    def mean(of):
        return np.array([[means[name]] for name in of]) if isinstance(of, list) else [closure]

    number.total = SimpleNamespace(sums=dict(means), mean=mean, factor=1.0)
    number.scene.mi = SimpleNamespace(integrator=lambda: SimpleNamespace(max_bounces=2))
    number.numbers.by_reflections = partial(CommonNumbers.by_reflections, number.numbers)
    np.testing.assert_allclose(number.numbers.by_reflections(number.total), [80, 40, 20])
    assert number.truncation() == pytest.approx(2 / 14 * VALUE)
    means = {name: mean / 1000 for name, mean in means.items()}  # less than 1 W/sr
    assert number.truncation() == pytest.approx(2 / 14 * VALUE)
    closure = 3e-3
    assert number.truncation() == pytest.approx(1 / 14 * VALUE)
    means.update(dict.fromkeys(means, 0.0))
    assert number.truncation() == 0
