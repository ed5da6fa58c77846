"""Write the page docs/validation/stability.md: where each numerical kernel breaks.

    python -m docs.studies.stability [PAGE]

Computed here are the errors of Float32 over the whole parameter box, with their picture, and the
numbers that follow from a formula. The other numbers of the text are bounds of the tests that it
names. The text is stability.template.md, whose {fields} are filled in. Takes two minutes.
"""

import math
import sys
from pathlib import Path

import numpy as np
from drjit.llvm.ad import Float

from docs.studies import float32_map
from docs.studies.landing import number
from docs.studies.lobe import width_deg
from docs.studies.page import write_page
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.materials import material

WHITE = 0.999  # reflectance of the nearly white closed scenes


def coldest(name: str) -> float:
    """Return the highest temperature with an in-band radiance of 0 in Float32 [K], to 0.01 K."""
    kelvin = np.arange(5, 60, 0.01)
    return float(kelvin[in_band_radiance(band(name), Float(kelvin)).numpy() == 0].max())


def fields(by_b, value, weight, HDR) -> dict[str, str]:
    """Return the numbers of the page, name -> text, from the maps of `float32_map.study`."""
    to_89_9 = float32_map.FROM_HORIZON_DEG >= 0.1
    row, column = np.unravel_index(by_b.argmax(), by_b.shape)
    beyond = np.maximum(value, weight)[~to_89_9]
    missing = lambda reflections: f"{100 * (1 - WHITE ** (reflections + 1)):.2g} %"
    return {
        **{f"zero_{name}": f"{coldest(name):.2f}" for name in ("SWIR", "MWIR", "LWIR")},
        "after_10": missing(10),
        "after_1000": missing(1000),
        "reflections_99": str(math.ceil(math.log(0.01) / math.log(WHITE)) - 1),
        "lobe_width": f"{width_deg(material('bare_aluminum', band('LWIR')).parameters['e']):.2f}",
        "value": number(max(by_b.max(), weight[to_89_9].max()), 2),
        "value_b": f"{float32_map.B[row]:g}",
        "value_e": f"{float32_map.E[column]:.1g}",
        "value_broad": number(by_b[float32_map.B >= 0.01].max(), 2),
        "beyond": number(beyond.max(), 2),
        "beyond_broad": number(beyond[:, float32_map.E > 1e-3].max(), 2),
    }


def main(page: Path) -> None:
    """Write the page and its picture."""
    maps = float32_map.study()
    float32_map.draw(page.with_suffix("") / "float32.png", *maps)
    write_page(page, "stability", **fields(*maps))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/stability.md"))
