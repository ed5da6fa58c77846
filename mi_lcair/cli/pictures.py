"""Pictures of the command `show`. Each function draws one kind and prints its path."""

from fnmatch import fnmatchcase
from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.output import print_result, print_sections
from mi_lcair.drawing import write_figure
from mi_lcair.errors import InputError, check_known
from mi_lcair.files import check_writable

USUAL = ("Y", "temperature.Y")  # channels of an image that are drawn where none is named


def drawn(figure, output: Path) -> None:
    """Write a figure, and print its path."""
    write_figure(figure, output)
    click.echo(output)


def image(what, output, channels, outlines, scene, parameters, sensor, **scale):
    """Draw channels of an image."""
    from mi_lcair.formats import check_channels
    from mi_lcair.rendering.images.files import read_exr, window_of
    from mi_lcair.show.pictures import image_channels
    from mi_lcair.show.pictures.image_channels import around_target

    file = Path(what)
    known, header = read_exr(file)
    names = choose("channel", known, channels or usual(known), check_channels)
    title = (
        ", ".join(filter(None, (str(header.get("scene", "")), band_of_header(header)))) or file.stem
    )
    values = {name: known[name] for name in names}
    if outlines:
        shape = values[names[0]].shape
        scale["outlines"] = _outlines_of(file, header, shape, scene, dict(parameters), sensor)
    scale["part"] = around_target(known)
    figure = image_channels.figure(values, title, window_m=window_of(header), **scale)
    drawn(figure, output or file.with_suffix(".png"))


def band_of_header(header: dict) -> str:
    """The band of an image's header with its limits, "MWIR 3-5 um", as `Band.label`."""
    name, limits = str(header.get("band", "")), str(header.get("wavelengths_um", "")).split()
    if not limits or name == "total":
        return name
    between = "-".join(limits)
    return f"{name} {between} um" if name != between else f"{between} um"


def pixel_spectrum(what, output, pixel):
    """Draw the spectrum of a pixel of a spectral image."""
    from mi_lcair.rendering.images.files import read_exr
    from mi_lcair.rendering.images.render import pixel_spectrum as spectrum_of

    file = Path(what)
    channels, header = read_exr(file)
    title = str(header.get("scene", file.stem))
    drawn(spectrum_of(channels, pixel, title).draw(), output or named_after(file, "spectrum"))


def comparison(what, output, channels, **scale):
    """Draw channels of two images beside each other, and their difference."""
    from mi_lcair.formats import check_channels
    from mi_lcair.rendering.images.files import read_exr, window_of
    from mi_lcair.show.pictures.comparison import figure
    from mi_lcair.show.pictures.image_channels import around_target

    files = [Path(name) for name in what]
    images, headers = zip(*map(read_exr, files))
    both = [name for name in images[0] if name in images[1]]
    names = choose("channel of both images", both, channels or usual(both), check_channels)
    windows = [window_of(header) for header in headers]
    compared = figure(
        [{name: image[name] for name in names} for image in images],
        [file.name if files[0].name != files[1].name else str(file) for file in files],
        ", ".join(dict.fromkeys(str(header["scene"]) for header in headers if "scene" in header)),
        window_m=windows[0] if windows[0] == windows[1] else None,
        part=around_target(images[0]),
        **scale,
    )
    drawn(compared, output or files[0].with_name(f"{files[0].stem}_{files[1].stem}.png"))


def usual(channels) -> list[str]:
    """The channel that is drawn where none is named: the first of USUAL, or the first of all."""
    known = list(channels)
    return [*(name for name in USUAL if name in known), *known][:1]


def _outlines_of(file, header, shape, scene, parameters, sensor):
    """Number of the facet in each pixel of an image, as the image's scene has them."""
    from json import loads

    from mi_lcair import scenes
    from mi_lcair.rendering.facets import FacetTable, seen_facets

    scene = scene or header.get("scene", "")
    place = Path(scene)
    if scene not in scenes.names() and not place.is_file() and not scenes.in_folder(place):
        raise InputError(f"{file}: the scene of its facets is unknown; name it with --scene")
    given = loads(header.get("parameters", "{}")) | parameters
    loaded = mi_lcair.load(scene, **given)
    facets = seen_facets(loaded, FacetTable(loaded), sensor or int(header.get("sensor", 0)))
    if facets.shape != shape:
        raise InputError(
            f"{file}: has {shape[1]} x {shape[0]} pixels, and the sensor of {loaded.name} "
            f"{facets.shape[1]} x {facets.shape[0]}; name the scene that was rendered, with its -D"
        )
    return facets


def facet_columns(what, output, facets, channels, parameters, sensor, outlines, **scale):
    """Draw a scene with its facets coloured by columns of a table."""
    from mi_lcair.rendering.facets import FACET, FacetTable, facet_images, seen_facets
    from mi_lcair.rendering.window import window_size
    from mi_lcair.show.pictures.image_channels import column_quantity, figure
    from mi_lcair.table import read_table

    table = read_table(facets, (FACET,))
    if not channels:
        raise InputError(f"{facets}: say which column with -c; it has {', '.join(table.columns)}")
    names = choose(f"column of {facets}", table.columns, channels)
    scene = mi_lcair.load(what, **dict(parameters))
    images = facet_images(scene, table, names, sensor)
    if outlines:
        scale["outlines"] = seen_facets(scene, FacetTable(scene), sensor)
    window_m = window_size(scene.sensor(sensor))
    coloured = figure(images, scene.name, quantity=column_quantity, window_m=window_m, **scale)
    drawn(coloured, output or facets.with_suffix(".png"))


