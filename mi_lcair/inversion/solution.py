"""The solution of an inverse problem: what it holds, its file, and its use in other scenes."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.files import read_text, replacing
from mi_lcair.inversion.advice import Advice
from mi_lcair.inversion.answers import Answer, Direction
from mi_lcair.inversion.facet_temperatures import set_facets
from mi_lcair.rendering.facet_table import FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.sensitivity.parameters import parameters, set_values

KIND = "mi_lcair solution"  # first entry of the file
OF_ANY_BAND = ("temperature",)  # kinds of parameters that hold in every band


@dataclass(frozen=True)
class Fitted:
    """A datum after the solution.

    Attributes
    ----------
    name, scene, band, state : str
        As in the problem.
    parameters : dict of str to str
        The scene's $-parameters.
    values : dict of str to float
        Estimated parameters of the scene by name.
    kinds : dict of str to str
        Kinds of these parameters.
    facets : dict of str to dict of int to float
        Estimated temperatures [K] by group and facet.
    measured, predicted, residual : ndarray
        Measured and predicted values [W m^-2 sr^-1 or W/sr], and their difference in standard
        deviations of measurement and render: (H, W) with NaN for pixels that do not count, or (n,).
    aspects : list of tuple of float
        Azimuth and elevation of each value of a trend; empty for others.
    quantity : str
        What was measured, with its unit.
    """

    name: str
    scene: str
    band: str
    state: str
    parameters: dict[str, str]
    values: dict[str, float]
    kinds: dict[str, str]
    facets: dict[str, dict[int, float]]
    measured: np.ndarray
    predicted: np.ndarray
    residual: np.ndarray
    aspects: list
    quantity: str = "radiance (W m^-2 sr^-1)"

    @property
    def is_image(self) -> bool:
        return self.measured.ndim == 2

    @property
    def points(self) -> int:
        """Number of values that count."""
        return int(np.isfinite(self.residual).sum())

    def as_dict(self) -> dict:
        """Entries of the solution's file."""
        entry = {
            "name": self.name,
            "scene": self.scene,
            "parameters": self.parameters,
            "band": self.band,
            "state": self.state,
            "values": self.values,
            "kinds": self.kinds,
            "facets": {
                group: {str(facet): kelvin for facet, kelvin in facets.items()}
                for group, facets in self.facets.items()
            },
            "residual_rms_sigmas": float(np.sqrt(np.nanmean(self.residual**2))),
        }
        if not self.is_image:
            entry["measured"], entry["predicted"] = self.measured.tolist(), self.predicted.tolist()
        return entry


@dataclass(frozen=True)
class Solution:
    """The solution of an inverse problem.

    Attributes
    ----------
    problem : str
        Name of the problem.
    answers : list of Answer
        The unknowns, those that are sought first.
    covariance : ndarray, shape (N, N)
        Covariance of the values.
    directions : list of Direction
        Pairs of unknowns that the data hardly tell apart.
    advice : list of Advice
        What further measurements would bring, the most useful first.
    chi_square, degrees_of_freedom, p_value
        See `answers.chi_square`. p_value is None without degrees of freedom, and for a goal.
    render_share : ndarray, shape (N,)
        Part of each variance that comes from the noise of the render.
    data : list of Fitted
    materials : dict
        Estimated materials by name and band, as in the report of a fit.
    remarks : list of str
    renders : int
        Number of renders of each datum.
    converged : bool
    seconds : float
    """

    problem: str
    answers: list[Answer]
    covariance: np.ndarray
    directions: list[Direction]
    advice: list[Advice]
    chi_square: float
    degrees_of_freedom: float
    p_value: float | None
    render_share: np.ndarray
    data: list[Fitted]
    materials: dict
    remarks: list[str]
    renders: int
    converged: bool
    seconds: float

    def __getitem__(self, label: str) -> Answer:
        """The answer for the unknown with this label."""
        by_label = {answer.label: answer for answer in self.answers}
        if label not in by_label:
            raise unknown("unknown of the solution", label, by_label)
        return by_label[label]

    @property
    def correlation(self) -> np.ndarray:
        """Correlations (N, N) of the errors."""
        from mi_lcair.inversion.answers import correlation

        return correlation(self.covariance)

    def as_dict(self) -> dict:
        """The content of the solution's file."""
        return {
            "kind": KIND,
            "problem": self.problem,
            "unknowns": [
                {**answer.as_dict(), "render_share": float(share)}
                for answer, share in zip(self.answers, self.render_share)
            ],
            "correlation": self.correlation.round(6).tolist(),
            "directions": [direction.as_dict() for direction in self.directions],
            "advice": [one.as_dict() for one in self.advice],
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.degrees_of_freedom,
            "p_value": self.p_value,
            "data": [fitted.as_dict() for fitted in self.data],
            "materials": self.materials,
            "remarks": self.remarks,
            "renders": self.renders,
            "converged": self.converged,
            "seconds": self.seconds,
        }

    def write(self, path: str | Path) -> None:
        """Write the solution as JSON, completely or not at all."""
        with replacing(path) as partial:
            partial.write_text(json.dumps(self.as_dict(), indent=1, allow_nan=False) + "\n")

    def apply(self, scene: Scene, state: str | None = None) -> None:
        """Set the parameters of a loaded scene to the solution, see `apply_solution`."""
        applied(self.problem, json.loads(json.dumps(self.as_dict())), scene, state)


