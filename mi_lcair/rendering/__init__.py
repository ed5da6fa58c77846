"""From a scene XML to a radiance image: `load` and `render`."""
from .render import Render, render
from .scene import Scene, load

__all__ = ["Render", "Scene", "load", "render"]
