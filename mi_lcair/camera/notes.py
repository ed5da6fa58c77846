"""What is noted beside an image: the header of its file, and remarks on its limits."""

from dataclasses import asdict

import mi_lcair
from mi_lcair.camera.electronics.calibration import AVERAGED
from mi_lcair.camera.exposure import Exposure
from mi_lcair.camera.quality import Measures
from mi_lcair.camera.view import CameraView
from mi_lcair.detection.scenario import Scenario
from mi_lcair.physics.imager import Imager

# What makes the rendering more certain, by whether a tolerance was reached; None without one.
REMEDIES = {None: "raise spp", True: "lower the tolerance", False: "raise max_spp"}


def remarks(
    imager: Imager, view: CameraView, channels: dict, measures: Measures, reached
) -> list[str]:
    """Remarks on the limits of an image, one line each.

    `reached` says whether a tolerance was reached; None without one.
    """
    lines = []
    if measures.saturated:
        share = float(f"{100 * measures.saturated:.2g}")
        most = 1e-6 * (channels["electrons.Y"].max() + imager.dark)
        lines.append(
            f"the detector is saturated in {share:g} % of the pixels, which collect up to "
            f"{most:.4g} Me in a well of {imager.well_Me:g} Me: "
            "their temperature is at least the stated one; shorten integration_time_ms"
        )
    if view.is_cut:
        lines.append(
            "a part of the target is outside the frame; signal, pixels and ranges are those of the "
            "part inside"
        )
    if (speckle := channels["speckle.Y"]).any():
        most, share = channels["stderr_K.Y"].max(), f"{100 * speckle.mean():.2g} %"
        lines.append(
            f"the rendering's error, up to {most:.2g} K, is larger than the camera's noise in "
            f"{share} of the pixels, which speckle.Y marks, and is the same in all frames; "
            f"{REMEDIES[reached]} of [render]"
        )
    return lines


def header(
    scenario: Scenario, scene, exposed: Exposure, measures: Measures, bounces: int, frames, seed
) -> dict:
    """Header of the EXR: the scenario, the camera, its measures and the versions."""
    given = {name: value for name, value in asdict(scenario.camera).items() if value is not None}
    camera = {f"camera_{name}": value for name, value in given.items()}
    return {
        "scenario": scenario.name,
        "scene": scene.name,
        "band": scenario.sensor.detector().band.name,
        "units": "apparent.Y: W m^-2 sr^-1; electrons, counts.Y: 1; others: K",
        "max_bounces": bounces,
        "spp": exposed.spp,
        "rms_error": exposed.rms_error,
        "range_m": scenario.observer.range_m,
        "frames": frames,
        "noise_seed": str(seed),
        "seed": str(scenario.render.seed),
        "netd_K": measures.netd,
        "electrons_per_count": scenario.camera.electrons_per_count,
        "pedestal_counts": scenario.camera.pedestal,
        "nuc_frames": AVERAGED if scenario.camera.nuc else 0,
        "versions": f"mi_lcair {mi_lcair.__version__}",
        **camera,
    }