def apply_solution(scene: Scene, file: str | Path, state: str | None = None) -> list[str]:
    """Set the parameters of a loaded scene to those of a solution's file.

    Temperatures hold in every band. Materials, emissivities and radiances are taken from data of
    the scene's band.

    Parameters
    ----------
    scene : Scene
    file : path-like
        File that `mi-lcair invert -o` wrote.
    state : str or None
        Heating state; needed if the values of several states differ.

    Returns
    -------
    list of str
        Names of the parameters that were set.

    Raises
    ------
    InputError
        If the file is no solution, or has nothing, or several values, for the scene.
    """
    return applied(str(file), read_solution(file), scene, state)


def read_solution(file: str | Path) -> dict:
    """The content of a solution's file; raises InputError for any other file."""
    try:
        content = json.loads(read_text(file, f"solution {file}"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"solution {file}: {error}") from None
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise InputError(f"solution {file}: is no file that mi-lcair invert wrote")
    return content


def applied(file: str, content: dict, scene: Scene, state: str | None) -> list[str]:
    """Set the parameters of a scene to the content of a solution; returns their names."""
    data = content["data"]
    states = {entry["state"] for entry in data}
    if state is not None and state not in states:
        raise unknown(f"state of {file}", state, states)
    known = parameters(scene)
    values, facets, owner = {}, {}, {}
    for entry in data:
        if state is not None and entry["state"] != state:
            continue
        found = {
            name: value
            for name, value in entry["values"].items()
            if name in known
            and (entry["kinds"][name] in OF_ANY_BAND or entry["band"] == scene.band.name)
        }
        found |= {
            (group, int(facet)): kelvin
            for group, own in entry["facets"].items()
            for facet, kelvin in own.items()
        }
        for name, value in found.items():
            if owner.setdefault(name, (value, entry))[0] != value:
                other = owner[name][1]
                raise InputError(
                    f"{file}: '{name}' differs between '{other['name']}' and '{entry['name']}'; "
                    f"name a state, {' or '.join(sorted(states))}, as in {file}:STATE"
                )
            if isinstance(name, tuple):
                facets[name] = value
            else:
                values[name] = value
    if not values and not facets:
        raise InputError(
            f"{file}: has no parameter of {scene.name} in band {scene.band.name}; its data are "
            f"{', '.join(sorted({entry['scene'] + ' ' + entry['band'] for entry in data}))}"
        )
    if facets:
        check_facets(file, scene, facets)
        set_facets(scene, {facet: kelvin for (_, facet), kelvin in facets.items()})
    set_values(scene, values)
    return [*values, *sorted({f"{group}.facets" for group, _ in facets})]


def check_facets(file: str, scene: Scene, facets: dict) -> None:
    """Raise InputError unless all facets belong to their groups in the scene."""
    table = FacetTable(scene)
    for group, facet in facets:
        if facet >= table.count or table.group[facet] != group:
            raise InputError(
                f"{file}: facet {facet} of group {group} is not one of {scene.name}; the solution "
                "belongs to another model"
            )
