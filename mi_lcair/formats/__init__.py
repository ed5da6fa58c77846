"""Files that other programs read, written from plain arrays: CSV, netCDF, VTK and TIFF."""
