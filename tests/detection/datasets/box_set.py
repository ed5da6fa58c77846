"""A small data set of the box of the examples: a scenario with a camera, and its description."""

from pathlib import Path

from mi_lcair import models3d, scenes
from mi_lcair.toml_table import text_of

SCENARIO = {
    "target": {"scene": "box/scene.xml"},
    "observer": {"range_m": 60, "azimuth_deg": 0, "elevation_deg": 10},
    "atmosphere": {"table": "vacuum"},
    "background": {"temperature": 285},
    "sensor": {"band": "LWIR"},
    "render": {"max_bounces": [2], "spp": 4},
    "camera": {
        "focal_length_mm": 8,
        "f_number": 2,
        "pitch_um": 15,
        "width": 32,
        "height": 24,
        "integration_time_ms": 0.2,
        "well_Me": 20,
        "read_noise_e": 300,
        "gain_nonuniformity": 0.01,
    },
}
DESCRIPTION = {
    "base": {"scenario": "scenario.toml"},
    "views": {"sphere": 3, "elevation_deg": [10, 60], "range_m": [40, 60], "roll_deg": [-20, 20]},
    "draws": {"background.temperature": {"uniform": [270, 290]}, "lid.temperature": 5},
    "frames": {"cases": 2, "truth": True, "kelvin": True, "seed": 7},
    "splits": {"train": 0.34, "val": 0.33, "test": 0.33},
}


def write_box(folder: Path, **tables) -> Path:
    """Write the box, scenario.toml and dataset.toml, and return the path of the description.

    tables: tables that replace those of DESCRIPTION; None leaves one out.
    """
    if not (folder / "box").exists():
        (folder / "box").mkdir()
        model = models3d.read(scenes.FOLDER / "examples" / "box.obj")
        models3d.export(model, folder / "box")
        (folder / "scenario.toml").write_text(f"# The box.\n{text_of(SCENARIO)}")
    tree = {name: table for name, table in (DESCRIPTION | tables).items() if table is not None}
    (folder / "dataset.toml").write_text(text_of(tree))
    return folder / "dataset.toml"
