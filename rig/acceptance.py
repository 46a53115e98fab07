"""Whether a finished calibration is fit for use, by the limits its procedure set beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from procedures.attitude.settings import PitchRollProcedure
from procedures.kind import Procedure
from procedures.pressure.declared import ACCEPTED_BY
from procedures.pressure.settings import WholePlotProcedure
from rig.closed_loop import fit_table, fit_whole_plots
from rig.closed_loop.whole_plot import largest_words
from rig.errors import UsageError
from rig.tables import Table, run_table


@dataclass(frozen=True)
class Verdict:
    """One sensor against its limit.

    Attributes:
        sensor: name of its output.
        found: what was found, and the limit it exceeds or keeps.
        limit: the limit alone, in words.
        inside: whether it is kept.

    """

    sensor: str
    found: str
    limit: str
    inside: bool


def judge(procedure: Procedure, path: Path) -> list[Verdict]:
    """Every sensor of a complete run against the procedure's limit; [] where there is none.

    Raises:
        RigError: the run cannot be fitted.

    """
    if isinstance(procedure, WholePlotProcedure):
        limit = procedure.acceptance.reading_error_pct
        return [] if limit is None else _reading_errors(run_table(path), limit, procedure.acceptance.at_psia)
    return _standard_errors(procedure, path)


def _standard_errors(procedure: PitchRollProcedure, path: Path) -> list[Verdict]:
    limit = procedure.acceptance.sigma_E_deg
    if limit is None:
        return []
    words = f"sigma_E up to {limit:g} deg"
    verdicts = []
    for name, sensor in fit_table(run_table(path))["sensors"].items():
        sigma = sensor["sigma_E_deg"]
        shown = "unknown" if sigma is None else f"{sigma:.3g} deg"
        inside = sigma is not None and sigma <= limit
        said = f"sigma_E {shown}, limit {limit:g} deg{_gross(sensor['gross_errors'])}"
        verdicts.append(Verdict(name, said, words, inside))
    return verdicts


def _gross(found: Mapping[str, Any]) -> str:
    """Which rows are gross errors, where some are."""
    rows = ", ".join(str(row) for row in found["rows"])
    return f"; with gross errors in it, row{'s' * (len(found['rows']) > 1)} {rows}: see rig fit" if rows else ""


def _reading_errors(table: Table, limit: float, psia: float) -> list[Verdict]:
    words = f"reading error in use at {psia:g} psia up to {limit:g} %, {ACCEPTED_BY}"
    fitted = fit_whole_plots(table)
    verdicts = [Verdict(name, why, words, inside=False) for name, why in fitted.dead.items()]
    for name, fit in fitted.fits.items():
        method = fit.methods.get(ACCEPTED_BY)
        if method is None:
            raise UsageError(f"{name}: {ACCEPTED_BY} is not possible: {fit.not_possible[ACCEPTED_BY]}")
        errors, use = method.reading_error, method.in_use
        at = int(abs(errors.pressure_psia - psia).argmin())
        if abs(errors.pressure_psia[at] - psia) > 0.05 * psia:
            raise UsageError(f"no pressure near acceptance.at_psia = {psia:g} was measured")
        # where no other reading of the whole plot can serve as zero, the interval of a reading in use is judged
        found = float(use.max_pct[at] if np.isfinite(use.max_pct[at]) else use.half95_pct[at])
        shown = {"in_use": use.to_dict()}
        gross = _gross(fitted.gross(name))
        said = f"reading error at {psia:g} psia {largest_words(shown, at)}, limit {limit:g} %{gross}"
        verdicts.append(Verdict(name, said, words, found <= limit))
    return verdicts
