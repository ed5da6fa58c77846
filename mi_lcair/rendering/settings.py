"""The settings of a loaded scene that may change between renders, and the one way to change them."""

from contextlib import contextmanager

from mi_lcair.errors import unknown
from mi_lcair.rendering.scene import Scene

INTEGRATOR = ("max_bounces", "emitter_sampling", "closure", "ambient_temperature")


@contextmanager
def changed(scene: Scene, lobe: str | dict[str, str] | None = None, **settings):
    """Context manager: within, the scene has these settings; afterwards those that it had before.

    lobe: the rung of all surfaces with a fidelity ladder, or by material. settings: properties of
    bounce_path by name: max_bounces, emitter_sampling, closure, ambient_temperature. Raises
    InputError for an unknown name, material or rung, and for values that do not go together.
    """
    integrator = scene.mi.integrator()
    for name in settings:
        if name not in INTEGRATOR:
            raise unknown("setting", name, INTEGRATOR)
    values = {name: getattr(integrator, name) for name in settings}
    # by surface: two surfaces of one material's name may have different rungs
    lobes = [(surface, surface.lobe) for surface in scene.surfaces()]
    try:
        for material, rung in (lobe if isinstance(lobe, dict) else {None: lobe}).items():
            if rung is not None:
                scene.set_lobe(rung, material)
        set_all(integrator, settings)
        integrator.check()
        yield
    finally:
        set_all(integrator, values)
        for surface, rung in lobes:
            surface.set_lobe(rung)


def set_all(integrator, values: dict) -> None:
    for name, value in values.items():
        setattr(integrator, name, value)
