"""Files that other programs read, written from plain arrays: CSV, netCDF, VTK and TIFF."""

from pathlib import Path

from mi_lcair.errors import InputError

VTK = (".vtp", ".vtu")  # suffixes of the files that `formats.vtk` writes
MODELS = (".obj", ".glb", ".gltf", ".ply", ".stl")  # suffixes of models that `models3d` reads
# Programs by the suffix of their files, which must be exported in one of these formats
UNREAD = {
    ".blend": "Blender",
    ".fbx": "FBX",
    ".dae": "COLLADA",
    ".skp": "SketchUp",
    ".x3d": "X3D",
    **dict.fromkeys((".3ds", ".max"), "3ds Max"),
    **dict.fromkeys((".usd", ".usdc", ".usdz"), "USD"),
    **dict.fromkeys((".step", ".stp"), "STEP"),
    **dict.fromkeys((".igs", ".iges"), "IGES"),
}


def check_model(path) -> None:
    """Raise InputError for the file of a modelling program that must be exported first."""
    program = UNREAD.get(Path(path).suffix.lower())
    if program:
        raise InputError(
            f"{path}: is a {program} file, which is not read; export the model as "
            f"{', '.join(MODELS[:-1])} or {MODELS[-1]} (in Blender: File, Export, Wavefront)"
        )
