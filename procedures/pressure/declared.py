"""The declared model of a whole-plot procedure: check before the run that the design can estimate it.

`rig plan` forecasts, `rig fit` and `rig trace` fit, and acceptance judges the same model: `[model] formula` of the
procedure, stored in the run file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rig.fitter.errors import FitError
from rig.procedures.plan.run_list import RunList
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.fit import fit_pressure, named_formula
from rig.procedures.pressure.fit.models import ONE_TEMPERATURE, check_determined, usual

if TYPE_CHECKING:
    from rig.procedures.pressure.settings import WholePlotProcedure
    from rig.procedures.tables.table import Table

REHEARSED = 600
"""Maximum number of points for a rehearsal of the fit on simulated readings; its time grows with their cube."""
OUTPUT = "rehearsed_mV"
ACCEPTED_BY = "in-flight zero + WLS"
"""Method whose reading error is judged by acceptance."""


@dataclass(frozen=True)
class Declared:
    """The declared model of a whole-plot table.

    Attributes:
        model: a name of terms, or a formula.
        source: its source: "--formula", "procedure" or "default".
        procedure: the declaration of the run's procedure; None without.
    """

    model: str
    source: str
    procedure: str | None

    @staticmethod
    def of(table: Table, asked: str | None, data: WholePlotData) -> Declared:
        """As requested; otherwise as declared by the procedure of the table's run; otherwise of second order."""
        told = table.declared.get("formula")
        if asked is not None:
            return Declared(asked, "--formula", told)
        return Declared(usual(data), "default", None) if told is None else Declared(told, "procedure", told)

    def to_dict(self) -> dict[str, str | None]:
        """JSON values, with a sentence."""
        if self.source == "procedure":
            said = f"model {self.model}, as the run's procedure declares it"
        elif self.source == "default":
            said = f"model {self.model}: none is declared"
            if self.model == ONE_TEMPERATURE:
                said += (
                    ", and the temperatures that were set do not determine terms of T_SSE; it holds where T_SSE "
                    "follows T_sensor as in these data"
                )
        elif self.procedure is None:
            said = f"model {self.model}, as --formula says"
        else:
            said = f"model {self.model}, as --formula says; the run's procedure declares {self.procedure}"
        return {"fitted": self.model, "source": self.source, "procedure": self.procedure, "sentence": said}


def check_declared(procedure: WholePlotProcedure, run_list: RunList) -> None:
    """Refuse a design that cannot estimate its declared model, or that acceptance could not judge.

    Raises:
        FitError: with the terms that cannot be estimated, and the next step.
    """
    model = procedure.declared_model
    points = run_list.points
    set_to = np.array([p.setpoints for p in points])
    plot = np.array([p.whole_plot for p in points])
    rng, expect = np.random.default_rng(procedure.seed), procedure.expect
    own = expect.sigma_wholeplot_mV * rng.standard_normal(int(plot.max()) + 1)[plot]
    y = expect.sensitivity_mV_per_psi * set_to[:, 0] + own + expect.sigma_subplot_mV * rng.standard_normal(len(plot))
    data = WholePlotData(
        whole_plot=plot,
        order=np.arange(len(plot)),
        elapsed_s=np.arange(len(plot), dtype=np.float64),
        pressure_psia=set_to[:, 0],
        sensor_temperature_degC=set_to[:, 1],
        sse_temperature_degC=set_to[:, 2],
        outputs={OUTPUT: y},
        replicate=np.array([p.replication for p in points]),
        pressure_set_psia=set_to[:, 0],
        sensor_set_degC=set_to[:, 1],
        sse_set_degC=set_to[:, 2],
    )
    try:
        check_determined(data, named_formula(model))
        if len(data) <= REHEARSED:
            fit = fit_pressure(data, OUTPUT, model)
            if procedure.acceptance.reading_error_pct is not None and ACCEPTED_BY in fit.not_possible:
                raise FitError(f"acceptance.reading_error_pct: {ACCEPTED_BY}: {fit.not_possible[ACCEPTED_BY]}")
    except FitError as error:
        why = str(error).removesuffix("; fit a smaller model")
        if run_list.whole_plots < 2:
            raise FitError(
                f"{why}. List the pair of temperatures twice or more in temperatures_degC, or set "
                f"replications = 2: whole plots at the same temperatures show how much they differ"
            ) from error
        raise FitError(
            f"the design cannot estimate the declared model ({model}): {why}; visit more settings, or declare "
            f'a smaller model: [model] formula = "1 + P + P^2"'
        ) from error
