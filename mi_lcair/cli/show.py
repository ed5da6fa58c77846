"""mi-lcair show: pictures of a radiance image."""
from fnmatch import fnmatchcase
from pathlib import Path

import click

from mi_lcair.errors import InputError, unknown


@click.command("show")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE.exr")
@click.option("-c", "--channel", "patterns", multiple=True, default=("Y",), show_default="Y",
              help="Channel, or a pattern such as 'bounce*'; may be repeated.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The picture (default: FILE.png).")
@click.option("--log", is_flag=True, help="Logarithmic colours.")
def command(file, patterns, output, log):
    """Make a PNG of a radiance image.

    It shows one channel or several of an OpenEXR image, with colour bars in W m^-2 sr^-1, K or m.
    """
    from mi_lcair.rendering.image import read_exr
    from mi_lcair.rendering.picture import save_picture

    output = output or file.with_suffix(".png")
    if output.suffix.lower() != ".png":
        raise InputError(f"output '{output}' does not end in .png; show makes PNG pictures")
    channels, header = read_exr(file)
    chosen = choose(channels, patterns)
    title = ", ".join(str(header[key]) for key in ("scene", "band") if key in header) or file.stem
    save_picture(output, {name: channels[name] for name in chosen}, title, log)
    click.echo(output)


def choose(known, patterns) -> list[str]:
    """The known channels that the patterns name, in the order of the patterns, each once."""
    chosen = {}
    for pattern in patterns:
        found = [pattern] if pattern in known else [name for name in known if fnmatchcase(name, pattern)]
        if not found:
            raise unknown("channel", pattern, known)
        chosen |= dict.fromkeys(found)
    return list(chosen)
