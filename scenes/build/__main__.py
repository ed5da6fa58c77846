"""`python -m mi_lcair.scenes.build FOLDER` writes every facet model into FOLDER as a labelled OBJ."""
import sys
from pathlib import Path

from .airliner import airliner
from .cylinder import cylinder
from .surroundings import ir_range, world_sphere
from .wavefront import wavefront


def models() -> dict[str, str]:
    """File name -> text of the OBJ."""
    facets = {
        "cylinder_bare_aluminum.obj": cylinder("bareAl"),
        "cylinder_gloss_black.obj": cylinder("gloss_black"),
        "ir_range.obj": ir_range(),
        "a340.obj": [facet for body in airliner().values() for facet in body],
        "world_sphere.obj": world_sphere(),
    }
    comment = "mi_lcair scenes/build, metres; x forward, y left, z up"
    return {name: wavefront(model, comment) for name, model in facets.items()}


def main(folder):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in models().items():
        (folder / name).write_text(text, encoding="ascii", newline="\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m mi_lcair.scenes.build FOLDER")
    main(sys.argv[1])
