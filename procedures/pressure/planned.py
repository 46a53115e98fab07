"""A whole-plot run as it is planned: outputs of a straight transducer with the expected errors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.fitter.split_plot import SplitPlotDesign
from rig.procedures.evaluate.budgeting import Expected
from rig.procedures.plan.run_list import RunList
from rig.procedures.pressure.precision import coded_columns
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.procedures.tables.table import Table

_SEED = 20260115


def expected_run(procedure: WholePlotProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
    """See `Kind.expected`; the first transducer stands for all."""
    expect = procedure.expect
    names = ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
    pressure, sensor, sse = (np.array(run_list.column(name), np.float64) for name in names)
    plot = np.array([point.whole_plot for point in run_list.points], np.int64)
    rng, n = np.random.default_rng(_SEED), len(pressure)
    terms, fixed = coded_columns(procedure, run_list)
    ratio = (expect.sigma_wholeplot_mV / expect.sigma_subplot_mV) ** 2
    errors = expect.sigma_subplot_mV * SplitPlotDesign(fixed, plot, terms).expected_errors(ratio, rng)
    output = expect.sensitivity_mV_per_psi * pressure + errors
    column = next(iter(sensors))
    columns = {
        "whole_plot": plot.astype(np.float64),
        "replicate": np.array([point.replication for point in run_list.points], np.float64),
        "order": np.arange(1.0, n + 1.0),
        "elapsed_s": np.arange(float(n)),
        "pressure_psia": pressure,
        "sensor_temperature_degC": sensor,
        "sse_temperature_degC": sse,
        column: output,
    }
    words = (
        f"transducers of {expect.sensitivity_mV_per_psi:g} mV/psi, {expect.sigma_wholeplot_mV:g} mV between whole "
        f"plots and {expect.sigma_subplot_mV:g} mV within, [expect]"
    )
    declared = {"formula": procedure.declared_model}
    table = Table("the plan", columns, True, {}, declared=declared, kind="whole-plot", outputs={column: column})
    return Expected(table, meter=True, assuming=words)
