"""Method of Gouffé for the emissivity of a cavity (thesis 3.6, Eqs 3.10-3.12, Table 3.3)."""


def cavity_emissivity(emissivity: float, s: float, S: float) -> float:
    """Emissivity epsilon_0' of a cavity (Eq 3.12), exact for a diffuse sphere.

    emissivity: that of the wall. s: area of the aperture. S: area of the wall and the aperture.
    """
    return emissivity / (emissivity * (1 - s / S) + s / S)


def shape_term(emissivity: float, s: float, S: float, S0: float) -> float:
    """Correction k for the shape (Eq 3.11). S0: area of a sphere of the cavity's depth."""
    return (1 - emissivity) * (s / S - s / S0)


def gouffe(emissivity: float, s: float, S: float, S0: float) -> float:
    """Total emissivity epsilon_0 of a cavity (Eq 3.10)."""
    return cavity_emissivity(emissivity, s, S) * (1 + shape_term(emissivity, s, S, S0))
