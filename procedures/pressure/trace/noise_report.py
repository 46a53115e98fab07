"""Findings about noise of a whole-plot run: growing scatter, autocorrelated errors, outliers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter.arrays import IntArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, COMMON_ERROR, OUTLIERS
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.chance import ALPHA, COUNTED
from rig.procedures.pressure.effects import GROWING_NOISE
from rig.procedures.pressure.trace.common import common_error
from rig.procedures.pressure.trace.estimate import estimated
from rig.procedures.pressure.trace.posed import white_of
from rig.procedures.pressure.trace.reasons import Run
from rig.procedures.pressure.trace.result import FoundPressureEffect

FROM_MIDDLE = "readings scatter more the further the pressure is from the middle of its range"
STANDS_OUT_HERE = 0.05
"""Probability below which a left-out reading is named as an outlier of a transducer."""


def noise_findings(run: Run, i: int) -> list[FoundPressureEffect]:
    """Findings of stratum "noise" about transducer `i`."""
    found = (_growing(run, i), _remembered(run, i), _common(run, i), _outliers(run, i))
    return [finding for finding in found if finding is not None]


def _growing(run: Run, i: int) -> FoundPressureEffect | None:
    """Coefficients of sd = a + b P."""
    look = run.settled.look
    if not look.grows[i]:
        return None
    noise, p = look.noise[i], run.whole.pressure_psia
    middle = noise.middle
    low, high = noise.sd(np.array([p.min() if middle is None else middle, p.max()])).tolist()
    df = float(np.sum(look.problem.left_within((), i)[1]))
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
        p=noise.p,
        separate_by=GROWING_NOISE.separate_by,
        against=GROWING_NOISE.against,
        peak_mV=high,
    )
    half = tuple(t_limit(0.95, df) * error for error in noise.stderr)
    return replace(found, stderr=noise.stderr, df=(df, df), half_width_95=half)


def _remembered(run: Run, i: int) -> FoundPressureEffect | None:
    """Correlation of successive readings, if it is significant."""
    memory = run.settled.memory[i]
    if memory.p * len(run.every.sensors) / COUNTED > ALPHA:
        return None
    return _of_noise(
        run,
        i,
        effect=AUTOCORRELATION,
        cause="what a reading is off by stays with the next ones: something wanders within whole plots that was "
        "not recorded",
        terms=("correlation with the reading before",),
        coefficients=(memory.rho,),
        unit="1",
        size=f"successive readings' errors correlate by {memory.rho:.2f}; effects were judged beside that",
        p=memory.p,
        separate_by="read one pressure for an hour, and record what may wander (temperatures, supply)",
        against="since_s",
        peak_mV=float(run.after.fits[i].sigma_subplot),
    )


def _common(run: Run, i: int) -> FoundPressureEffect | None:
    """Errors of whole plots that are those of another transducer too, if they are significant."""
    judge, chosen = run.judge, run.after.chosen
    found = common_error(judge.problem, judge.white(chosen).view("whole-plot", chosen), i)
    if found is None or found.p * len(run.every.sensors) / COUNTED > ALPHA:
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
        p=found.p,
        separate_by="record what acts on all transducers (ambient pressure, supply, gradients, the reference's "
        "temperature), and repeat a whole plot after another history",
        against="elapsed_s",
        peak_mV=sd,
    )


def _outliers(run: Run, i: int) -> FoundPressureEffect | None:
    """Outliers, and their influence on the fit."""
    aside = run.settled.look.aside
    own = np.flatnonzero(aside.p[i] < STANDS_OUT_HERE)
    if not own.size:
        return None
    own = own[np.argsort(-np.abs(aside.sd[i][own]))]
    rows, sd = aside.rows[own], np.abs(aside.sd[i][own])
    off = tuple(aside.off_mV[i][own].tolist())
    return _of_noise(
        run,
        i,
        effect=OUTLIERS,
        cause="readings that no scatter of the others explains; they are left out of the search and of the fit",
        terms=tuple(f"order {run.whole.order[r]} at {run.whole.pressure_psia[r]:.3g} psia" for r in rows),
        coefficients=off,
        unit="mV",
        size=f"{own.size} of {len(run.whole)} readings, up to {sd.max():.3g} sd; with them the fit moves by up to "
        f"{_moved(run, rows, i):.2g} of its standard errors",
        p=float(aside.p[i][own].max()) * COUNTED / len(run.every.sensors),
        separate_by="look in the log at these readings, and repeat them",
        against="elapsed_s",
        peak_mV=float(np.max(np.abs(off))),
    )


def _moved(run: Run, rows: IntArray, i: int) -> float:
    """Changes of the declared model's coefficients by `rows` of the whole run, in their standard errors."""
    others = np.setdiff1d(run.settled.look.aside.rows, rows)
    with_them = run.every.take(np.setdiff1d(np.arange(len(run.whole)), others))
    judge, chosen = run.judge, run.after.chosen
    found = white_of(with_them, judge.likeliest(chosen)).coefficients(chosen)
    one, other = (e.fits[i] for e in (run.after, estimated(with_them, found)))
    return float(np.max(np.abs(one.coefficients - other.coefficients) / one.stderr))


def _of_noise(run: Run, i: int, *, p: float, peak_mV: float, **told: Any) -> FoundPressureEffect:
    unknown = (float("nan"),) * len(told["coefficients"])
    return FoundPressureEffect.of_noise(
        p=min(p * len(run.every.sensors) / COUNTED, 1.0),
        df=unknown,
        half_width_95=unknown,
        contribution_mV=np.zeros(len(run.whole)),
        peak_mV=peak_mV,
        peak_psi=peak_mV / abs(run.scene.sensitivity[run.every.sensors[i]]),
        **told,
    )
