"""What a solution says about its data and materials."""

import numpy as np

from mi_lcair.inversion.data.datum import Datum
from mi_lcair.inversion.least_squares.prediction import DatumBlock
from mi_lcair.inversion.solution import Fitted
from mi_lcair.inversion.unknowns import Unknown
from mi_lcair.physics.estimation.profiles import correlation


def fitted(datum: Datum, block: DatumBlock, everything: list[Unknown], x: np.ndarray) -> Fitted:
    """A datum after the solution."""
    prediction = block.at(x)
    predicted = prediction.mean
    weight = np.where(block.weight > 0, block.weight, np.nan)  # bad pixels have no residual
    residual = prediction.residuals.mean(axis=0) * np.sqrt(weight)
    image = datum.image if datum.is_image else lambda values: values
    own_unknowns = [everything[k] for k in datum.numbers(everything)]
    facets = {}
    for k in datum.numbers(everything):
        if (unknown := everything[k]).kind == "facet":
            facets.setdefault(unknown.name, {})[unknown.facet] = float(x[k])
    return Fitted(
        name=datum.label,
        scene=datum.scene.name,
        band=datum.scene.band.name,
        state=datum.entry.state,
        parameters=dict(datum.scene.parameters),
        values=datum.settings(everything, x),
        kinds={
            unknown.name: unknown.kind
            for unknown in own_unknowns
            if unknown.name in datum.where.parameters
        },
        facets=facets,
        points=int(np.isfinite(residual).sum()),
        size=image(residual).size,
        residual_rms_sigmas=float(np.sqrt(np.nanmean(residual**2))),
        measured=image(datum.measured - datum.background),
        predicted=image(predicted - datum.background),
        residual=image(residual),
        aspects=list(datum.aspects),
        quantity=datum.quantity,
        bad_pixels=datum.bad_pixels(block),
    )


def materials(data: list[Datum], everything: list[Unknown], x, covariance) -> dict:
    """Estimated materials by name and band, in the form of a fit's report.

    Parameters that were not estimated have an error of 0.

    A material that is not the same in all data of a band is left out.
    """
    result, ambiguous = {}, set()
    for datum in data:
        number_of = {
            everything[k].name: k
            for k in datum.numbers(everything)
            if everything[k].kind == "material"
        }
        names = {name.rpartition(".")[0] for name in number_of}
        with datum.at(everything, x):
            for surface in datum.scene.surfaces():
                material = surface.material
                if material not in names:
                    continue
                entry = {
                    "model": surface.model.name,
                    "form": surface.form,
                    "band": datum.scene.band.name,
                    "parameters": dict(zip(surface.model.names, surface.values)),
                    **spread(material, surface.model.names, number_of, covariance),
                }
                key = material, datum.scene.band.name
                of_material = result.setdefault(key[0], {})
                if of_material.setdefault(key[1], entry) != entry:
                    ambiguous.add(key)
    for name, band in ambiguous:
        del result[name][band]
    return {name: bands for name, bands in result.items() if bands}


def spread(material: str, names, number_of: dict[str, int], covariance: np.ndarray) -> dict:
    """Standard errors and correlations of a material's parameters, as in a fit's report."""
    columns = [number_of.get(f"{material}.{name}") for name in names]
    estimated = [k for k in columns if k is not None]
    total = np.zeros((len(names),) * 2)
    is_estimated = np.array([k is not None for k in columns])
    total[np.ix_(is_estimated, is_estimated)] = covariance[np.ix_(estimated, estimated)]
    return {
        "standard_error": dict(zip(names, np.sqrt(np.diag(total)).tolist())),
        "correlation": correlation(total).tolist(),
    }
