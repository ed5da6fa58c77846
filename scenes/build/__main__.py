"""Write every facet model into a folder: `python -m mi_lcair.scenes.build FOLDER`.

For each model it writes the labelled OBJ and the files that `mi-lcair import` makes from it. The
bundled scenes use the files in scenes/models.
"""

import sys
from pathlib import Path

from mi_lcair import models3d
from mi_lcair.scenes.build.airliner import airliner
from mi_lcair.scenes.build.cylinder import cylinder
from mi_lcair.scenes.build.surroundings import ir_range, world_sphere
from mi_lcair.scenes.build.wavefront import wavefront

# Default sky: an overcast summer day, the table closest to the thesis's sky (3.4.2.2). A scene may
# name another one.
SKY = "midlat_summer_stratus"


def models() -> dict[str, str]:
    """Return the models: name -> text of the OBJ."""
    built = {
        "cylinder_bare_aluminum": cylinder("bareAl"),
        "cylinder_gloss_black": cylinder("gloss_black"),
        "ir_range": ir_range(),
        "a340": [facet for body in airliner().values() for facet in body],
        "world_sphere": world_sphere(),
    }
    comment = "mi_lcair scenes/build, metres; x forward, y left, z up"
    return {name: wavefront(model, comment) for name, model in built.items()}


def main(folder):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in models().items():
        obj = folder / f"{name}.obj"
        obj.write_text(text, encoding="ascii", newline="\n")
        sky = SKY if name == "world_sphere" else None
        models3d.export(models3d.read(obj), folder / name, sky=sky, overwrite=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m mi_lcair.scenes.build FOLDER")
    main(sys.argv[1])
