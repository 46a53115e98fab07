"""Whether a finished attitude calibration is fit for use."""

from __future__ import annotations

from rig.procedures.attitude.fitted import fit_attitude_table
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.evaluate.acceptance import Verdict, gross_words
from rig.procedures.tables.table import Table


def judge(procedure: PitchRollProcedure, table: Table) -> list[Verdict]:
    """Every sensor's standard error compared with its limit; [] without one."""
    limit = procedure.acceptance.sigma_E_deg
    if limit is None:
        return []
    words = f"sigma_E up to {limit:g} deg"
    verdicts = []
    for name, sensor in fit_attitude_table(table)["sensors"].items():
        sigma = sensor["sigma_E_deg"]
        shown = "unknown" if sigma is None else f"{sigma:.3g} deg"
        inside = sigma is not None and sigma <= limit
        said = f"sigma_E {shown}, limit {limit:g} deg{gross_words(sensor['gross_errors'])}"
        verdicts.append(Verdict(name, said, words, inside))
    return verdicts
