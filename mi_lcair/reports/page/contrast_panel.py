"""Panel and tables of a contrast: irradiances, spectra, and ranges of detection."""

import numpy as np

from mi_lcair.reports.page.figures import INK, LINE, colour, figure_panel, graph_objects, subplots
from mi_lcair.reports.page.figures import name as plain_name
from mi_lcair.reports.page.page import Panel, Section, paragraph
from mi_lcair.reports.page.spectrum_panel import INTENSITY, WAVELENGTH
from mi_lcair.reports.page.tables import facts, listed, table, with_error

IRRADIANCE = "irradiance (W m⁻² µm⁻¹)"


def contrast_sections(contrast) -> list[Section]:
    """Irradiances, spectra and detection ranges of a contrast."""
    detector = contrast.detector
    rows = [
        [
            row.max_bounces,
            with_error(*row.intensity),
            *(with_error(*term) for term in (row.target, row.background, row.path)),
            f"{row.total.value:.5g} ± {row.half_width:.2g}",
            with_error(*row.nei_max),
            *([] if row.detected is None else ["yes" if row.detected else "no"]),
        ]
        for row in contrast.rows
    ]
    watts = "W m⁻²"
    columns = [
        "reflections up to",
        ("intensity", "W sr⁻¹"),
        ("target", watts),
        ("background", watts),
        ("path", watts),
        ("contrast (95 %)", watts),
        ("largest nei", watts),
        *([] if contrast.rows[0].detected is None else ["detected"]),
    ]
    first = contrast.rows[-1]
    pieces = [
        facts(
            [
                ("scenario", f"{contrast.scenario.name}: {contrast.scenario.title}"),
                ("band", detector.band.label),
                ("range", f"{contrast.path.range_m:.6g} m"),
                ("elevation of the line of sight", f"{contrast.sight_elevation_deg:.4g}°"),
                (
                    "atmosphere",
                    f"{contrast.air.name}: mean transmittance {contrast.transmittance:.4f}, path "
                    f"{contrast.path_radiance:.5g} W m⁻² sr⁻¹",
                ),
                (
                    "background",
                    f"{contrast.background_name}: {contrast.background_radiance:.5g} W m⁻² sr⁻¹",
                ),
                (
                    "target",
                    f"projected area {with_error(*first.projected_area)} m², "
                    f"{first.solid_angle:.5g} sr",
                ),
            ]
        ),
        table(columns, rows),
        listed(contrast.remarks),
    ]
    sections = [Section("Contrast", pieces), Section("Spectra", [contrast_panel(contrast)])]
    if detector.nei is not None:
        sections.insert(1, ranges_section(contrast))
    return sections


def ranges_section(contrast) -> Section:
    """Detection ranges of a contrast whose sensor has a nei."""
    rows = []
    for row, detection in zip(contrast.rows, contrast.detection_ranges()):
        intervals = ", ".join(f"{a:.5g} to {b:.5g}" for a, b in detection.intervals_m)
        if detection.at_least:
            note = "at least: the table of the air ends there"
        elif detection.intervals_m:
            note = f"± {detection.standard_error_m:.2g} m (standard error of the largest)"
        else:
            note = "no range"
        rows.append([row.max_bounces, intervals or "none", note])
    words = (
        f"Ranges at which the contrast reaches {contrast.detector.snr:g} times the "
        f"noise-equivalent irradiance of {contrast.detector.nei:g} W m⁻²."
    )
    return Section(
        "Detection range",
        [paragraph(words), table(["reflections up to", ("detected", "m"), "remark"], rows)],
    )


def contrast_panel(contrast) -> Panel:
    """The panel of a contrast's spectra, for its last number of reflections.

    Shown are the intensity before the air, the target's irradiance with the transmittance of the
    air, and the terms of the contrast.
    """
    go, row = graph_objects(), contrast.rows[-1]
    x, spectra = row.irradiance.wavelengths_um, row.irradiance.spectral(contrast.path)
    transmittance, _ = contrast.path.at(x)
    figure = subplots(
        rows=3,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.08,
        specs=[[{}], [{"secondary_y": True}], [{}]],
        subplot_titles=(
            f"target before the air: {row.intensity.value:.4g} W/sr in band",
            f"target through {contrast.path.range_m:.5g} m of {plain_name(contrast.air.name)}: "
            f"{row.target.value:.4g} W/m² in band",
            f"contrast: {row.total.value:.4g} W/m² in band",
        ),
    )

    def add(place, title, values, color, unit, **options):
        secondary = options.pop("secondary_y", None)
        figure.add_trace(
            go.Scatter(
                x=x,
                y=np.asarray(values, float),
                name=title,
                line=LINE | {"color": color},
                hovertemplate=f"%{{x:.4g}} µm: %{{y:.5g}} {unit}",
                **options,
            ),
            row=place,
            col=1,
            secondary_y=secondary,
        )

    watts = "W m⁻² µm⁻¹"
    add(1, "intensity", spectra["intensity"], INK, "W sr⁻¹ µm⁻¹")
    add(2, "target at the sensor", spectra["target"], colour(1), watts)
    add(2, "transmittance (right)", transmittance, colour(8), "", secondary_y=True)
    add(3, "target", spectra["target"], colour(1), watts, showlegend=False)
    add(3, "path", spectra["path"], colour(0), watts)
    add(3, "background, hidden", -spectra["background"], colour(2), watts)
    add(3, "contrast", spectra["total"], INK, watts)
    figure.update_yaxes(title_text=INTENSITY, rangemode="tozero", row=1, col=1)
    figure.update_yaxes(title_text=IRRADIANCE, row=2, col=1, secondary_y=False)
    figure.update_yaxes(
        title_text="transmittance",
        range=[0, 1.05],
        tickmode="linear",
        tick0=0,
        dtick=0.25,
        showgrid=False,
        row=2,
        col=1,
        secondary_y=True,
    )
    figure.update_yaxes(title_text=IRRADIANCE, row=3, col=1)
    figure.update_xaxes(title_text=WAVELENGTH, row=3, col=1)
    figure.update_layout(
        legend={"orientation": "h", "y": -0.07, "yanchor": "top"},
        margin={"l": 70, "r": 60, "t": 40, "b": 60},
    )
    return figure_panel(figure, 900)
