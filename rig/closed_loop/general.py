"""Tables of any kind: a response, a formula, and whole plots where readings share an error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fitter import least_squares
from fitter.formula import Formula
from fitter.split_plot import fit_split_plot
from rig.errors import UsageError
from rig.tables import Table, read_any_csv


def fit_general(
    path: Path, response: str, formula: str, whole_plot: Sequence[str] = (), replicate: str | None = None
) -> dict[str, Any]:
    """Fit a formula to a column of a CSV table; JSON-ready.

    Args:
        path: the table.
        response: the column to be explained.
        formula: the model; see `fitter.formula`.
        whole_plot: columns whose values together say which rows share a whole-plot error; none: all independent.
        replicate: column of replications that whole plots are nested in.

    Raises:
        UsageError: a column is missing, the formula cannot be read, or the rows do not determine it.

    """
    try:
        model = Formula.parse(formula)
    except ValueError as error:
        raise UsageError(f"--formula: {error}") from error
    extra = [*whole_plot, *([replicate] if replicate else [])]
    table = read_any_csv(path, dict.fromkeys([response, *model.names, *extra]))
    if response not in table.columns:
        raise UsageError(f"{path}: the response {response} is not a column of numbers")
    y = table.columns[response]
    data = {"file": path.name, "points": len(y), "kind": "general"}
    try:
        names, exact = model.exact_columns({**table.columns, **table.text})
        if not names:
            raise ValueError(f"the formula {formula!r} has no terms: there is nothing to fit")
        if not whole_plot:
            fit = least_squares(exact.hi, y, names, tails=exact.lo)
            rows = zip(fit.coefficients, fit.stderr, [float(fit.df)] * len(names), strict=True)
            errors: dict[str, Any] = {"sigma_E": fit.sigma}
        else:
            blocks = None if replicate is None else _identities(table, [replicate])
            split = fit_split_plot(exact.hi, y, _identities(table, extra), names, replicate=blocks)
            stderr = split.kenward_roger().stderr
            rows = zip(split.coefficients, stderr, split.df, strict=True)
            errors = {
                "sigma_subplot": split.sigma_subplot,
                "sigma_wholeplot": split.sigma_wholeplot,
                "sigma_replicate": split.sigma_replicate,
                "reml_loglik": split.reml_loglik,
                "df_method": split.df_method,
                "notes": list(split.notes),
            }
    except (ValueError, KeyError) as error:
        raise UsageError(f"{path}: {error.args[0] if error.args else error}") from error
    coefficients = {
        name: {"estimate": float(b), "stderr": float(se), "df": float(df)}
        for name, (b, se, df) in zip(names, rows, strict=True)
    }
    return {"data": data, "response": response, "formula": str(model), "coefficients": coefficients, **errors}


def _identities(table: Table, names: Sequence[str]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """One whole number for each combination of values of these columns."""
    every: Mapping[str, np.ndarray[Any, Any]] = {**table.columns, **table.text}
    keys = [np.unique(every[name], return_inverse=True)[1] for name in names]
    return np.asarray(np.unique(np.column_stack(keys), axis=0, return_inverse=True)[1], np.int64).reshape(-1)
