"""Parameters of a loaded scene, and derivatives of its radiance with respect to them."""
