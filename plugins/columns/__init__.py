"""Tables from which the derivatives of paths in parameters are recorded."""
