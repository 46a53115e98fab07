"""Findings about noise of a whole-plot run: growing scatter, autocorrelated errors, outliers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter.effects.noise_names import AUTOCORRELATION, COMMON_ERROR, SLOPES_DIFFER
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.chance import ALPHA, counted
from rig.fitter.trace.engine.components import spread_within
from rig.fitter.trace.engine.differing import CLEAR, MEMORY, SLOPES, component
from rig.fitter.trace.engine.robust import told
from rig.procedures.pressure.effects import GROWING_NOISE
from rig.procedures.pressure.trace.common import common_error
from rig.procedures.pressure.trace.reasons import Run
from rig.procedures.pressure.trace.result import FoundPressureEffect

FROM_MIDDLE = "readings scatter more the further the pressure is from the middle of its range"


def noise_findings(run: Run, i: int) -> list[FoundPressureEffect]:
    """Findings of stratum "noise" about transducer `i`."""
    found = (_growing(run, i), _remembered(run, i), _differing(run, i), _common(run, i), _outliers(run, i))
    return [finding for finding in found if finding is not None]


def _growing(run: Run, i: int) -> FoundPressureEffect | None:
    """Coefficients of sd = a + b P."""
    noise = run.settled.noise[i]
    if noise is None:
        return None
    p = run.data.pressure_psia
    middle = noise.middle
    low, high = noise.sd(np.array([p.min() if middle is None else middle, p.max()])).tolist()
    df = run.free("subplot", i)
    found = _of_noise(
        run,
        i,
        effect=GROWING_NOISE.name,
        cause=GROWING_NOISE.cause if middle is None else FROM_MIDDLE,
        terms=("1", "P" if middle is None else f"|P - {middle:.4g} psia|"),
        coefficients=(noise.at_zero, noise.per_unit),
        unit=GROWING_NOISE.unit,
        size=f"sd {low:.2g} mV at {'the lowest' if middle is None else f'{middle:.4g} psia'}, {high:.2g} mV at the "
        f"highest{' and lowest' if middle is not None else ''} pressure",
        p=run.settled.p[i],
        separate_by=GROWING_NOISE.separate_by,
        against=GROWING_NOISE.against,
        peak_mV=high,
    )
    half = tuple(t_limit(0.95, df) * error for error in noise.stderr)
    return replace(found, stderr=noise.stderr, df=(df, df), half_width_95=half)


def _remembered(run: Run, i: int) -> FoundPressureEffect | None:
    """Correlation of successive readings, if it is significant: by the likeliest errors with it and without."""
    one = run.unmodelled[i]
    rho, p = component(one.judge, one.chosen, MEMORY)
    if p > ALPHA:
        return None
    return _of_noise(
        run,
        i,
        effect=AUTOCORRELATION,
        cause="what a reading is off by stays with the next ones: something wanders within whole plots that was "
        "not recorded",
        terms=("correlation with the reading before",),
        coefficients=(rho,),
        unit="1",
        size=f"successive readings' errors correlate by about {rho:.2g}; effects were judged beside that",
        p=p,
        separate_by="read one pressure for an hour, and record what may wander (temperatures, supply)",
        against="since_s",
        peak_mV=float(run.after.fits[i].sigma_subplot),
    )


def _differing(run: Run, i: int) -> FoundPressureEffect | None:
    """Slopes of whole plots that scatter by more than readings explain."""
    one = run.unmodelled[i]
    sd, p = component(one.judge, one.chosen, SLOPES)
    if p > CLEAR:
        return None
    per_psi = sd / spread_within(run.judge.problem.whole_plot, run.data.pressure_psia)
    sensitivity = abs(run.scene.sensitivity[run.judge.problem.sensors[i]])
    return _of_noise(
        run,
        i,
        effect=SLOPES_DIFFER,
        cause="the sensitivity differs from whole plot to whole plot by more than readings explain: something that "
        "was not recorded acts on it, or it follows a temperature in another way than is declared",
        terms=("standard deviation of the sensitivities of whole plots",),
        coefficients=(per_psi,),
        unit="mV/psi",
        size=f"sensitivities of whole plots scatter by {per_psi:.2g} mV/psi, {100 * per_psi / sensitivity:.2g} %; "
        "effects were judged beside that",
        p=p,
        separate_by="repeat a whole plot at the same temperatures after others, and set more temperatures",
        against="elapsed_s",
        peak_mV=per_psi * float(np.ptp(run.data.pressure_psia)),
    )


def _common(run: Run, i: int) -> FoundPressureEffect | None:
    """Errors of whole plots that are those of another transducer too, if they are significant."""
    judge, chosen = run.judge, run.after.chosen
    found = common_error(judge.problem, judge.white(chosen).view("whole-plot", chosen), i)
    if found is None or counted(found.p, len(run.judge.problem.sensors)) > ALPHA:
        return None
    sd = float(run.after.fits[i].sigma_wholeplot)
    return _of_noise(
        run,
        i,
        effect=COMMON_ERROR,
        cause=f"whole plots are off by amounts that {found.other} shows too: something acts on both that was not "
        "recorded, or does not follow what was",
        terms=(f"correlation with {found.other}",),
        coefficients=(found.correlation,),
        unit="1",
        size=f"errors of whole plots correlate by {found.correlation:.2f}; their sd is {sd:.2g} mV, and a mean of "
        "transducers has them in full",
        p=counted(found.p, len(run.judge.problem.sensors)),
        separate_by="record what acts on all transducers (ambient pressure, supply, gradients, the reference's "
        "temperature), and repeat a whole plot after another history",
        against="elapsed_s",
        peak_mV=sd,
    )


def _outliers(run: Run, i: int) -> FoundPressureEffect | None:
    """Readings that stand alone within their whole plot."""
    one = run.unmodelled[i]
    off, view = one.judge.problem.y - one.judge.held(one.chosen), one.view("subplot")
    error = view.sigma[0] * one.judge.problem.sd
    deviation = view.outputs[0] * error + off

    def place(row: int) -> str:
        return f"order {run.data.order[row]} at {run.data.pressure_psia[row]:.3g} psia"

    found = told(off, deviation, error, float(view.df[0]), len(run.judge.problem.sensors), place)
    if found is None:
        return None
    return _of_noise(run, i, unit="mV", peak_mV=float(np.max(np.abs(found["coefficients"]))), **found)


def _of_noise(run: Run, i: int, *, p: float, peak_mV: float, **told: Any) -> FoundPressureEffect:
    unknown = (float("nan"),) * len(told["coefficients"])
    return FoundPressureEffect.of_noise(
        p=p,
        df=unknown,
        half_width_95=unknown,
        contribution_mV=np.zeros(len(run.data)),
        peak_mV=peak_mV,
        peak_psi=peak_mV / abs(run.scene.sensitivity[run.judge.problem.sensors[i]]),
        **told,
    )
