"""Import of facet models from Wavefront OBJ, glTF, PLY, STL and USD files; needs no Mitsuba.

`read` reads the file, `report` describes its content and its errors, `export` writes the meshes and
scene files. A facet is one face of an OBJ, PLY or USD file, or one triangle of the other formats,
numbered from 0 in the file's order. Source of the labels: Harkiss 2007, section 3.2.
"""

from mi_lcair.models3d.checks import report
from mi_lcair.models3d.export import export
from mi_lcair.models3d.model import Model, read

__all__ = ["Model", "export", "read", "report"]
