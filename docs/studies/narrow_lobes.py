"""Measure the noise of derivatives with respect to the width of a lobe, pixel by pixel.

    python -m docs.studies.narrow_lobes [PAGE]

The script writes docs/validation/narrow_lobes.md from narrow_lobes.template.md. It takes half a
minute.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import mi_lcair
from docs.studies.page import label, write_page
from mi_lcair.derivatives.images import images_of
from mi_lcair.derivatives.window import columns_of, explored_by, recordings
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.knowing.inversion import ball

RESOLUTION = 64
SPP, IMAGES = 1024, 8  # paths of each pixel, and independent images
OPEN_BOX = "open_box", {"reflector": "gloss_black", "band": "MWIR", "emitter_sampling": "false"}


def lobes(folder: Path):
    """Yield label, scene and name of the lobe's width of the scenes whose pixels are compared."""
    for values in ({"finish": "gloss_black"}, {}):
        scene = mi_lcair.load("cylinder_ir_range", resolution=RESOLUTION, **values)
        yield (
            label("cylinder_ir_range", values),
            scene,
            f"{values.get('finish', 'bare_aluminum')}.e",
        )
    name, values = OPEN_BOX
    scene = mi_lcair.load(name, resolution=RESOLUTION, **values)
    yield label(name, values), scene, "gloss_black.e"
    for e in (0.004, 0.03):
        scene = mi_lcair.load(ball.write_scene(folder, e))
        yield f"plate of `e` = {e}, which mirrors a ball", scene, "paint.e"


def noise_of_pixels(where: str, scene, name: str) -> str:
    """Return the row of a scene: variance of the derivative's pixels with each control variate."""
    camera, sampling = scene.sensor(0), Sampling(spp=SPP)
    windows = Windows.of_image(camera, IMAGES, by_randomisation=True)
    explored = explored_by(columns_of(scene, [name]).values())
    measurands = replace(Measurands.of(None), explored=explored)
    with scene.prepared(explored=explored) as tracer:
        (recording,) = recordings(scene, tracer, camera, [name], measurands)
        total = measure(
            scene, windows, sampling.settled(camera), measurands.with_columns(recording.tables)
        )
    channels = ["column.0", "control.0", "mirror.0"]
    images = [images_of(total, windows, channels[:k]) for k in (1, 2, 3)]
    score, control, mirror = (image.var(axis=0, ddof=1).sum() for image in images)
    gains = f"{score / control:.2g} | {score / mirror:.2g}"
    return f"| {where} | {name} | {gains} | {recording.method[name]} |"


def main(page="docs/validation/narrow_lobes.md") -> None:
    with tempfile.TemporaryDirectory() as folder:
        rows = [noise_of_pixels(*case) for case in lobes(Path(folder))]
    write_page(page, "narrow_lobes", rows="\n".join(rows), spp=SPP, images=IMAGES)


if __name__ == "__main__":
    main(*sys.argv[1:])
