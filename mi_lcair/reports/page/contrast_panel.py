"""Panel of the spectra of a contrast."""

import numpy as np

from mi_lcair.reports.page.figures import INK, LINE, colour, figure_panel, graph_objects, subplots
from mi_lcair.reports.page.figures import name as plain_name
from mi_lcair.reports.page.panel import Panel
from mi_lcair.reports.page.spectrum_panel import INTENSITY, WAVELENGTH

IRRADIANCE = "irradiance (W m⁻² µm⁻¹)"


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
