"""Radiance from the opening of a spherical cavity, in raysect."""

from raysect.core.math.random import seed as set_seed
from raysect.core.workflow import SerialEngine
from raysect.optical import ConstantSF, World, rotate_x, translate
from raysect.optical.library.spectra import BlackBody
from raysect.optical.material import Add, Lambert, UniformSurfaceEmitter
from raysect.optical.observer import RadiancePipeline0D, SightLine
from raysect.primitive import Cylinder, Sphere, Subtract

world = World()
shell = Subtract(Sphere(0.5001), Sphere(0.5))
painted = Add(Lambert(ConstantSF(0.5)), UniformSurfaceEmitter(BlackBody(300), 0.5))
cavity = Subtract(shell, Cylinder(0.1, 1), world, material=painted)
radiance = RadiancePipeline0D(accumulate=False)
line = SightLine(pipelines=[radiance], parent=world)
line.transform = translate(0, 0, 1) * rotate_x(180)
line.render_engine, line.quiet = SerialEngine(), True
line.max_wavelength, line.min_wavelength, line.spectral_bins = 5000, 3000, 1
line.ray_extinction_min_depth, line.ray_extinction_prob = 8, 0.2


def run(case, effort, seed):
    set_seed(seed)
    line.pixel_samples = line.samples_per_task = effort
    line.observe()
    return {"radiance": (radiance.value.mean, radiance.value.error())}
