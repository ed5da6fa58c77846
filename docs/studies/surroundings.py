"""Draw a model between different skies and a ground, and compare `sky` with the landing's meshes.

    python -m docs.studies.surroundings [PICTURE]

It writes PICTURE (default docs/pictures/surroundings.png): apparent temperatures of the drone of
the examples in bare aluminium. It prints its intensities, and those of the airliner of a340_landing
between the meshes of its sky and below the emitter `sky`. It takes a minute on two cores.
"""

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.cli.output import print_columns
from mi_lcair.physics.surroundings import Words

GROUND = "288,0.95"
AROUND = {
    "in a void": None,
    "under a clear sky": Words(sky="clear", ground=GROUND),
    "under clouds": Words(sky="overcast", ground=GROUND),
    "by day": Words(sky="clear", ground=GROUND, sun="45,60"),
}
VIEW = {"azimuth_deg": 50, "elevation_deg": 15, "band": "MWIR", "resolution": 160}
VOID_K, AROUND_K = (180.0, 270.0), (272.0, 292.0)  # ends of the scales, without and with a sky
MESHES = (
    r'\s*<path value="models/world_sphere"/>\s*<include filename="models/world_sphere/model.xml"/>'
)
SKY = """
    <emitter type="sky"> <string name="band" value="$band"/> <string name="sky" value="$sky"/>
        <float name="ground_temperature" value="302.5"/> </emitter>"""


def models(folder: Path) -> dict:
    """The imported drone between its surroundings, by name."""
    file = scenes.FOLDER / "examples" / "drone.obj"
    model = models3d.read(file, forward="-Z", up="Y", material="bare_aluminum", temperature=290.0)
    loaded = {}
    for number, (name, around) in enumerate(AROUND.items()):
        models3d.export(model, folder / str(number), around=around)
        loaded[name] = mi_lcair.load(folder / str(number), **VIEW)
    return loaded


def draw(path: Path, loaded: dict) -> None:
    figure, panels = plt.subplots(
        1, len(loaded), figsize=(3 * len(loaded), 3.9), layout="constrained", sharey=True
    )
    for panel, (name, scene) in zip(panels, loaded.items()):
        low, high = AROUND_K if AROUND[name] else VOID_K
        image = mi_lcair.render(scene, spp=1024).channels["temperature.Y"]
        half = np.linalg.norm(scene.sensors[0].world_transform().matrix.numpy()[:3, 0])
        extent = half * np.array([-1, 1, -1, 1])
        drawn = panel.imshow(image, vmin=low, vmax=high, cmap="gray", extent=extent)
        panel.set(title=name, xlabel="m")
        if panel in (panels[0], panels[-1]):
            of_scale = panels[:1] if panel is panels[0] else panels[1:]
            where = {"location": "bottom", "shrink": 0.8, "aspect": 20 * len(of_scale)}
            bar = figure.colorbar(drawn, ax=of_scale, extend="both", **where)
            bar.set_label("apparent temperature in 3-5 um (K)")
    panels[0].set_ylabel("m")
    figure.savefig(path, dpi=110, bbox_inches="tight")


def landing(sky: str, band: str) -> list[float]:
    """Intensities of the airliner between meshes and under the emitter `sky`, and their ratio."""
    text = scenes.path("a340_landing").read_text(encoding="utf-8")
    around, count = re.subn(MESHES, SKY, text)
    assert count == 1
    with TemporaryDirectory() as folder:
        file = Path(folder) / "landing.xml"
        head, rest = around.split("\n", 1)
        file.write_text(f'{head}\n<path value="{scenes.FOLDER}"/>\n{rest}', encoding="utf-8")
        results = [
            mi_lcair.signature(mi_lcair.load(source, sky=sky, band=band), tolerance=0.003)
            for source in ("a340_landing", file)
        ]
    values = [result.target.intensity for result in results]
    return [*values, values[1] / values[0] - 1]


def main(path: Path) -> None:
    with TemporaryDirectory() as folder:
        loaded = models(Path(folder))
        draw(path, loaded)
        rows = [
            (name, f"{mi_lcair.signature(scene, tolerance=0.005).target.intensity:.4g}")
            for name, scene in loaded.items()
        ]
    print_columns([("drone", "W/sr"), *rows])
    rows = []
    for sky in ("midlat_summer_stratus", "midlat_summer_clear"):
        for band in ("MWIR", "LWIR"):
            meshes, emitter, ratio = landing(sky, band)
            rows.append((sky, band, f"{meshes:.5g}", f"{emitter:.5g}", f"{100 * ratio:+.2f} %"))
    print_columns([("landing", "band", "meshes W/sr", "sky W/sr", "difference"), *rows])


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/surroundings.png"))
