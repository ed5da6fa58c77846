"""Radiance of a plate below a hot sphere, in raysect."""

from raysect.core.math import rotate_basis
from raysect.core.math.random import seed as set_seed
from raysect.core.workflow import SerialEngine
from raysect.optical import ConstantSF, Point3D, Vector3D, World, translate
from raysect.optical.library.spectra import BlackBody
from raysect.optical.material import Add, Lambert, UniformSurfaceEmitter
from raysect.optical.observer import RadiancePipeline0D, SightLine
from raysect.primitive import Box, Sphere

world = World()
painted = Add(Lambert(ConstantSF(0.6)), UniformSurfaceEmitter(BlackBody(300), 0.4))
plate = Box(Point3D(-5, -5, -0.1), Point3D(5, 5, 0), world, material=painted)
hot = UniformSurfaceEmitter(BlackBody(800))
hot.importance = 1
ball = Sphere(0.5, world, translate(0, 0, 1.5), hot)
radiance = RadiancePipeline0D(accumulate=False)
line = SightLine(pipelines=[radiance], parent=world)
line.transform = translate(2, 0, 2) * rotate_basis(Vector3D(-2, 0, -2), Vector3D(0, 1, 0))
line.render_engine, line.quiet = SerialEngine(), True
line.max_wavelength, line.min_wavelength, line.spectral_bins = 5000, 3000, 1
line.ray_importance_sampling, line.ray_important_path_weight = True, 1.0


def run(case, effort, seed):
    set_seed(seed)
    line.pixel_samples = line.samples_per_task = effort
    line.observe()
    return {"radiance": (radiance.value.mean, radiance.value.error())}
