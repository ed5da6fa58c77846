"""Units of columns, which the ends of their names state."""

# End of a column's name: its unit as UDUNITS, and so xarray and netCDF, write it.
UNITS = {
    "_W_m2_sr_um": "W m-2 sr-1 um-1",
    "_W_m2_sr": "W m-2 sr-1",
    "_W_sr_um": "W sr-1 um-1",
    "_W_sr": "W sr-1",
    "_W_m2": "W m-2",
    "_W": "W",
    "_mK": "mK",
    "_K": "K",
    "_m2": "m2",
    "_km": "km",
    "_um": "um",
    "_m": "m",
    "_per_sr": "sr-1",
    "_sr": "sr",
    "_deg": "degree",
    "_ms": "ms",
    "_s": "s",
}


def unit_of(name: str) -> str:
    """Unit of the column `name`, such as "W sr-1"; "" for a number without one."""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def quantity_of(name: str) -> str:
    """What the column `name` holds, in words: the name without its unit."""
    end = next((end for end in UNITS if name.endswith(end)), "")
    return name.removesuffix(end).replace("_", " ")
