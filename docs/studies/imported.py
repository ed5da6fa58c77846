"""Import other people's scenes of Mitsuba, and compare their images with Mitsuba's own.

    python -m docs.studies.imported FOLDER [PART_OF_A_NAME]

Each .xml below the folder that Mitsuba loads is imported with 300 K and an emissivity of 0.9. The
same shapes, with emitters `area` of the same radiance, are rendered by Mitsuba's `path`. Mitsuba's
own public data are such a folder. Prints a line for each scene, and how many agree: the mean within
3 standard errors, and all but 6 % of the pixels.
"""

import sys
import tempfile
from pathlib import Path
from unittest import mock

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.conversion import thermal_scene

KELVIN, EMISSIVITY, BOUNCES = 300.0, 0.9, 11
RADIANCE = EMISSIVITY * float(in_band_radiance(band("LWIR"), KELVIN))
WIDTH, HEIGHT, SPP, SEEDS = 24, 18, 256, 8
ROUNDING = 2e-4 * RADIANCE  # of Float32, and of what is left out beyond the last reflection
PARTS = "/include/", "/fragments/"  # of scenes
Type = mi.ObjectType


def parsed(path: Path):
    """Mitsuba's configuration and parser state of a scene, with a small film."""
    config = mi.parser.ParserConfig("llvm_ad_mono")
    config.merge_equivalent = config.merge_meshes = config.parallel = False
    state = mi.parser.parse_file(config, str(path))
    mi.parser.transform_all(config, state)
    for k in range(len(state.nodes)):
        node = state.nodes[k]
        if node.type == Type.Film:
            names = list(node.props.keys())
            for key in filter(lambda name: name.startswith("crop"), names):
                del node.props[key]
            node.props["width"], node.props["height"] = WIDTH, HEIGHT
            if all(state.nodes[j].type != Type.ReconstructionFilter for _, j in parts(state, k)):
                add(state, k, Type.ReconstructionFilter, mi.Properties("box"))
        elif node.type == Type.ReconstructionFilter:
            node.props = mi.Properties("box")
        elif node.type == Type.Shape and node.props.plugin_name() in ("ply", "obj", "serialized"):
            node.props["face_normals"] = True
    return config, state


def parts(state, k: int) -> list[tuple[str, int]]:
    """Names and numbers of the objects in a node."""
    props, kind = mi.Properties(state.nodes[k].props), mi.Properties.ResolvedReference
    names = list(props.keys())
    return [(name, props[name].index()) for name in names if isinstance(props[name], kind)]


def add(state, k: int, kind, props) -> None:
    """Give a node another object."""
    node = mi.parser.SceneNode()
    node.type, node.props = kind, props
    state.nodes[k].props[f"_arg_{len(state.nodes)}"] = mi.Properties.ResolvedReference(
        len(state.nodes)
    )
    state.nodes.append(node)


def of_mitsuba(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Mitsuba's image of the shapes as emitters `area`, and its standard error."""
    config, state = parsed(path)
    lamps = {j for k in range(len(state.nodes)) for _, j in parts(state, k)
             if any(state.nodes[i].type == Type.Emitter for _, i in parts(state, j))}  # fmt: skip
    for k in range(len(state.nodes)):
        for name, j in parts(state, k):
            if state.nodes[j].type in (Type.Emitter, Type.Integrator, Type.Medium):
                del state.nodes[k].props[name]
    for name, j in parts(state, 0):
        if state.nodes[j].type != Type.Shape:
            continue
        bsdfs = [state.nodes[i] for _, i in parts(state, j) if state.nodes[i].type == Type.BSDF]
        if any(bsdf.props.plugin_name() == "null" for bsdf in bsdfs):
            del state.nodes[0].props[name]
            continue
        area = mi.Properties("area")
        area["radiance"] = RADIANCE
        add(state, j, Type.Emitter, area)
        if not bsdfs and j not in lamps:
            add(state, j, Type.BSDF, mi.Properties("diffuse"))
    of_paths = mi.Properties("path")
    of_paths["max_depth"], of_paths["rr_depth"] = BOUNCES + 1, BOUNCES + 2
    add(state, 0, Type.Integrator, of_paths)
    scene = mi.parser.instantiate(config, state)
    images = [np.array(mi.render(scene, seed=k, spp=SPP))[..., 0] for k in range(SEEDS)]
    return np.mean(images, axis=0), np.std(images, axis=0, ddof=1) / np.sqrt(SEEDS)


def of_import(path: Path, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """The image of the imported scene, all of whose emitters have the emissivity, and its error.

    Raises InputError for a scene that is refused.
    """
    thermal_scene(path, folder / "thermal", KELVIN, emissivity=[str(EMISSIVITY)])
    _, state = parsed(folder / "thermal" / "scene.xml")
    for node in state.nodes:
        if node.type == Type.Emitter and node.props.plugin_name() == "thermal":
            node.props["emissivity"] = EMISSIVITY
        elif node.type == Type.Integrator:
            node.props["max_bounces"] = BOUNCES
    mi.parser.write_file(state, str(folder / "thermal" / "small.xml"))
    # Mitsuba's `area` emits from the front of a sheet only
    front = mock.Mock(side_effect=lambda flags, cos: cos > 0)
    with (
        mock.patch("mi_lcair.plugins.emitters.thermal.emits", front),
        mock.patch("mi_lcair.plugins.emission.draw_table.emits", front),
    ):
        image = mi_lcair.render(folder / "thermal" / "small.xml", spp=2 * SPP)
    return image.channels["Y"], image.channels["stderr.Y"]


def compared(path: Path) -> str:
    """How a scene went: "agrees", "differs" with numbers, or why it was refused."""
    with tempfile.TemporaryDirectory() as name:
        try:
            (ours, own_error), (stock, error) = of_import(path, Path(name)), of_mitsuba(path)
        except InputError as refused:
            return f"refused: {refused}"
        except RuntimeError as failed:
            return f"failed: {str(failed).strip().splitlines()[-1][:90]}"
    errors = np.hypot(error, own_error)
    far = float(np.mean(abs(ours - stock) > 3 * np.hypot(errors, ROUNDING)))
    mean = abs(ours.mean() - stock.mean())
    of_mean = np.hypot(np.linalg.norm(errors) / errors.size, ROUNDING / 20)
    numbers = f"mean {mean / of_mean:.1f} errors apart, {far:.0%} of the pixels beyond 3"
    return f"agrees: {numbers}" if mean < 3 * of_mean and far < 0.06 else f"differs: {numbers}"


def main(folder: str, part: str = "") -> None:
    mi.set_log_level(mi.LogLevel.Error)
    counts: dict[str, int] = {}
    for path in sorted(Path(folder).resolve().rglob("*.xml")):
        if part not in str(path) or any(of in str(path) for of in PARTS):
            continue
        try:
            mi.parser.instantiate(*parsed(path))
        except (RuntimeError, ValueError):
            continue  # Mitsuba does not load it
        said = compared(path)
        counts[said.partition(":")[0]] = counts.get(said.partition(":")[0], 0) + 1
        print(f"{path.relative_to(Path(folder).resolve())}: {said}", flush=True)
    print(", ".join(f"{count} {name}" for name, count in sorted(counts.items())))


if __name__ == "__main__":
    main(*sys.argv[1:])
