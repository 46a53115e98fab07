"""An effect as values for the reports' templates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rig.fitter.rounding import with_error
from rig.procedures.present.numbers import interval_text
from rig.procedures.present.words import capitalised, chance, instead, percent, share, size_of, units, unnamed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def effects_part(found: Mapping[str, Any], plots: Mapping[str, Figure]) -> dict[str, Any]:
    """Values of one sensor for the template of effects.

    Args:
        found: its JSON from `rig trace --json`.
        plots: before and after, by effect; without those that the report shows elsewhere.
    """
    texts = unnamed(found)
    strata = [effect["stratum"] for effect in found["effects"]]
    kinds = ["Effects the declared model lacks"] if set(strata) - {"noise"} else []
    kinds += ["findings about the noise"] if "noise" in strata else []
    return {
        "heading": capitalised(", and ".join(kinds)),
        "effects": [effect_rows(effect, plots.get(effect["effect"])) for effect in found["effects"]],
        "unnamed": texts,
        "left": [
            *({"text": text, "shape": _shape_of(rest)} for text, rest in zip(texts, found["unnamed"], strict=True)),
            *([{"text": instead(found), "shape": _shape_of(found["instead"])}] if instead(found) else []),
        ],
        "certificate": found["certificate"],
    }


def effect_rows(effect: dict[str, Any], plot: Figure | None = None) -> dict[str, Any]:
    """An effect's JSON with numbers as text and one row per term.

    Args:
        effect: from `rig trace --json`.
        plot: before and after; None if the report shows it elsewhere.
    """
    columns = (effect["terms"], effect["coefficients"], effect["stderr"], effect["interval_95"], units(effect))
    return {
        **effect,
        "share": share(effect),
        "p": chance(effect),
        "cause": capitalised(effect["cause"]),
        "aliases": ", ".join(effect["aliases"]),
        "plot": plot,
        "terms": [
            dict(
                zip(
                    ("term", "value", "stderr", "interval", "unit"),
                    (term, *with_error(value, error), interval_text(pair, error), unit),
                    strict=True,
                )
            )
            for term, value, error, pair, unit in zip(*columns, strict=True)
        ],
    }


def _shape_of(rest: Mapping[str, Any]) -> dict[str, Any] | None:
    """The JSON of its shape with numbers as text, and the plot; None without a shape."""
    if (shape := rest.get("shape")) is None:
        return None
    from rig.procedures.present.shape_plots import draw_shape  # noqa: PLC0415 - matplotlib takes a second to import

    return {
        "stratum": shape["stratum"],
        "over": " and ".join(axis["label"] for axis in (shape["over"], shape["beside"]) if axis is not None),
        "size": size_of(shape),
        "p": chance({"p_adjusted": shape["p"], "p_adjusted_is_bound": False}),
        "nearest": [
            {
                "effect": one["effect"],
                "explains": percent(one["explains"]),
                "behind": f"{one['behind_sigmas']:.1f} standard errors",
            }
            for one in shape["nearest"]
        ],
        "none": shape["nearest_sentence"].partition("; ")[2],
        "measure": shape["measure"],
        "plot": draw_shape(shape),
    }
