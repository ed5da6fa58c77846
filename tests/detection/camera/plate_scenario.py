"""A scenario of a blackbody plate that faces +x, with a camera, in vacuum."""

from pathlib import Path

from mi_lcair.detection.scenario import Scenario
from tests.detection.disc_scenario import disc, write_disc

CAMERA = {
    "focal_length_mm": 100.0,
    "f_number": 4.0,
    "pitch_um": 15.0,
    "width": 64,
    "height": 48,
    "integration_time_ms": 0.05,
    "well_Me": 5.0,
}


def plate(folder: Path, width: float, height: float, **changes) -> Scenario:
    """The scenario of a plate with these sides, m, at 300 K on 280 K.

    Dots in the keys of changes are written as two underscores.
    """
    write_disc(folder)
    file = folder / "disc.xml"
    text = file.read_text()
    start, end = text.index('<shape type="ply">'), text.index("<bsdf")
    shape = '<shape type="rectangle"> <transform name="to_world"> <rotate y="1" angle="90"/>'
    shape += f' <scale y="{width / 2}" z="{height / 2}"/> </transform>'
    file.write_text(text[:start] + shape + text[end:])
    entries = {"camera__" + name: value for name, value in CAMERA.items()}
    entries |= {"target__parameters": {"temperature": 300}, "background__temperature": 280}
    return disc(folder, **entries | changes)
