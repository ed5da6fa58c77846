# The public names of mi_lcair: `__init__.py` imports each of them from here, at its first use.
from mi_lcair.api.audit import audit as audit
from mi_lcair.api.budget import budget as budget
from mi_lcair.api.cavity import cavity as cavity
from mi_lcair.api.contrast import contrast as contrast
from mi_lcair.api.derivative_images import derivative_images as derivative_images
from mi_lcair.api.exchange import exchange as exchange
from mi_lcair.api.flight import flight as flight
from mi_lcair.api.heat import heat as heat
from mi_lcair.api.image import image as image
from mi_lcair.api.invert import invert as invert
from mi_lcair.api.load import load as load
from mi_lcair.api.materials import materials as materials
from mi_lcair.api.parameters import parameters as parameters
from mi_lcair.api.pose import pose as pose
from mi_lcair.api.render import render as render
from mi_lcair.api.render_with_errors import render_with_errors as render_with_errors
from mi_lcair.api.report import report as report
from mi_lcair.api.sensitivities import sensitivities as sensitivities
from mi_lcair.api.shape_derivatives import shape_derivatives as shape_derivatives
from mi_lcair.api.signature import signature as signature
from mi_lcair.api.sweep import sweep as sweep
from mi_lcair.api.temperature import temperature as temperature
from mi_lcair.api.trend import trend as trend
from mi_lcair.api.workers import workers as workers
from mi_lcair.errors import InputError as InputError
from mi_lcair.fitting.estimation import fit as fit
from mi_lcair.rendering.scene import Scene as Scene

__version__: str
