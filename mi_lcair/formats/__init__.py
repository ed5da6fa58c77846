"""Files that other programs read, written from plain arrays: CSV, netCDF, VTK and TIFF."""

VTK = (".vtp", ".vtu")  # suffixes of the files that `formats.vtk` writes
