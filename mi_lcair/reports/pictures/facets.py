"""Picture of a table of facets: the brightest ones, and radiance by temperature."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.signatures.facet_results import FacetResults

MOST_BARS = 20  # facets with a bar


@styled
def figure(facets: FacetResults):
    """Figure with the intensities of the brightest facets, and all radiances over temperature.

    Bars and points are coloured by group. Lines at the ends of the bars are standard errors.
    """
    table = facets.table
    names = list(dict.fromkeys(table["group"]))
    colors = {name: f"C{k % 10}" for k, name in enumerate(names)}
    figure = new_figure((11, 4.5), layout="constrained")
    bright, cloud = figure.subplots(1, 2)

    intensity = np.nan_to_num(table["intensity_W_sr"])
    visible = np.flatnonzero(table["samples"])
    order = visible[np.argsort(-intensity[visible], kind="stable")][:MOST_BARS]
    bright.bar(
        np.arange(len(order)),
        intensity[order],
        yerr=np.nan_to_num(table["standard_error_W_sr"])[order],
        color=[colors[table["group"][k]] for k in order],
    )
    bright.set_xticks(np.arange(len(order)), [str(table["facet"][k]) for k in order])
    bright.tick_params(axis="x", rotation=90 if len(order) > 10 else 0)
    bright.set_xlim(-1, max(len(order), 2))
    bright.set_xlabel("facet")
    bright.set_ylabel(r"intensity (W sr$^{-1}$)")
    bright.set_title(f"the {len(order)} brightest of {len(visible)} facets that the sensor sees")

    for name in names:
        in_group = (table["group"] == name) & (table["samples"] > 0)
        cloud.plot(
            table["temperature_K"][in_group],
            table["radiance_W_m2_sr"][in_group],
            ".",
            color=colors[name],
            label=plain(name),
        )
    cloud.ticklabel_format(useOffset=False)
    cloud.set_xlabel("temperature (K)")
    cloud.set_ylabel(r"radiance (W m$^{-2}$ sr$^{-1}$)")
    cloud.set_title("radiance of these facets, by group")
    cloud.legend(ncols=1 + len(names) // 12)
    figure.suptitle(plain(f"{facets.scene_name}, {facets.band}"))
    return figure
