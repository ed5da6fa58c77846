"""The tables of the page docs/validation/real_data.md; see `real_data`."""

import numpy as np

from mi_lcair.fitting.model import model_of
from mi_lcair.fitting.report import Fit
from mi_lcair.physics.reflection.models import MODELS

# Model, form and lobe-width parameter of the fits that compare the losses.
LOSS_MODEL, LOSS_FORM, LOSS_WIDTH = "sandford_robertson", "thesis", "e"

# Mark of a parameter by the first word of its verdict.
MARKS = {"determined": "", "weakly": " ʷ", "not": " ⁿ", "at": " ᵇ"}


def table(header, rows) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def parameters(one: Fit) -> list[str]:
    """Return the parameters as text with standard errors and the marks of their verdicts.

    Values are rounded to the first digit of the standard error.
    """
    cells = []
    for name, value in one.parameters.items():
        error = one.standard_error[name]
        digits = max(0, -int(np.floor(np.log10(max(error, 1e-12)))))
        cells.append(
            f"{value:.{digits}f} ± {error:.{digits}f}{MARKS[one.verdict[name].split()[0]]}"
        )
    return cells


def form_of(one: Fit) -> str:
    """Return the form, if the model has several, and the restriction, or "-"."""
    forms = [one.form] if len(MODELS[one.model].forms) > 1 else []
    return ", ".join([*forms, *([one.restriction] if one.restriction else [])]) or "-"


def alone_table(surfaces: list) -> str:
    model = MODELS[surfaces[0].alone.model]
    return table(
        [
            "Surface",
            "Form" if len(model.forms) > 1 else "Restriction",
            *model.names,
            "rms (decades)",
            "Points",
            "Independent points",
            "Error of emissivity",
        ],
        [
            [
                one.title,
                form_of(one.alone),
                *parameters(one.alone),
                f"{one.alone.rms_dex:.4f}",
                str(one.alone.used),
                f"{one.alone.effective_points:.0f}",
                f"{one.alone_error:.3f}",
            ]
            for one in surfaces
        ],
    )


def joint_table(surfaces: list) -> str:
    model = MODELS[surfaces[0].alone.model]
    return table(
        [
            "Surface",
            "Form" if len(model.forms) > 1 else "Restriction",
            *model.names,
            "rms (decades)",
            "Change",
            "Error of emissivity",
            "Change",
        ],
        [
            [
                one.title,
                form_of(one.joint),
                *parameters(one.joint),
                f"{one.joint.rms_dex:.4f}",
                f"{one.joint.rms_dex / one.alone.rms_dex - 1:+.0%}",
                f"{one.joint.emissivity_rms:.3f}",
                f"{one.joint.emissivity_rms / one.alone_error - 1:+.0%}",
            ]
            for one in surfaces
        ],
    )


def form_table(surfaces: list) -> str:
    forms = MODELS[surfaces[0].alone.model].forms
    return table(
        ["Surface"]
        + [f"{form}: {what}" for what in ("rms", "error of emissivity") for form in forms],
        [
            [
                one.title,
                *(f"{one.forms[form]['rms_dex']:.4f}" for form in forms),
                *(f"{one.forms[form]['error']:.3f}" for form in forms),
            ]
            for one in surfaces
        ],
    )


def loss_table(surfaces: list) -> str:
    losses = ("log", "cube_root", "linear")
    return table(
        ["Surface"]
        + [
            f"{loss.replace('_', ' ')}: {what}"
            for what in ("rms (decades)", f"ratio of {LOSS_WIDTH} from two halves")
            for loss in losses
        ],
        [
            [
                one.title,
                *(f"{one.by_loss[loss][0].rms_dex:.3f}" for loss in losses),
                *(f"× {one.spread_of_e(loss):.2f}" for loss in losses),
            ]
            for one in surfaces
        ],
    )


def choice_table(by_model: dict[str, list], chosen: list[tuple[Fit, Fit]]) -> str:
    """Return the table of all models side by side, with the model that `auto` chooses.

    chosen: for each surface the fits of `auto` to the BRDF alone and jointly with the emissivity.
    """
    return table(
        ["Surface"]
        + [
            f"{MODELS[name].title}: {what}"
            for what in ("rms", "error of emissivity")
            for name in by_model
        ]
        + ["auto chooses, BRDF alone", "auto chooses, with emissivity"],
        [
            [
                row[0].title,
                *(f"{one.alone.rms_dex:.4f}" for one in row),
                *(f"{one.alone_error:.3f}" for one in row),
                *map(model_of, fits),
            ]
            for row, fits in zip(zip(*by_model.values()), chosen)
        ],
    )


def limits_table(by_model: dict[str, list]) -> str:
    return table(
        ["Surface", "Reflectance if isotropic", "1 - measured emissivity"]
        + [
            f"{MODELS[name].title}: mirror direction, {angles}"
            for name in by_model
            for angles in ("15-70°", "80°")
        ],
        [
            [
                row[0].title,
                f"{row[0].isotropic_reflectance:.2f}",
                f"{1 - row[0].measured_emissivity(20):.2f}",
                *(
                    f"× {one.mirror_excess(*angles):.1f}"
                    for one in row
                    for angles in ((15, 70), (80, 80))
                ),
            ]
            for row in zip(*by_model.values())
        ],
    )


def tables(by_model: dict[str, list], chosen: list[tuple[Fit, Fit]]) -> dict[str, str]:
    """Return the tables of the page, name of the field -> table."""
    result = {
        "choice_table": choice_table(by_model, chosen),
        "limits_table": limits_table(by_model),
        "loss_table": loss_table(by_model[LOSS_MODEL]),
    }
    for name, surfaces in by_model.items():
        result[f"alone_table_{name}"] = alone_table(surfaces)
        result[f"joint_table_{name}"] = joint_table(surfaces)
        if len(MODELS[name].forms) > 1:
            result[f"form_table_{name}"] = form_table(surfaces)
    return result
