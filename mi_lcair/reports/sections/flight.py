"""Sections of a flight."""

from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, LongTable, Section


def sections(flight) -> list[Section]:
    """The first detection, the extremes of the quantities, and the table of a flight."""
    facts = [
        ("traced views", f"{flight.views} of {len(flight.table['time_s'])} moments"),
        (
            "interpolated within",
            f"{flight.interpolation_error:.2g} of the target's irradiance",
        ),
        ("first detection", flight.detection()),
    ]
    if flight.rendered is not None:
        facts.append(("rendered frames", f"{flight.rendered} of {len(flight.table['time_s'])}"))
    for name in ("range_m", "intensity_W_sr", "contrast_W_m2", "snr"):
        if name in flight.table:
            values = flight.table[name]
            facts.append((name, f"{values.min():.5g} to {values.max():.5g}"))
    return [Section("Flight", [summary_of(flight), Facts(facts), LongTable(flight.columns())])]
