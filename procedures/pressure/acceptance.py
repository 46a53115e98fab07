"""Whether a finished pressure calibration is fit for use."""

from __future__ import annotations

import numpy as np

from rig.procedures.errors import DataError
from rig.procedures.evaluate.acceptance import Verdict, gross_words
from rig.procedures.pressure.declared import ACCEPTED_BY
from rig.procedures.pressure.fitted import fit_whole_plots
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.procedures.pressure.words import largest_words
from rig.procedures.tables.table import Table


def judge(procedure: WholePlotProcedure, table: Table) -> list[Verdict]:
    """Every transducer's reading error in use compared with its limit; [] without one."""
    limit, psia = procedure.acceptance.reading_error_pct, procedure.acceptance.at_psia
    if limit is None:
        return []
    words = f"reading error in use at {psia:g} psia up to {limit:g} %, {ACCEPTED_BY}"
    fitted = fit_whole_plots(table)
    verdicts = [Verdict(name, why, words, inside=False) for name, why in fitted.dead.items()]
    for name, fit in fitted.fits.items():
        method = fit.methods.get(ACCEPTED_BY)
        if method is None:
            raise DataError(f"{name}: {ACCEPTED_BY} is not possible: {fit.not_possible[ACCEPTED_BY]}")
        errors, use = method.reading_error, method.in_use
        at = int(abs(errors.pressure_psia - psia).argmin())
        if abs(errors.pressure_psia[at] - psia) > 0.05 * psia:
            raise DataError(f"no pressure near acceptance.at_psia = {psia:g} was measured")
        # if no other reading of the whole plot can serve as zero, the interval of a reading in use is judged
        found = float(use.max_pct[at] if np.isfinite(use.max_pct[at]) else use.half95_pct[at])
        shown = {"in_use": use.to_dict()}
        gross = gross_words(fitted.gross(name))
        said = f"reading error at {psia:g} psia {largest_words(shown, at)}, limit {limit:g} %{gross}"
        verdicts.append(Verdict(name, said, words, found <= limit))
    return verdicts
