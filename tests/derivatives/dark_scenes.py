"""Scenes with surfaces that reflect or transmit nothing, whose derivatives have closed forms."""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import numpy as np

from mi_lcair.physics import reflection
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance

BOUNCES = 3
FRAME = """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="{bounces}"/>
        <boolean name="emitter_sampling" value="{draws}"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world"> <scale x="0.4" y="0.4"/>
        <lookat origin="{origin}" target="0, 0, 0" up="0, 1, 0"/> </transform>
        <film type="hdrfilm"> <integer name="width" value="8"/> <integer name="height" value="8"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
        <sampler type="lattice"> <integer name="sample_count" value="64"/> </sampler>
    </sensor>
    {shapes}
</scene>"""
EMITTER = """<emitter type="thermal"> <string name="band" value="LWIR"/>
    <float name="temperature" value="{T}"/> <string name="group" value="{group}"/>
    <string name="facet_type" value="{kind}"/> </emitter>"""
DIFFUSE = '<bsdf type="diffuse" id="{}"> <spectrum name="reflectance" value="{!r}"/> </bsdf>'
PLUME = '<bsdf type="plume" id="gas"> <float name="transmittance" value="{!r}"/> </bsdf>'
SKY = DIFFUSE.format("sky", 0.0)
RADII = 1.0, 2.0, 4.0  # of the ball, of the gas and of the outer sphere [m]
ANGLE = np.pi / 4  # at which a plate is seen
STEP = 1e-5  # of a difference of Float64 numbers


@dataclass(frozen=True)
class DarkScene:
    """A scene, one of its parameters, and the derivative of its mean radiance in closed form.

    key: the parameter's name for `mi.traverse`. derivative: [W m^-2 sr^-1] per unit.
    """

    label: str
    text: str
    name: str
    key: str
    derivative: float


def B(T: float) -> float:
    """Radiance of a blackbody in the LWIR [W m^-2 sr^-1]."""
    return float(in_band_radiance(band("LWIR"), dr.llvm.ad.Float64(T))[0])


def slope(function: Callable, values: tuple, number: int, bounds: tuple) -> float:
    """Derivative of a function of some numbers in one of them; one-sided at its bounds."""
    at = lambda steps: function(
        *(value + STEP * steps * (k == number) for k, value in enumerate(values))
    )
    low, high = bounds
    if values[number] - STEP < low:
        return (-3 * at(0) + 4 * at(1) - at(2)) / (2 * STEP)
    if values[number] + STEP > high:
        return (3 * at(0) - 4 * at(-1) + at(-2)) / (2 * STEP)
    return (at(1) - at(-1)) / (2 * STEP)


def sphere(radius: float, bsdf: str, T: float, group: str, is_outer: bool = False) -> str:
    emitter = EMITTER.format(T=T, group=group, kind="sky" if is_outer else "model")
    flip = '<boolean name="flip_normals" value="true"/>' if is_outer else ""
    return (
        f'<shape type="sphere" id="shape_of_{group}"> <float name="radius" value="{radius}"/> '
        f"{flip} {bsdf} {emitter} </shape>"
    )


def concentric(R1: float, R2: float, T1: float, T2: float, number: int, draws=False) -> DarkScene:
    """A diffuse ball in a diffuse sphere.

    All radiosities are uniform. The ball sees the sphere alone, and the sphere sees the ball with
    the view factor (r1 / r2)^2.
    """
    factor = (RADII[0] / RADII[2]) ** 2
    views = np.array([[0, 1], [factor, 1 - factor]])

    def radiance(R1, R2):
        R = np.array([R1, R2])
        emitted = term = (1 - R) * np.array([B(T1), B(T2)])
        for _ in range(BOUNCES):
            term = R * (views @ term)
            emitted = emitted + term
        return emitted[0]

    names = "ball", "outer"
    shapes = sphere(RADII[0], DIFFUSE.format("ball", R1), T1, "ball")
    shapes += sphere(RADII[2], DIFFUSE.format("outer", R2), T2, "outer", is_outer=True)
    return DarkScene(
        f"ball {R1:g}, sphere {R2:g}, {T1:g} K, {T2:g} K, {names[number]}, {draws}",
        FRAME.format(bounces=BOUNCES, draws=str(draws).lower(), origin="0, 0, 3", shapes=shapes),
        f"{names[number]}.reflectance",
        f"shape_of_{names[number]}.bsdf.reflectance.value",
        slope(radiance, (R1, R2), number, (0, 1)),
    )


