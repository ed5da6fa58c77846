"""The table [motions] of a TOML file, in which a user declares motions.

    [motions]
    "exhaust.radius" = {groups = ["hot_parts"], scale = [0, 1, 1], each = true}
    "wing.flap" = {groups = ["self"], displaced = "flap_down.ply"}
    "blob.shape" = {groups = ["self"], control_points = 60}

A file of motions has this table alone. In scenarios, problems and uncertainties it is one of many.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mi_lcair.declared import Described, entry, excludes, one_of
from mi_lcair.errors import InputError
from mi_lcair.files import parse_toml, read_text
from mi_lcair.toml_table import filled

MOTIONS = "motions"  # the table; among the values of a scene's parameters, a file that has it

RULES = (one_of("scale", "displaced", "control_points"), excludes("each", "control_points"))


@dataclass(frozen=True)
class Declared(Described, rules=RULES):
    """A motion that a user declares, see `mi_lcair.rendering.motions.motion`.

    Attributes
    ----------
    groups : tuple of str
        Names of the groups that move.
    scale : tuple of float, optional
        Factors of the displacement along each axis.
    each : bool
        Whether each connected part is scaled about its own centre.
    displaced : str, optional
        PLY file, in place of scale.
    control_points : int, optional
        In place of scale: number of points of the surface, each of which has a motion NAME.0,
        NAME.1 and so on, along the outward normal, in metres. The surface between them follows.
    """

    groups: tuple[str, ...]
    scale: tuple[float, float, float] | None = None
    each: bool = False
    displaced: str | None = entry(None, is_file=True)
    control_points: int | None = entry(None, lower=4, upper=1000)


def read_motions(file: str | Path) -> dict[str, Declared]:
    """The motions of a TOML file by name; raises InputError for what cannot be used."""
    where = f"motions {file}"
    tables = parse_toml(read_text(file, where), where)
    if list(tables) != [MOTIONS]:
        raise InputError(f"{where}: must have one table, [motions]")
    return motions_of(tables[MOTIONS], Path(file).parent, where)


def motions_of(
    table: Mapping, folder: str | Path = ".", where: str = f"[{MOTIONS}]"
) -> dict[str, Declared]:
    """The motions of a table by name; raises InputError for what cannot be used.

    folder: to which the names of files are relative. where: name of the table in messages.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"{where}: must have one table, [motions]")
    declared = {}
    for name, values in table.items():
        of_name = f"{where}: '{name}'"
        if "." not in name:
            raise InputError(
                f'{of_name} must be of the form "OWNER.NAME" in quotes, such as "exhaust.radius"'
            )
        declared[name] = filled(Declared, values, of_name, Path(folder))
    return declared
