"""mi-lcair signature: intensity of a scene in W/sr."""

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_result, print_written, time_row
from mi_lcair.errors import InputError
from mi_lcair.files import together
from mi_lcair.formats import VTK


@options.command(
    "signature",
    "mi-lcair signature cylinder_ir_range --spp 16",
    "mi-lcair signature box/scene.xml --tolerance 1% --facets facets.csv --spectrum s.csv",
)
@options.scene(
    spp="Number of paths, divided by the number of pixels of the film (default: the scene's own). "
    "The paths begin anywhere on the film.",
    tolerance="Trace paths until half of the 95 % interval of the target's intensity is at most "
    "this fraction of it, such as 0.01 or 1%.",
)
@options.file(
    "--spectrum", "Write the spectral intensity, FILE.csv or FILE.nc (netCDF).", (".csv", ".nc")
)
@options.plot("the spectral intensity of --spectrum")
@options.file(
    "--facets",
    "Write radiance and intensity of each facet of the model, FILE.csv; or the facets with them "
    "for ParaView, FILE.vtp or FILE.vtu.",
    (".csv", *VTK),
)
def command(scene, spectrum, plot, facets):
    """Intensity of SCENE in W/sr.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Printed
    is the intensity in W/sr of the target (the model's facets) and of the whole scene: by number of
    reflections, by the group that emits, and by the group that the sensor sees first. Written on
    request are the spectral intensity in W/sr/um, and for each facet its temperature in K, radiance
    in W m^-2 sr^-1 and intensity in W/sr.
    """
    if plot and not spectrum:
        raise InputError("--plot draws the spectral intensity; give --spectrum FILE.csv too")
    if spectrum and spectrum == facets:
        raise InputError(f"--spectrum and --facets both name '{spectrum}'; give each its own file")
    result = scene.run(mi_lcair.signature, by_spectrum=bool(spectrum), facets=bool(facets))
    with together():
        if spectrum:
            result.effective_areas.save(spectrum)
            if plot:
                result.effective_areas.plot(plot)
        if facets:
            result.facets.save(facets)
    print_result(result, [time_row(result)])
    print_written(spectrum, plot, facets)
