"""Sections of a facet model."""

import numpy as np

from mi_lcair.results.sections import Facts, Remarks, Section

COLD = 200.0  # lower temperatures, K, are remarked because they are rare on a surface
OVERLAPS = (("back_to_back", "back to back"), ("one_on_the_other", "one on the other"))


def sections(model, materials=None) -> list[Section]:
    """The figures of a model, and what is remarkable about it.

    materials: file of the user's materials, if any.
    """
    figures = model.entries()
    rows = [
        ("facets", f"{figures['facets']} ({figures['triangles']} triangles)"),
        ("bounding box", " x ".join(f"{a:.4g}" for a in np.diff(model.box, axis=0)[0]) + " m"),
        ("volume", f"{figures['volume']:.6g} m^3"),
        *(
            (f"area of {material}", f"{area:.6g} m^2")
            for material, area in figures["area_by_material"].items()
        ),
        ("temperature", f"{figures['temperature_min']:g} to {figures['temperature_max']:g} K"),
        ("open edges", figures["open_edges"]),
        ("facing inward", figures["inward"]),
        ("without area", figures["degenerate"]),
        ("duplicate", figures["duplicate"]),
        ("not planar", f"{figures['non_planar']} (at most {figures['non_planar_mm']:.3g} mm off)"),
    ]
    remarks = [*model.remarks, *remarkable(figures, materials)]
    return [Section("Model", [Facts(rows), Remarks(remarks)])]


def remarkable(figures: dict, materials):
    """Yield remarks on the figures that a user should know, one line each."""
    from mi_lcair.physics.materials import emits_nothing

    for material in figures["area_by_material"]:
        if emits_nothing(material, materials):
            yield (
                f"material {material} reflects all that arrives and emits nothing: its facets are "
                "black but for what they reflect; name a material that absorbs, such as blackbody, "
                "where they are to radiate by their temperature"
            )
    if figures["temperature_min"] < COLD:
        yield f"the lowest temperature is {figures['temperature_min']:g} K"
    if count := figures["inward"]:
        called = f" ({names})" if (names := figures["inward_names"]) else ""
        yield (
            f"{count} model facet{'s face' if count > 1 else ' faces'} inward{called}; the back of "
            "a facet neither emits nor reflects: turn their normals outward"
        )
    for key, how in OVERLAPS:
        if count := figures[key]["count"]:
            a, b = (
                f"{facet} ({name})" if name else f"{facet}"
                for facet, name in zip(figures[key]["first"], figures[key]["names"])
            )
            more = f" ({count - 1} more pairs)" if count > 1 else ""
            yield (
                f"facets {a} and {b} lie {how} in one plane{more}; which of them is seen is left "
                "to rounding"
            )
