# The public names of mi_lcair: `__init__.py` imports each of them from here, at its first use.
from mi_lcair.api.datasets import dataset as dataset
from mi_lcair.api.estimates import budget as budget
from mi_lcair.api.estimates import invert as invert
from mi_lcair.api.estimates import sensitivities as sensitivities
from mi_lcair.api.estimates import shape_derivatives as shape_derivatives
from mi_lcair.api.heating import exchange as exchange
from mi_lcair.api.heating import heat as heat
from mi_lcair.api.images import derivative_images as derivative_images
from mi_lcair.api.images import render as render
from mi_lcair.api.images import render_with_errors as render_with_errors
from mi_lcair.api.intensities import chart as chart
from mi_lcair.api.intensities import signature as signature
from mi_lcair.api.laboratory import audit as audit
from mi_lcair.api.laboratory import cavity as cavity
from mi_lcair.api.laboratory import noise_components as noise_components
from mi_lcair.api.laboratory import temperature as temperature
from mi_lcair.api.pages import report as report
from mi_lcair.api.scenarios import contrast as contrast
from mi_lcair.api.scenarios import image as image
from mi_lcair.api.scenarios import pose as pose
from mi_lcair.api.scenes import load as load
from mi_lcair.api.scenes import materials as materials
from mi_lcair.api.scenes import parameters as parameters
from mi_lcair.api.scenes import trust as trust
from mi_lcair.api.scenes import workers as workers
from mi_lcair.api.sweeps import flight as flight
from mi_lcair.api.sweeps import sweep as sweep
from mi_lcair.api.sweeps import trend as trend
from mi_lcair.errors import InputError as InputError
from mi_lcair.fitting.estimation import fit as fit
from mi_lcair.rendering.scene import Scene as Scene

__version__: str
