"""Section of a scenario."""

from dataclasses import asdict

from mi_lcair.results.sections import Facts, Section


def scenario_section(scenario, first=()) -> Section:
    """The entries of a scenario that are given, below the rows `first`."""
    rows = list(first)
    for table, entries in asdict(scenario).items():
        if isinstance(entries, dict):
            given = [
                f"{key} = {value}"
                for key, value in entries.items()
                if value not in (None, {}, [], ())
            ]
            rows += [(f"[{table}]", ", ".join(given))] if given else []
    return Section("Scenario", [Facts(rows)])
