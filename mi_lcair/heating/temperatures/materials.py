"""Grounds and walls by name, with the uncertainties of a sample that is not known any better."""

from functools import cache
from pathlib import Path

from mi_lcair.errors import check_known
from mi_lcair.estimate import parsed, relative
from mi_lcair.files import parse_toml, read_text

FILE = Path(__file__).with_name("materials.toml")
# What a given key of a group takes the place of
REPLACED = {
    "h_W_m2_K": ("roughness_mm", "heat_roughness_mm"),
    "plate": ("roughness_mm", "heat_roughness_mm"),
    "wetness": ("resistance_s_m",),
    "resistance_s_m": ("wetness",),
    "capacity_at_K": ("capacity_J_kg_K",),
}
OF_SURFACE = ("absorptance", "emissivity", "albedo")
NOT_OF_A_LAYER = ("layers", "temperature")  # a group with these keeps its surface only


@cache
def materials() -> dict[str, dict]:
    """The entries of the file by material."""
    return parse_toml(read_text(FILE, str(FILE)), str(FILE))


def values_of(name: str, given: dict, keys=None) -> dict:
    """What a material gives of a group or a layer, without what the given keys replace.

    keys: those that may be given; all of the material if None.
    """
    check_known("material", materials(), name)
    left_out = {"source", "h", *given, *(x for key in given for x in REPLACED.get(key, ()))}
    if "heat_capacity" in given or "layers" in given:
        left_out |= {"capacity_at_K", "capacity_J_kg_K"}
    is_surface = any(key in given for key in NOT_OF_A_LAYER)
    allowed = OF_SURFACE if is_surface else keys or materials()[name]
    values = {k: v for k, v in materials()[name].items() if k in allowed and k not in left_out}
    return {k: parsed(v)[0] if isinstance(v, str) else v for k, v in values.items()}


def sigmas_of(name: str, filled: tuple[str, ...]) -> dict[str, float | str]:
    """Standard uncertainties of what a material gave, and of h, as [sigma] states them."""
    result = {}
    for key, value in materials()[name].items():
        if key == "h":
            result[key] = value
        elif key in filled and isinstance(value, str) and key != "thickness_mm":
            stated = value.partition("+-")[2].strip()
            result[key] = stated if relative(stated) is not None else float(stated)
    return result
