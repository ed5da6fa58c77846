"""Facet models: a labelled Wavefront OBJ in; meshes, a scene and a report of its flaws out. Needs
no Mitsuba.

`read` takes the file, `report` says what it holds and what is wrong with it, `export` writes what a
scene includes. Harkiss 2007, 3.2; a facet is one face of the OBJ, numbered from 0 in the file's
order.
"""

from mi_lcair.models3d.export import export
from mi_lcair.models3d.model import Model, read
from mi_lcair.models3d.report import report

__all__ = ["Model", "export", "read", "report"]
