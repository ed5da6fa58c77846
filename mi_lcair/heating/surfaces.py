"""Surfaces of a scene in the band in which heat is exchanged or sunlight is absorbed.

The scene keeps its band. A material that has a name is taken from its materials file in the band
that is asked for. A surface that is given by numbers, or a BSDF of Mitsuba's, stays as it is.
"""

from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics import materials
from mi_lcair.physics.bands import Band, band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.derivatives import children
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.rendering.facets.tracer import Surface
from mi_lcair.rendering.scene import Scene

TOTAL, SOLAR = "total", "0.3-2.5"  # bands of the exchanged heat and of sunlight, um
STAND_IN = "LWIR"  # band that stands in for the total band
# What the radiation of a band is, and the temperature of its spectrum [K]
RADIATION = {TOTAL: ("heat", 300.0), SOLAR: ("sunlight", 5772.0)}
UNUSED = "its emissivity is not used; a surface emits and absorbs what its BSDF does not reflect"


@dataclass
class Surfaces:
    """The different surfaces of a scene in a band.

    of_band: TOTAL or SOLAR. different: the surfaces. of_shape: index of each shape's surface.
    remarks: what stands in for what, one line each.
    """

    of_band: str
    different: list[Surface] = field(default_factory=list)
    of_shape: list[int] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @staticmethod
    def of(scene: Scene, of_band: str) -> "Surfaces":
        """The surfaces of a scene in the band TOTAL or SOLAR.

        Raises InputError for a plume that transmits, for a BSDF whose emissivity cannot be known,
        and for a material without an entry that could be used.
        """
        surfaces, index = Surfaces(of_band), {}
        for shape in scene.mi.shapes():
            bsdf = shape.bsdf()
            if is_plume(bsdf) and bsdf.transmits:
                raise InputError(
                    f"shape '{shape.id()}': the transmittance of a plume holds in the band "
                    f"{scene.band.label} and not for heat; leave the plume out or make it opaque"
                )
            emitter = shape.emitter()
            if is_thermal(emitter) and emitter.given_emissivity is not None:
                surfaces.remarks.append(f"shape '{shape.id()}': {UNUSED}")
            key, make = surfaces._in_band(bsdf, scene)
            if key not in index:
                index[key] = len(surfaces.different)
                made = make()
                surfaces.different.append(Surface(made, partial(emissivity_of(made).eval, made)))
            surfaces.of_shape.append(index[key])
        surfaces.remarks = list(dict.fromkeys(surfaces.remarks))
        return surfaces

    def _in_band(self, bsdf, scene: Scene):
        """A key that is equal for equal surfaces, and a function that makes the BSDF."""
        layers = children(bsdf) if bsdf.class_name() == "TwoSidedBRDF" else [bsdf]
        if not all(is_reflection_bsdf(layer) for layer in layers):
            return bsdf, lambda: bsdf
        described = [self._described(layer, scene.band) for layer in layers]
        if layers[0] is not bsdf:
            described = [{"type": "twosided", **dict(zip(("front", "back"), described))}]
        return repr(described), lambda: mi.load_dict(described[0], parallel=False)

    def _described(self, layer, of_scene: Band) -> dict:
        """The plugin of a layer in the band; of_scene: the scene's band."""
        if layer.emissivity != "kirchhoff":
            self.remarks.append(f"bsdf '{layer.id()}': {UNUSED}")
        if layer.named is None:
            if not of_scene.is_total and layer.model.name != "grey":
                self._stands_in(f"bsdf '{layer.id()}'", of_scene)
            source, parameters = layer, dict(zip(layer.model.names, layer.values))
        else:
            source = self._material(*layer.named)
            parameters = source.parameters
        return {"type": source.model.name, **parameters, "form": source.form, "lobe": layer.lobe}

    def _material(self, name: str, file) -> materials.Material:
        """The entry of a material for the band, or one that stands in."""
        used, entry = band(self.of_band), None
        with suppress(InputError):
            entry = materials.material(name, used, file)
        if entry is None:
            is_total = used.is_total
            try:
                used = band(STAND_IN) if is_total else used
                entry = materials.material(name, used, file, allow_band=not is_total)
            except InputError:
                raise InputError(
                    f"material '{name}': has no entry for the band {self.of_band}"
                    f"{f' or {STAND_IN}' * is_total}, only for "
                    f'{", ".join(materials.bands_of(name, file))}; add [{name}."{self.of_band}"] '
                    "to its materials file"
                ) from None
            used = band(entry.band)
            self._stands_in(f"material '{name}'", used)
        kelvin = RADIATION[self.of_band][1]
        return entry if entry.spectrum is None else entry.averaged(used, kelvin)

    def _stands_in(self, what: str, used: Band) -> None:
        of, kelvin = RADIATION[self.of_band]
        share = in_band_radiance(used, kelvin) / in_band_radiance(band(TOTAL), kelvin)
        self.remarks.append(
            f"{what}: its numbers of the band {used.label} stand in for {self.of_band}, although "
            f"that band holds {share:.0%} of the {of} at {kelvin:g} K"
        )


def hemispherical_emissivity(surface: Surface, nodes: int = 64) -> np.ndarray:
    """Hemispherical emissivity of each side of a surface that emits, (sides,).

    That of a texture is about the mean over it.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    sin2 = np.tile((x + 1) / 2, len(surface.sides))  # cos sin d(theta) = d(sin^2) / 2
    side = np.repeat(surface.sides, nodes)
    si = dr.zeros(mi.SurfaceInteraction3f, len(side))
    si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.wi = mi.Vector3f(mi.Float(np.sqrt(sin2)), 0, mi.Float(side * np.sqrt(1 - sin2)))
    si.uv = mi.Point2f(np.random.default_rng(0).random((2, len(side))))
    emitted = surface.emissivity(si, mi.Bool(True))
    return np.broadcast_to(emitted.numpy(), len(side)).reshape(-1, nodes).astype(float) @ w / 2
