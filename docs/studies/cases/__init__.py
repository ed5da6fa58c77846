"""Cases that compare with measured or published values, one a file.

A case is a module of this folder with a function `compare` that returns a `Comparison`. Its
docstring says what is compared and where the values are from. `python -m docs.studies.cases [NAME]`
runs all or one of them.
"""
