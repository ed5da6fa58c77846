"""The shadow in a spherical crater has one temperature in closed form (Ingersoll et al. 1992)."""

import tempfile
from pathlib import Path

from docs.studies.cases.comparison import Comparison
from docs.studies.heat import crater


def compare() -> Comparison:
    """Depths of 1/5 and 1/10 of the diameter, with the sun 10 degrees high."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [crater(Path(folder), ratio) for ratio in (0.2, 0.1)]
    values = zip(*((row["mean"], row["exact"]) for row in rows))
    return Comparison("Shadow of a spherical crater", "K", *map(list, values), reach=0.1)
