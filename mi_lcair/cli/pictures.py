"""Pictures of the command `show`. Each function draws one kind and prints its path."""

from fnmatch import fnmatchcase
from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.output import print_columns, print_json
from mi_lcair.errors import InputError, unknown
from mi_lcair.files import check_writable

MOST_NEIGHBOURS = 20  # largest number of facets in the table; the others are summed


def image(what, output, channels, log):
    """Draw channels of a radiance image."""
    from mi_lcair.rendering.image import read_exr
    from mi_lcair.reports.image_picture import save_picture

    file = Path(what)
    output = output or file.with_suffix(".png")
    image_channels, header = read_exr(file)
    chosen = choose("channel", image_channels, channels or ("Y",))
    title = ", ".join(str(header[key]) for key in ("scene", "band") if key in header) or file.stem
    save_picture(output, {name: image_channels[name] for name in chosen}, title, log)
    click.echo(output)


def facet_columns(what, output, facets, channels, log, parameters, sensor):
    """Draw a scene with its facets coloured by columns of a table."""
    from mi_lcair.rendering.facet_image import FACET, facet_images
    from mi_lcair.reports.image_picture import column_quantity, save_picture
    from mi_lcair.table import read_table

    table = read_table(facets, (FACET,))
    if not channels:
        raise InputError(f"{facets}: say which column with -c; it has {', '.join(table.columns)}")
    chosen = choose(f"column of {facets}", table.columns, channels)
    output = output or facets.with_suffix(".png")
    check_writable(output)
    scene = mi_lcair.load(what, **dict(parameters))
    save_picture(
        output, facet_images(scene, table, chosen, sensor), scene.name, log, column_quantity
    )
    click.echo(output)


def facet_view(what, output, facet, parameters, json):
    """Draw a map of what a facet of a scene sees, and print a table of its neighbours."""
    from mi_lcair.reports.hemispherical_plot import save_plot
    from mi_lcair.signatures.hemispherical_view import hemispherical_view

    output = output or Path(f"{Path(what).stem}_facet_{facet}.png")
    check_writable(output)
    view = hemispherical_view(mi_lcair.load(what, **dict(parameters)), facet)
    save_plot(output, view)
    table = view.as_dict()
    if json:
        print_json({"file": str(output), **table})
        return
    *neighbours, nothing = table["neighbours"]
    print_columns(
        [
            ("picture", output),
            (
                "facet",
                f"{facet} of {table['scene_name']}: {table['type']}, group {table['group']}, "
                f"{table['material']}, {table['area_m2']:.6g} m^2",
            ),
        ]
    )
    click.echo()
    rows = [
        (row["facet"], row["group"], row["material"], row) for row in neighbours[:MOST_NEIGHBOURS]
    ]
    rest = neighbours[MOST_NEIGHBOURS:]
    if rest:
        rows.append(
            (
                f"{len(rest)} more",
                "",
                "",
                {key: sum(row[key] for row in rest) for key in ("solid_angle_sr", "view_factor")},
            )
        )
    rows += [("nothing", "", "", nothing), ("all", "", "", table)]
    print_columns(
        [
            ("sees", "group", "material", "solid angle (sr)", "view factor"),
            *(
                (*names, f"{row['solid_angle_sr']:.6f}", f"{row['view_factor']:.6f}")
                for *names, row in rows
            ),
        ]
    )


def brdf(what, output, band, theta_deg, materials):
    """Draw the BRDF of a material."""
    from mi_lcair import scenes
    from mi_lcair.physics.materials import names

    if Path(what).suffix.lower() != ".json" and what not in names(materials):
        raise InputError(
            f"'{what}' is no image (.exr), no scene (.xml, {', '.join(scenes.names())}) and no "
            f"material (a fit's .json, {', '.join(names(materials))})"
        )
    if band is None:
        raise InputError(f"material '{what}': give its --band, such as MWIR")
    from mi_lcair.physics.brdf_view import brdf_view
    from mi_lcair.reports.brdf_plot import save_plot

    view = brdf_view(what, band, theta_deg, materials)
    output = output or Path(f"{Path(what).stem}_{view.band.name}_{theta_deg:g}deg.png")
    save_plot(output, view)
    click.echo(output)


def choose(kind: str, known, patterns) -> list[str]:
    """Known names that match the patterns, in the order of the patterns, each once.

    Raises InputError for a pattern without a match. `kind` names it in the message.
    """
    chosen = {}
    for pattern in patterns:
        matches = (
            [pattern]
            if pattern in known
            else [name for name in known if fnmatchcase(name, pattern)]
        )
        if not matches:
            raise unknown(kind, pattern, known)
        chosen |= dict.fromkeys(matches)
    return list(chosen)
