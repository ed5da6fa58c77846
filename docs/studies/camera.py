"""Draw the airliner on its approach as a camera sees it, at three ranges.

    python -m docs.studies.camera [PICTURE]

It writes PICTURE (default docs/validation/landing/camera.png) and prints the measures. It takes
less than a minute on two cores.
"""

import sys
from pathlib import Path

import mi_lcair
from mi_lcair.cli.output import print_columns
from mi_lcair.detection.scenario import Scenario
from mi_lcair.drawing import new_figure, styled, write_figure
from mi_lcair.show.pictures.image import draw_frame

RANGES_M = (500.0, 2000.0, 5000.0)
CAMERA = {
    "focal_length_mm": 50.0,
    "f_number": 2.0,
    "pitch_um": 15.0,
    "width": 640,
    "height": 512,
    "integration_time_ms": 2.0,
    "well_Me": 4.98,
    "quantum_efficiency": 0.75,
    "read_noise_e": 300.0,
    "gain_nonuniformity": 0.02,
    "nuc": True,
}
SPP, BOUNCES = 256, 5


def scenario(range_m: float) -> Scenario:
    """The scenario of position 3 with a camera, at another range."""
    return Scenario.read(
        "a340_landing/position_3",
        **{
            "observer.range_m": range_m,
            "render.spp": SPP,
            "render.max_bounces": [BOUNCES],
            **{f"camera.{name}": value for name, value in CAMERA.items()},
        },
    )


@styled
def pictures(images: list):
    """Figure with the first frame of each image around its target, side by side."""
    figure = new_figure((4.4 * len(images), 2.5), layout="constrained")
    for axes, image in zip(figure.subplots(1, len(images), squeeze=False)[0], images):
        draw_frame(figure, axes, image)
        measures, observer = image.measures, image.scenario.observer
        axes.set_title(f"{observer.range_m:g} m: {measures.pixels:.0f} pixels on the target")
    return figure


def main(path: Path, ranges=RANGES_M) -> None:
    images = [mi_lcair.image(scenario(range_m), seed=1) for range_m in ranges]
    write_figure(pictures(images), path)
    print_columns(
        [
            ("range m", "pixels", "signal to noise", "NETD mK", "rendering mK"),
            *(
                (
                    f"{image.scenario.observer.range_m:g}",
                    f"{image.measures.pixels:.4g}",
                    f"{image.measures.snr:.4g}",
                    f"{1e3 * image.measures.netd:.3g}",
                    f"{1e3 * image.measures.render_error:.3g}",
                )
                for image in images
            ),
        ]
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/landing/camera.png"))
