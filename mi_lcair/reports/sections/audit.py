"""Sections of an audit."""

from mi_lcair.results.sections import Facts, Lines, Section, Table

SCENE = ("absorbed", "escaped", "behind", "created", "unfinished", "balance")
MATERIAL = ("absorbed", "reflected", "behind", "created", "scaled")


def sections(audit) -> list[Section]:
    """Energy of a scene: what is emitted, absorbed and escapes, by material."""

    def share(name, key):
        value, error = audit.shares[name][key]
        return f"{100 * value:.3f} +- {100 * error:.1g}"

    flux, error = audit.total["emitted"]
    scene = [
        ("band", audit.band),
        ("photons", audit.photons),
        ("emitted", f"{flux:.6g} W +- {error:.2g}"),
        *((f"{key} %", share("scene", key)) for key in SCENE),
    ]
    columns = ["material", ("emitted", "W"), ("incident", "W")]
    columns += [f"{key} % of incident" for key in MATERIAL]
    rows = [
        [name, flux["emitted"][0], flux["incident"][0], *(share(name, key) for key in MATERIAL)]
        for name, flux in audit.materials.items()
    ]
    conclusion = ["nothing to remark: energy is conserved within the errors above"]
    parts = [
        "Flux is followed from the emitters until it is absorbed or escapes. Shares of the scene "
        "are of the emitted flux.",
        Facts(scene),
        Table(columns, rows),
        "What a reflection adds falls with their number: the share of the emitted flux that leaves "
        "surfaces after it.",
        Table(
            ["reflection", "% of emitted", "standard error, %"],
            [
                [number, 100 * value, 100 * error]
                for number, (value, error) in enumerate(audit.by_reflection, start=1)
            ],
        ),
        Lines("", audit.remarks or conclusion),
    ]
    return [Section("Energy audit", parts)]
