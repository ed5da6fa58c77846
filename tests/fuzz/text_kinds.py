"""The kinds of file that are mutated: tables, scenarios, materials and images."""

import json
import tempfile
import warnings
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.drawing import write_figure
from mi_lcair.fitting.scatterometer import reading
from mi_lcair.models3d import read as read_model
from mi_lcair.physics import materials
from mi_lcair.physics.air import tape7
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.sky import has_elevations, spectrum
from mi_lcair.physics.spectral_table import over_the_hemisphere, read_directional_table
from mi_lcair.rendering.facets import by_facet
from mi_lcair.rendering.images.files import read_exr, write_exr
from mi_lcair.rendering.sampling import DEFAULT_MAX_SPP
from mi_lcair.show.pictures.image_channels import figure
from mi_lcair.table import read_table
from tests.fuzz.mutants import Kind
from tests.models3d.shapes import cube
from tests.physics.air.test_tape7 import LWIR, MWIR, block

WITHIN = band("3.5-4.5")  # within what the examples cover
MOST_RAYS = 10_000  # a scenario that asks for more is read but not measured


@contextmanager
def numbers_that_behave():
    """NumPy's and Matplotlib's warnings fail the file; remarks to the user do not."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", category=UserWarning)
        yield


def finite(values, lowest=-np.inf, highest=np.inf) -> None:
    values = np.asarray(values, dtype=float)
    assert np.isfinite(values).all() and (values >= lowest).all() and (values <= highest).all(), (
        values
    )


# ---------------------------------------------------------------- Tables


def use_emissivity(path: Path) -> None:
    with numbers_that_behave():
        theta, value, std = read_directional_table(path)
        finite(over_the_hemisphere(path, theta, value, np.linspace(0, np.pi / 2, 7)), 0, 1)
        if std is not None:
            finite(1 / std**2, 0)


def use_response(path: Path) -> None:
    with numbers_that_behave():
        rule = band(path)
        finite(rule.weights_um, 0)
        finite(rule.wavelengths_um, 0.1, 1000)
        finite(in_band_radiance(rule, 300.0), 0)


def use_spectrum(path: Path) -> None:
    with numbers_that_behave():
        finite(spectrum(path, 20 if has_elevations(path) else None).in_band_radiance(WITHIN), 0)


def use_atmosphere(path: Path) -> None:
    with numbers_that_behave():
        air = atmosphere(path)
        finite(air.transmittance_mean(WITHIN, float(air.ranges_m[0]) / 2), 0, 1)
        ranges = air.ranges_m[:1] * [0.1, 1.0]
        spectra = np.linspace(1, 2, len(air.wavelengths_um))
        finite(air.band_transmittance(WITHIN, [spectra], ranges), 0, 1)
        finite(air.band_path_radiance(WITHIN, ranges), 0)


def use_tape7(path: Path) -> None:
    if tape7.is_tape7(path):
        use_atmosphere(path)
    else:
        use_spectrum(path)


def use_temperatures(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "cube.obj"
        model.write_text(cube())
        finite(read_model(model, temperatures=path).temperature, 60, 10_000)


def use_facets(path: Path) -> None:
    with numbers_that_behave():
        table = read_table(path, ("facet",))
        for name in table.columns:
            if name != "material":
                by_facet(table, name, 3)


def use_measurements(path: Path) -> None:
    with numbers_that_behave():
        measured = reading.read(path)
        finite(measured.brdf)
        finite(measured.theta_r, -np.pi / 2, np.pi / 2)


def csv(header: str, *rows: str) -> bytes:
    return "\n".join(["# made by hand", header, *rows, ""]).encode()


TABLE_WORDS = tuple(
    b"theta_deg emissivity emissivity_std wavelength_um response elevation_deg transmittance "
    b"range_km path_radiance_W_m2_sr_um radiance_W_m2_sr_um facet kelvin , ; # nan 1e308 "
    b"1e-310".split()
)
AIR = "range_km,wavelength_um,path_radiance_W_m2_sr_um,transmittance"
STEPS = np.arange(3, 5.05, 0.1)
EMISSIVITY = Kind(
    "emissivity",
    ".csv",
    (
        csv("theta_deg,emissivity,emissivity_std", "10,0.9,0.01", "40,0.85,0.02", "80,0.6,0.05"),
        b"theta_deg;emissivity\n0;0,9\n90;0,5\n",
    ),
    use_emissivity,
    TABLE_WORDS,
)
RESPONSE = Kind(
    "response",
    ".csv",
    (csv("wavelength_um,response", "3,0", "3.5,0.7", "4,1", "4.5,0.9", "5,0"),),
    use_response,
    TABLE_WORDS,
)
SPECTRUM = Kind(
    "spectrum",
    ".csv",
    (
        csv("wavelength_um,radiance_W_m2_sr_um", *(f"{x:.1f},{x / 9:.4f}" for x in STEPS)),
        csv(
            "elevation_deg,wavelength_um,radiance_W_m2_sr_um",
            *(f"{angle},{x:.1f},{x / 9:.4f}" for angle in (5, 40) for x in STEPS),
        ),
    ),
    use_spectrum,
    TABLE_WORDS,
)
ATMOSPHERE = Kind(
    "atmosphere",
    ".csv",
    (csv(AIR, *(f"{km},{x:.1f},{km / 30},{0.9 / km}" for km in (1, 2) for x in STEPS)),),
    use_atmosphere,
    TABLE_WORDS,
)
TAPE7 = Kind(
    "tape7",
    "",
    (block(MWIR).encode(), (block(MWIR, range_km=1) + block(LWIR, range_km=1)).encode()),
    use_tape7,
    tuple(b"FREQ TOT_TRANS PTH_THRML THRML_EM SOL_SCAT TOTAL_RAD -9999. 1.0E+99 ****".split()),
)
TEMPERATURES = Kind(
    "temperatures",
    ".csv",
    (csv("facet,kelvin", *(f"{facet},{300 + facet}.5" for facet in range(6))),),
    use_temperatures,
    TABLE_WORDS,
)
FACETS = Kind(
    "facets",
    ".csv",
    (csv("facet,material,radiance_W_m2_sr", "0,paint,5", "1,'=1,nan", "2,,7.5"),),
    use_facets,
    TABLE_WORDS,
)
MEASUREMENTS = Kind(
    "measurements",
    ".csv",
    (
        csv(
            "theta_i_deg,theta_r_deg,brdf_per_sr,sigma",
            *(f"20,{r},{1 + 9 * (r == 20)},0.1" for r in (-40, -20, 0, 20, 40)),
        ),
    ),
    use_measurements,
    tuple(b"theta_i_deg theta_r_deg brdf phi_deg sigma # band_um: 3 5 quantity: VARS ,".split()),
)

# ---------------------------------------------------------------- Scenarios and materials


def use_scenario(path: Path) -> None:
    """Reads a scenario and, where that is quick, measures it."""
    with numbers_that_behave():
        scenario = Scenario.read(path)
        sampling = scenario.render
        renders = max(1, len(sampling.max_bounces))
        bounces = max((*sampling.max_bounces, 1))
        spp = sampling.spp or sampling.max_spp or DEFAULT_MAX_SPP
        if sampling.resolution**2 * spp * renders * bounces > MOST_RAYS:
            return
        result = mi_lcair.contrast(scenario)
        json.dumps(result.as_dict(), allow_nan=False)
        if scenario.sensor.nei is not None:
            json.dumps([found.as_dict() for found in result.detection_ranges()], allow_nan=False)


SCENARIO = Kind(
    "scenario",
    ".toml",
    tuple(
        f"""# A scenario.
