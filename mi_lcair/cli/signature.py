"""mi-lcair signature: the intensity of a scene in W/sr."""
import click

import mi_lcair
from mi_lcair.cli.options import scene_options
from mi_lcair.cli.output import print_columns, print_json


@click.command("signature")
@scene_options
def command(options):
    """Intensity of SCENE in W/sr.

    SCENE is a Mitsuba XML file or the name of a bundled scene, seen by its orthographic sensor. The intensity is listed
    by number of reflections, by what emitted it and by what the sensor sees first.
    """
    result = options.run(mi_lcair.signature).as_dict()
    if options.json:
        print_json(result)
        return
    error = result["standard_error"]
    print_columns([("band", result["band"]),
                   ("intensity", f"{result['intensity']:.6g} W/sr"),
                   ("standard error", "unknown for one sample" if error is None else f"{error:.2g} W/sr"),
                   ("time", f"{result['seconds']:.2f} s"),
                   ("paths", result["paths"])])
    for title, parts in (("reflections up to", enumerate(result["by_bounce"])),
                         ("emitted by", result["by_group"].items()),
                         ("seen first", result["by_seen"].items())):
        click.echo()
        print_columns([(title, "W/sr"), *((name, f"{intensity:.6g}") for name, intensity in parts)])