def in_gas(tau: float, R: float, temperatures: tuple, number: int) -> DarkScene:
    """A diffuse ball in a hollow sphere of gas, before a black sky."""
    ball, gas, sky = map(B, temperatures)

    def radiance(tau, R):
        outside = (1 - tau) * gas + tau * sky
        return (1 - tau) * gas + tau * ((1 - R) * ball + R * outside)

    shapes = sphere(RADII[0], DIFFUSE.format("ball", R), temperatures[0], "ball")
    shapes += sphere(RADII[1], PLUME.format(tau), temperatures[1], "gas")
    shapes += sphere(RADII[2], SKY, temperatures[2], "sky", is_outer=True)
    name = ("gas.transmittance", "ball.reflectance")[number]
    return DarkScene(
        f"gas {tau:g}, ball {R:g}, {temperatures}, {name}",
        FRAME.format(bounces=BOUNCES, draws="false", origin="0, 0, 3", shapes=shapes),
        name,
        "shape_of_" + name.replace(".", ".bsdf.") + ".value" * number,
        slope(radiance, (tau, R), number, (0, 1)),
    )


def plate(model: str, values: tuple, number: int, T: float, T_sky: float, lobe="brdf") -> DarkScene:
    """A plate that fills the window, under a black sky: L = B(T) + HDR (B(T_sky) - B(T)).

    A step goes to the side on which the parameters are feasible.
    """
    model = reflection.model(model)
    Float64 = dr.llvm.ad.Float64

    def HDR(*values):
        S = model.surface_of(values, model.forms[0])
        return float(model.HDR(S, Float64(ANGLE))[0])

    names = model.names
    numbers = " ".join(f'<float name="{n}" value="{v!r}"/>' for n, v in zip(names, values))
    bsdf = f'<bsdf type="{model.name}" id="paint"> {numbers} <string name="lobe" value="{lobe}"/> '
    shapes = (
        '<shape type="rectangle" id="shape_of_plate"> '
        '<transform name="to_world"> <scale value="2"/> </transform> '
        f"{bsdf} </bsdf> {EMITTER.format(T=T, group='plate', kind='model')} </shape>"
    )
    shapes += sphere(20, SKY, T_sky, "sky", is_outer=True)
    # epsilon and rho_d have the upper bound G, and n has the lower bound 1
    is_full = model.name == "sandford_robertson" and values[0] + values[1] > 1 - STEP
    bounds = (1.0 if names[number] == "n" else 0.0, values[number] if is_full else np.inf)
    name = f"paint.{names[number]}"
    return DarkScene(
        f"{model.name} {values} {lobe}, {T:g} K, {T_sky:g} K, {names[number]}",
        FRAME.format(bounces=1, draws="false", origin="3, 0, 3", shapes=shapes),
        name,
        f"shape_of_plate.bsdf.{names[number]}",
        slope(HDR, values, number, bounds) * (B(T_sky) - B(T)),
    )


def dark_scenes() -> list[DarkScene]:
    """Forty scenes: isothermal and not, black, nearly black, transparent, without floor or lobe."""
    same, others = (300.0, 300.0), (320.0, 280.0)
    scenes = [
        concentric(R, outer, *temperatures, number)
        for R, outer, number in ((0.0, 0.5, 0), (1e-6, 0.5, 0), (1e-3, 0.5, 0), (0.5, 0.0, 1))
        for temperatures in (same, others)
    ]
    scenes += [concentric(0.0, 0.0, *others, 0), concentric(1e-3, 0.0, *others, 1)]
    scenes += [
        concentric(R, 0.3, *temperatures, 0, draws=True)
        for R in (0.0, 1e-6)
        for temperatures in (same, others)
    ]
    for temperatures in ((300.0,) * 3, (320.0, 400.0, 250.0)):
        scenes += [in_gas(tau, 0.3, temperatures, 0) for tau in (0.0, 1.0)]
        scenes += [in_gas(0.0, 0.0, temperatures, 0), in_gas(0.6, 0.0, temperatures, 1)]
    black, no_floor, no_lobe = (1.0, 0.0, 0.0), (0.6, 0.0, 0.2), (0.625, 0.375, 0.0)
    for temperatures in (same, others):
        scenes += [
            plate("sandford_robertson", (*numbers, e), number, *temperatures)
            for numbers, e, number in (
                (black, 0.25, 0),
                (no_lobe, 0.25, 1),
                (no_floor, 0.25, 1),
                (no_lobe, 0.25, 0),
            )
        ]
        scenes.append(plate("sandford_robertson", (*black, 0.25), 0, *temperatures, lobe="mirror"))
        scenes.append(plate("sandford_robertson", (*black, 0.25), 0, *temperatures, lobe="diffuse"))
        scenes.append(plate("microfacet", (0.25, 2.0, 1.5, 0.5, 0.0), 4, *temperatures))
        scenes.append(plate("microfacet", (0.25, 2.0, 1.5, 0.5, 0.0), 2, *temperatures))
        scenes.append(plate("microfacet", (0.25, 2.0, 1.0, 0.0, 0.0), 4, *temperatures))
    return scenes
