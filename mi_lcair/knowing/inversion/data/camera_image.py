"""A camera's image of a scenario as a measurement: electrons of its pixels, with derivatives."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy import fft

from mi_lcair.derivatives.common_numbers import MOST, PIXELS, pixel_step
from mi_lcair.detection.camera.electronics import electrons, signal_of
from mi_lcair.detection.camera.exposure import Exposure, exposure
from mi_lcair.detection.camera.image import Shot
from mi_lcair.detection.camera.optics import OVERSAMPLING
from mi_lcair.detection.camera.scenery import Scenery
from mi_lcair.detection.camera.view import CameraView, Pointing, axes_of
from mi_lcair.detection.irradiance import QUANTITIES, in_weather, weather_quantities
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import rendered_as
from mi_lcair.errors import InputError, errors_of
from mi_lcair.knowing.budgets.contrast_number import BEHIND, present
from mi_lcair.knowing.budgets.number import SOURCE_STEP
from mi_lcair.knowing.inversion.data.readings import check_counts, values_that_count
from mi_lcair.plugins.emission.source import rounded
from mi_lcair.plugins.emission.sources import Sources
from mi_lcair.rendering.images.files import KELVIN, TEMPERATURE
from mi_lcair.rendering.motions.motion import FULL_TURN_DEG, LARGEST_PX, OBSERVER
from mi_lcair.rendering.motions.pose import known_motions
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.parameters.values import changed as with_values
from mi_lcair.rendering.parameters.values import parameter
from mi_lcair.rendering.views import Target

COUNTS = "counts"
CHANNELS = {COUNTS: "counts.Y", TEMPERATURE: "temperature.Y"}  # of the file of `mi-lcair image`
SPREAD_PIXELS = 64  # pixels along a side in which the spread of the optics is computed
# Kinds of parameters whose derivatives are differences; "scenario" is the weather
BY_DIFFERENCES = ("material", "spectrum", "emissivity", "scenario", "motion")
STEP = 0.01  # change of a parameter for such a difference, relative to its range
STEP_K = 1.0  # change of the temperature of sky or ground
ROOM = 1  # pixels around the model that the window has, so that the model can move
# Motions of the camera by name: the entry of `Pointing`, unit and bound
POINTING = {
    f"{OBSERVER}.x_px": ("x_px", "pixel", LARGEST_PX),
    f"{OBSERVER}.y_px": ("y_px", "pixel", LARGEST_PX),
    f"{OBSERVER}.roll_deg": ("roll_deg", "deg", FULL_TURN_DEG),
}
FULL = 4.0  # standard deviations from either end of the span up to which a pixel is saturated


@dataclass(frozen=True)
class CameraImage(Shot):
    """A scenario whose image a camera recorded.

    pointing: values of POINTING.
    """

    pointing: Pointing = Pointing()

    @staticmethod
    def of(source: str, entries: Mapping, motions: Mapping = MappingProxyType({})) -> "CameraImage":
        """The image of a scenario with other entries, by dotted key, and more motions.

        Raises InputError if the scenario cannot be used, or has no camera.
        """
        scenario = Scenario.read(source, **entries).with_motions(motions)
        with errors_of(source):
            return CameraImage(**vars(Shot.of(scenario, 0))).facing()

    @property
    def aspect(self) -> tuple:
        """What a view of the target depends on, for `CameraView.of` and `axes_of`."""
        observer = self.scenario.observer
        return self.setting.target, observer.view, observer.range_m, self.scenario.camera

    def facing(self, room: int = 0) -> "CameraImage":
        """The image with a window for the present pose of the model, and room in it [pixels]."""
        present = Target.of(self.setting.view)
        return self.through(CameraView.of(*self.aspect, self.pointing, present, room))

    def through(self, view: CameraView) -> "CameraImage":
        """The image in another view of the camera."""
        return replace(self, view=view, scenery=Scenery.of(self.scenario, self.setting, view))

    def known(self) -> dict[str, Parameter]:
        """The weather of the air, and the pointing of the camera, by name."""
        pointing = {
            name: Parameter(name, "motion", getattr(self.pointing, entry), unit, -most, most)
            for name, (entry, unit, most) in POINTING.items()
        }
        return pointing | weather_quantities(self.scenario.atmosphere)

    def in_conditions(self, values: Mapping[str, float]) -> "CameraImage":
        """The image for values of weather and pointing; its scene is lit in it from then on."""
        weather = {name: value for name, value in values.items() if name in QUANTITIES}
        pointing = {POINTING[name][0]: value for name, value in values.items() if name in POINTING}
        image = replace(self, pointing=replace(self.pointing, **pointing))
        if weather:
            scenario = in_weather(self.scenario, weather)
            setting = self.setting.through(scenario)
            setting.light.shine_on(setting.view)
            image = replace(image, scenario=scenario, setting=setting)
        axes = axes_of(*self.aspect, image.pointing)
        return image.through(replace(self.view, **axes))

    def with_value(self, name: str, value: float, predict: Callable) -> np.ndarray:
        """What `predict` gives of this image with another value of a parameter, in this window."""
        if name not in self.known():
            with with_values(self.setting.view, {name: value}):
                return predict(self.present)
        try:
            return predict(self.in_conditions({name: value}))
        finally:
            self.setting.light.shine_on(self.setting.view)

    @property
    def present(self) -> "CameraImage":
        """The image before the sky and the ground that the scene has now."""
        if self.scenario.surroundings is None:
            return self
        scenario, setting, scale = present(self.scenario, self.setting)
        scenery = Scenery.of(scenario, setting, self.view, scale)
        return replace(self, scenario=scenario, setting=setting, scenery=scenery)

    def step(self, of: Parameter) -> float:
        """Change of a parameter over which its derivative is taken."""
        if of.kind == "temperature":
            return STEP_K
        if of.kind == "scenario":
            return STEP * (of.upper - of.lower)
        if of.kind != "motion":
            return STEP * min(of.upper - of.lower, 1.0)
        if of.unit == "pixel":
            return PIXELS
        if of.name in POINTING:
            angle = PIXELS / (np.hypot(*self.view.size) / 2 / self.view.parts)
            return min(float(np.degrees(angle)), MOST[of.unit])
        scene = self.setting.view
        motion = known_motions(scene)[of.name]
        return pixel_step(scene, self.view.sensor(scene), motion, self.view.parts)

    @cached_property
    def spread(self) -> float:
        """Number of pixels that share an error of a sample of the render.

        With h the point spread function over samples, whose sum is 1, the variance of a pixel is
        sum h^2 times that of a sample. The variance of a sum of many pixels is 1 / OVERSAMPLING^2
        times that of a sample for each pixel.
        """
        shape = (OVERSAMPLING * SPREAD_PIXELS,) * 2
        h = fft.irfft2(self.camera.optics.transfer(shape), shape)
        return float(1 / (OVERSAMPLING**2 * np.sum(h**2)))

    def measured(self, entry) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Electrons of the scene in each pixel of a measurement, which pixels count, and which do
        not because they seem to be saturated, (H, W).

        The illumination and the emission of the optics are corrected. Saturated pixels, and those
        without a temperature, do not count.
        """
        imager, camera = self.scenario.camera, self.camera
        is_exr = Path(entry.image).suffix.lower() == ".exr"
        quantity = entry.quantity or (TEMPERATURE if is_exr else None)
        channel = entry.channel or (CHANNELS.get(quantity) if is_exr else None)
        size = imager.height, imager.width
        values, quantity, counts, plateau = values_that_count(
            entry, channel, quantity, camera.band, size
        )
        if quantity == COUNTS:
            values = camera.design.applied(signal_of(imager, values))
        elif quantity == TEMPERATURE:
            counts &= values > KELVIN.lower
            values = electrons(camera.band, np.where(counts, values, KELVIN.lower))
        else:
            raise InputError(f"quantity = {quantity}; a camera's image has {' or '.join(CHANNELS)}")
        collected = camera.design.undone(values) + imager.dark
        counts &= collected < imager.well - FULL * imager.noise(imager.well)
        counts &= collected > imager.floor + FULL * imager.noise(imager.floor)
        check_counts(entry.image, counts)
        return values, counts, plateau

    def noise(self, is_corrected: bool, counts: np.ndarray):
        """Function that gives the standard deviation of pixels for predicted electrons, (n,).

        is_corrected: whether the camera has corrected its fixed pattern. counts: pixels, (H, W).
        """
        camera, design = self.camera, self.camera.design

        def of_pixels(values: np.ndarray | float) -> np.ndarray:
            return np.broadcast_to(values, counts.shape)[counts]

        gain, offset = of_pixels(design.gain), of_pixels(design.offset)

        def deviation(predicted: np.ndarray) -> np.ndarray:
            signal = np.maximum(gain * predicted + offset, 0)
            return camera.noise(signal, not is_corrected) / gain

        return deviation

    def predicted(
        self, names, spp: int | None, seed: int, randomisations: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Electrons of independent renders, (R, H, W), and derivatives, (R, K, H, W).

        names: temperatures of groups, or of parts of groups, parameters of materials, of sky and
        ground, quantities of the weather, motions of the model and those of POINTING. The paths do
        not depend on the temperatures of groups, and each source reaches a pixel with its own
        spectrum through the air. Derivatives with respect to the others are differences of renders
        with the same random numbers.
        """
        scene, known = self.setting.view, self.known()
        images, columns = [], []
        parameters = {name: known.get(name) or parameter(scene, name) for name in names}
        differenced = {
            n for n, of in parameters.items() if of.kind in BY_DIFFERENCES or n in BEHIND
        }
        is_hot = differenced != parameters.keys()
        present = self.present

        def ends(sources: Sources) -> list[Sources]:
            return [
                sources.replaced([source.hotter(step, scene.band) for source in sources.list])
                for step in (SOURCE_STEP, -SOURCE_STEP)
            ]

        with rendered_as(scene, self.scenario.render, each_pixel=True):
            for number in range(seed, seed + randomisations):
                exposed = present.exposed(spp, number, ends if is_hot else lambda sources: ())
                image = present.electrons(exposed)
                images.append(image)

                def predict(other: CameraImage, number=number) -> np.ndarray:
                    return other.electrons(other.exposed(spp, number))

                for name, of in parameters.items():
                    if name in differenced:
                        columns.append(difference(present, of, image, predict))
                        continue
                    numbers = numbers_of(exposed.sources, name, of.value)
                    high, low = (
                        sum(end[f"target.source.{k}"] for k in numbers) for end in exposed.variants
                    )
                    slope = (high - low) / (2 * SOURCE_STEP)
                    columns.append(self.camera.optics.seen(slope, self.view.around))
        images = np.array(images)
        return images, np.array(columns).reshape(randomisations, len(names), *images.shape[1:])

    def exposed(self, spp: int | None, seed: int, variants=lambda sources: ()) -> Exposure:
        """The model in the samples of the frame, with spp in place of the scenario's sampling."""
        sampling = replace(self.scenario.render.of_image(), seed=seed % 2**32)
        if spp is not None:
            sampling = replace(sampling, spp=spp, tolerance=None, max_spp=None)
        behind = self.scenery.of_parts
        return exposure(self.setting, self.view, sampling, self.camera.band, behind, variants)

    def electrons(self, exposed: Exposure) -> np.ndarray:
        """Electrons of the frame with the model before its background, (H, W)."""
        background = self.scenery.image(self.camera.band, self.camera.optics)
        return background + self.camera.optics.seen(exposed.contrast, self.view.around)


def difference(of_image: CameraImage, of: Parameter, image: np.ndarray, predict) -> np.ndarray:
    """Derivative of an image with respect to a parameter by a difference, (H, W).

    The difference is central, or one-sided where a value beside it is not possible. image: that at
    the value of the parameter. predict: gives the electrons of a `CameraImage`.
    """
    step, ends = of_image.step(of), []
    for value in (of.value + step, of.value - step):
        if of.lower <= value <= of.upper:
            with suppress(InputError):
                ends.append((value, of_image.with_value(of.name, value, predict)))
    (first, high), (second, low) = [*ends, (of.value, image)][:2]
    return (high - low) / (first - second)


def numbers_of(sources: Sources, name: str, value: float) -> list[int]:
    """Numbers of the sources that a parameter, a temperature of `value` K, changes.

    Raises InputError for another parameter, and for more temperatures than can be resolved.
    """
    group, is_part, _ = name.removesuffix(".temperature").partition("@")
    numbers = [
        k
        for k, source in enumerate(sources.list)
        if source.group == group
        and source.temperature is not None
        and (not is_part or source.temperature == rounded(value))
    ]
    if not name.endswith(".temperature") or not numbers:
        raise InputError(
            f"'{name}' is unknown; of a camera's image only temperatures of groups, of few "
            "temperatures, parameters of materials, sky and ground, motions and the weather can be "
            "unknown"
        )
    return numbers
