"""Settings of a loaded scene that may change between renders, and how to change them."""

from collections.abc import Iterator
from contextlib import contextmanager

from mi_lcair.errors import check_known
from mi_lcair.plugins.integrators.bounce_path import BouncePath
from mi_lcair.rendering.scene import Scene
from mi_lcair.startup.threads import exclusive

INTEGRATOR = tuple(entry.name for entry in BouncePath.PROPERTIES)


@contextmanager
def changed(
    scene: Scene, lobe: str | dict[str, str] | None = None, **settings: object
) -> Iterator[None]:
    """Context manager in which a scene has other settings; they are restored at the end.

    lobe: lobe of all reflection models, or of some materials as a dictionary (brdf, mirror or
    diffuse). settings: properties of bounce_path. Raises InputError for an unknown name, material
    or lobe, and for values that contradict each other.
    """
    integrator = scene.mi.integrator()
    check_known("setting", INTEGRATOR, *settings)
    values = {name: getattr(integrator, name) for name in settings}
    with exclusive:
        # Recorded by surface, because two surfaces with the same material may have different lobes
        lobes = [(surface, surface.lobe) for surface in scene.surfaces()]
    try:
        with exclusive:
            for material, rung in (lobe if isinstance(lobe, dict) else {None: lobe}).items():
                if rung is not None:
                    scene.set_lobe(rung, material)
            set_all(integrator, settings)
            integrator.check()
        yield
    finally:
        with exclusive:
            set_all(integrator, values)
            for surface, rung in lobes:
                surface.set_lobe(rung)


def set_all(integrator, values: dict) -> None:
    for name, value in values.items():
        setattr(integrator, name, value)