def trend(what, output):
    """Draw a trend."""
    from mi_lcair.signatures.trend import Trend

    drawn(Trend.read(what).plot(), output or named_after(Path(what), "trend"))


def spectrum(what, output):
    """Draw the spectral intensity of a signature."""
    from mi_lcair.formats import read_columns
    from mi_lcair.signatures.effective_areas import spectrum_picture

    file = Path(what)
    figure = spectrum_picture(read_columns(file), file.stem).draw()
    drawn(figure, output or named_after(file, "spectrum"))


def result(what, output):
    """Draw a result from its JSON."""
    from mi_lcair.show.kinds import read_result, whole

    stated = read_result(what)
    with whole(what):
        figure = stated.plot()
    drawn(figure, output or named_after(Path(what), stated.kind.split()[-1]))


def model(what, output, materials):
    """Draw the model in a file from three sides."""
    from mi_lcair import models3d

    file = Path(what)
    facets = models3d.read(file, materials=materials)
    figure = facets.plot(title=f"{file.name}: {facets.count} facets")
    drawn(figure, output or named_after(file, "model"))


def scene(what, output, parameters):
    """Draw the model of a scene from three sides."""
    from mi_lcair.rendering.facets import model_of

    loaded = mi_lcair.load(what, **dict(parameters))
    facets = model_of(loaded)
    figure = facets.plot(title=f"{loaded.name}: {facets.count} facets")
    drawn(figure, output or named_after(Path(Path(what).name), "model"))


def scenario(what, output, parameters):
    """Print what a scenario states, and draw its target from three sides."""
    from mi_lcair.detection.scenario import Scenario
    from mi_lcair.detection.setting import target_scene
    from mi_lcair.rendering.facets import model_of
    from mi_lcair.results import settings_section

    stated = Scenario.read(what, **dict(parameters))
    output = output or named_after(Path(Path(what).name), "scenario")
    check_writable(output)
    loaded = target_scene(stated, stated.sensor.detector())
    observer = stated.observer
    where = f"{observer.range_m:g} m"
    if observer.azimuth_deg is not None:
        where += f", azimuth {observer.azimuth_deg:g}, elevation {observer.elevation_deg:g} degrees"
    name = ": ".join(filter(None, (stated.name, stated.title.rstrip("."))))
    model_of(loaded).plot(output, title=f"{name}; seen from {where}")
    first = [("picture", str(output)), ("scenario", name)]
    print_sections([settings_section("Scenario", stated, first)])


def facet_view(what, output, facet, parameters):
    """Draw a map of what a facet of a scene sees, and print a table of its neighbours."""
    from mi_lcair.signatures.facets import hemispherical_view

    output = output or Path(f"{Path(what).stem}_facet_{facet}.png")
    check_writable(output)
    view = hemispherical_view(mi_lcair.load(what, **dict(parameters)), facet)
    view.plot(output)
    print_result(view, [("picture", str(output))], {"file": str(output)})


def brdf(what, output, band, theta_deg, materials):
    """Draw the BRDF of a material."""
    from mi_lcair.physics.materials import bands_of, is_number

    if band is None:
        bands = bands_of(what, materials)
        if len(bands) > 1 or bands == ["any"]:
            raise InputError(f"material '{what}': give its --band; it has {', '.join(bands)}")
        (band,) = bands
    from mi_lcair.physics.brdf_view import brdf_view

    view = brdf_view(what, band, theta_deg, materials)
    name = what if is_number(what) else Path(what).stem
    drawn(view.plot(), output or Path(f"{name}_{view.band.name}_{theta_deg:g}deg.png"))


def curves(what, output, band):
    """Draw blackbodies, an atmosphere or a sky."""
    from mi_lcair.show.kinds import AIR, BLACKBODIES, kind_of
    from mi_lcair.show.pictures import radiance_curves

    band, kind = band or "MWIR", kind_of(what)
    if kind == BLACKBODIES:
        temperatures = [float(text.removesuffix("K")) for text in what.split(",")]
        figure = radiance_curves.blackbodies(temperatures, band)
    else:
        draw = radiance_curves.air if kind == AIR else radiance_curves.sky
        figure = draw(what, band)
    drawn(figure, output or Path(f"{what.replace(',', '_')}_{Path(band).stem}.png"))


def named_after(file: Path, kind: str) -> Path:
    """Default path of a picture, such as box_model.png for box.obj.

    It holds the kind, so that pictures of box.obj, box.csv and box.exr have different names.
    """
    return file.with_name(file.stem + (f"_{kind}" if not file.stem.endswith(kind) else "") + ".png")


def choose(kind: str, known, patterns, check=check_known) -> list[str]:
    """Known names that match the patterns, in the order of the patterns, each once.

    Raises InputError by `check` for a pattern without a match. `kind` names it in the message.
    """
    matching = {}
    for pattern in patterns:
        matches = (
            [pattern]
            if pattern in known
            else [name for name in known if fnmatchcase(name, pattern)]
        )
        if not matches:
            check(kind, known, pattern)
        matching |= dict.fromkeys(matches)
    return list(matching)
