"""`python -m mi_lcair.scenes.build FOLDER` writes every facet model into FOLDER: the labelled OBJ,
and what `mi-lcair import` makes of it. The bundled scenes use those of scenes/models.
"""

import sys
from pathlib import Path

from mi_lcair import models3d as facets
from mi_lcair.scenes.build.airliner import airliner
from mi_lcair.scenes.build.cylinder import cylinder
from mi_lcair.scenes.build.surroundings import ir_range, world_sphere
from mi_lcair.scenes.build.wavefront import wavefront

# an overcast summer day, nearest to the thesis's (3.4.2.2); scenes may name another
SKY = "midlat_summer_stratus"


def models() -> dict[str, str]:
    """Name -> text of the OBJ."""
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
        facets.export(facets.read(obj), folder / name, sky=SKY if name == "world_sphere" else None)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m mi_lcair.scenes.build FOLDER")
    main(sys.argv[1])