[target]
scene = "cylinder_ir_range"
[target.parameters]
finish = "gloss_black"
[observer]
range_m = 700.0
azimuth_deg = 90
elevation_deg = -5
[atmosphere]
table = "us_standard"
[background]
{background}
[sensor]
band = "MWIR"
field_of_view_deg = 2
nei = 1e-8
snr = 5
[render]
max_bounces = [0, 1]
resolution = 8
spp = 4
seed = 1
""".encode()
        for background in ("temperature = 294.0", 'sky = "us_standard_clear"')
    ),
    use_scenario,
    tuple(
        b"[pose] yaw_deg = 5 true -1 [] {} inf nan 1e300 position_m = [1,2,3] lobe 'diffuse' "
        b"'total' "
        b"extrapolate optics_transmittance 0 1e-300 2000 ''' ".split()
    ),
    may_die=True,
)


def use_materials(path: Path) -> None:
    """The materials that a file names, each in a band."""
    for name in materials.names(path)[:4]:
        materials.material(name, WITHIN, path)


def use_fit(path: Path) -> None:
    materials.material(str(path), WITHIN)


MATERIALS = Kind(
    "materials",
    ".toml",
    (
        b"[rust.MWIR]\nepsilon = 0.6\nrho_d = 0.2\nb = 0.3\ne = 0.4\nsource = 'mine'\n"
        b"[rust.LWIR]\nepsilon = 0.7\nrho_d = 0.1\nb = 0.3\ne = 0.4\n"
        b"[\"a b\".any]\nepsilon = 0.5\nrho_d = 0\nb = 0\ne = 1\nform = 'normalized'\n",
    ),
    use_materials,
    tuple(b"model any total epsilon rho_d b e form thesis [ ] [[a]] = inf nan true ''".split()),
)
FIT = Kind(
    "fit",
    ".json",
    (
        json.dumps(
            {
                "band": "3-5",
                "form": "thesis",
                "model": "sandford_robertson",
                "parameters": {"epsilon": 0.3, "rho_d": 0.2, "b": 0.4, "e": 0.1},
            }
        ).encode(),
    ),
    use_fit,
    tuple(b'null true {} [] "" "any" Infinity NaN 1e999 "materials":'.split()) + (b"[" * 5000,),
)

# ---------------------------------------------------------------- Images


def exr_bytes() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.exr"
        pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
        write_exr(path, {"Y": pixels, "bounce00.Y": pixels}, {"band": "MWIR", "scene": "plates"})
        return path.read_bytes()


def use_exr(path: Path) -> None:
    """Reads an image and draws its first channel where that is small."""
    channels, header = read_exr(path)
    name, pixels = next(iter(channels.items()))
    if pixels.size <= MOST_RAYS and pixels.ndim == 2:
        with numbers_that_behave(), tempfile.TemporaryDirectory() as folder:
            title = ", ".join(str(header[key]) for key in ("scene", "band") if key in header)
            write_figure(figure({name: pixels}, title), Path(folder) / "a.png")


EXR = Kind(
    "exr",
    ".exr",
    (exr_bytes(),),
    use_exr,
    tuple(b"channels compression dataWindow tiles type deepscanline string float box2i".split()),
    may_die=True,
)

TEXT_KINDS = (
    EMISSIVITY,
    RESPONSE,
    SPECTRUM,
    ATMOSPHERE,
    TAPE7,
    TEMPERATURES,
    FACETS,
    MEASUREMENTS,
    SCENARIO,
    MATERIALS,
    FIT,
    EXR,
)
