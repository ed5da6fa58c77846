"""A plate whose emissivity is smooth over wavelength, under a clear or an even sky."""

import numpy as np

import mi_lcair
from tests.knowing.inversion.plate import XML

X = np.linspace(7.9, 12.1, 85)  # um
NODES = np.linspace(8, 12, 9)
FIRST_GUESS = 0.8
SIGMA = 5e-4  # noise of a channel, as a fraction of the mean radiance
UNKNOWNS = {"plate.temperature": {}, "paint.spectrum": {"prior": [0, 0.1], "correlation_um": 1}}


def write_scene(folder) -> str:
    """The scene with an even first guess of the emissivity; its path."""
    head = XML[: XML.index('<shape type="sphere">')]
    for old, new in (
        ('<default name="R" value="0.3"/>', '<default name="file" value="guess.toml"/>'),
        ('name="S" value="290"', 'name="S" value="clear"'),
        ('name="size" value="16"', 'name="size" value="1"'),
        ('type="diffuse" id="paint"', 'type="material"'),
        (
            '<spectrum name="reflectance" value="$R"/>',
            '<string name="material" value="paint"/> <string name="band" value="$band"/> '
            '<string name="materials" value="$file"/>',
        ),
    ):
        head = head.replace(old, new)
    sky = '<string name="band" value="$band"/> <string name="sky" value="$S"/>'
    (folder / "plate.xml").write_text(head + f'<emitter type="sky"> {sky} </emitter>\n</scene>')
    write_material(folder, "guess", FIRST_GUESS + 0 * X)
    return str(folder / "plate.xml")


def write_material(folder, name: str, emissivity: np.ndarray) -> None:
    rows = "".join(f"{x:.9g},{y:.9g}\n" for x, y in zip(X, emissivity))
    (folder / f"{name}.csv").write_text("wavelength_um,emissivity\n" + rows)
    (folder / f"{name}.toml").write_text(f'[paint.spectral]\nemissivity = "{name}.csv"\n')


def spectrum(path: str, bins: int, **parameters) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [um] and spectral radiance of the plate."""
    image = mi_lcair.render(path, spp=16384, bins=bins, seed=5, parameters=parameters)
    return image.wavelengths_um, image.cube[:, 0, 0].astype(float)


def problem(folder, path: str, x, radiance, seed: int, sky="clear", sigma: float = SIGMA) -> dict:
    """The inverse problem of a noisy measurement of a spectrum."""
    noise = sigma * float(radiance.mean())
    noisy = radiance + noise * np.random.default_rng(seed).standard_normal(len(x))
    rows = "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(x, noisy))
    (folder / "pixel.csv").write_text("wavelength_um,radiance_W_m2_sr_um\n" + rows)
    data = {
        "scene": path,
        "parameters": {"T": 300.0, "S": sky},
        "spectrum": str(folder / "pixel.csv"),
        "sigma": noise,
    }
    return {"data": [data], "unknowns": UNKNOWNS, "render": {"spp": 2048}}
