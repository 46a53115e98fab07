"""How often the 95 % interval of an effect that was found holds what was put in.

Effects of one coefficient, hidden at a size at which they are nearly always found: what is chosen for being large is
then no matter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.truth.attitude import D1
from proving.truth.attitude import Bench as Head
from proving.truth.attitude import simulate as simulate_night
from proving.truth.attitude_hidden import CLEAN, HIDDEN, sized
from proving.truth.table import Columns, Lab, options
from proving.truth.table import simulate as simulate_table
from proving.truth.whole_plot import Bench, Run, Transducer
from proving.truth.whole_plot import simulate as simulate_whole_plots
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.engine.judge import TableJudge
from rig.procedures.attitude.evaluate import AttitudeTraced
from rig.procedures.attitude.trace import trace
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.evaluate import GeneralTraced
from rig.procedures.general.trace import trace_general
from rig.procedures.general.trace.estimate import estimate
from rig.procedures.general.trace.run import problem_of
from rig.procedures.pressure.declared import Declared
from rig.procedures.pressure.evaluate import WholePlotTraced
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table

GRID = D1(90, 13, 13)
S = CLEAN.sensors[0].S
NIGHTS = {  # with what the coefficient is for a size of one; hysteresis is hidden larger, as offsets hide it
    "offset, temperature": (1.0, 2.0),
    "offset drift": (1.0, 6.0),
    "sensitivity drift": (S, 2.0),
    "square": (S, 2.0),
    "cube": (S, 2.0),
    "hysteresis, pitch": (1.0, 6.0),
    "hysteresis, roll": (1.0, 2.0),
    "offset step": (1.0, 2.0),
    "creep": (S, 2.0),
    "backlash, pitch": (1.0, 2.0),
    "index shift": (1.0, 2.0),
}
WHOLE_PLOTS = {
    "pressure-third-order": (Transducer(cubic=2e-3), 2e-3),
    "hysteresis": (Transducer(hysteresis=8e-3), 8e-3),
    "sensor-temperature-third-order": (Transducer(offset_warm3=(4e-6, 0.0)), 4e-6),
}
TABLES: dict[str, tuple[Lab, Callable[[Columns], Any]]] = {
    "second-order": (Lab(60), lambda c: c["x"] ** 2),
    "direction": (Lab(60, sides=True), lambda c: c["side"]),
    "temperature": (Lab(120, clock=True), lambda c: c["temp_c"]),
    "temperature, correlated errors": (Lab(120, clock=True, ar=0.7), lambda c: c["temp_c"]),
    "temperature, 12 whole plots": (Lab(60, plots=12), lambda c: c["temp_c"]),
}
FIRST = 2000
"""Added to every seed: runs of their own."""


def nights() -> Study:
    """Nights of 13 x 13 points over +-90 deg; six replications agree, or have offsets of 0.1 or 1 sd of a reading."""
    which = [(offset_sd, name) for offset_sd in (0.0, 0.1, 1.0) for name in NIGHTS]
    return _study({f"offsets of {sd:g} sd: {name}": partial(_night, name=name, offset_sd=sd) for sd, name in which})


def whole_plots() -> Study:
    """Runs in whole plots."""
    return _study({name: partial(_whole_plots, name=name) for name in WHOLE_PLOTS})


def tables() -> Study:
    """Tables, with independent errors and with others."""
    return _study({label: partial(_table, label=label) for label in TABLES})


def told_tables() -> Study:
    """The same tables with the effect told: there is no search, and the interval alone is judged."""
    return _study({label: partial(_told_table, label=label) for label in TABLES})


def _study(cases: dict[str, partial[Result]]) -> Study:
    return Study(cases, _counted, pooled(_counted))


def _counted(results: Results) -> Figures:
    found = [one["held"] for one in results if one["held"] is not None]
    return {"found": len(found), "of": len(results), "held by the interval": sum(found)}


def _holds(effects: Sequence[dict[str, Any]], name: str, truth: float) -> Result:
    """Whether the interval of the effect holds the truth; None where it was not found by that name."""
    for effect in effects:
        if effect["effect"].startswith(name) and len(effect["interval_95"]) == 1:
            low, high = effect["interval_95"][0]
            return {"held": bool(low <= truth <= high)}
    return {"held": None}


def _put_in(bench: Head) -> float:
    """The one number by which a bench differs from a clean one."""
    for f in fields(bench):
        if f.name != "sensors" and getattr(bench, f.name) != getattr(CLEAN, f.name):
            return float(getattr(bench, f.name))
    own, clean = bench.sensors[0], CLEAN.sensors[0]
    return float(next(getattr(own, f.name) for f in fields(own) if getattr(own, f.name) != getattr(clean, f.name)))


@cache
def _bench(name: str) -> tuple[Head, float]:
    """A bench with one effect, and the coefficient that it has."""
    per_unit, rms = NIGHTS[name]
    bench = sized(name, rms, GRID)
    return bench, _put_in(bench) * per_unit


def _night(seed: int, name: str, offset_sd: float) -> Result:
    bench, truth = _bench(name)
    data, _ = simulate_night(replace(bench, offset_sd=offset_sd), GRID, FIRST + seed, **HIDDEN[name].options)
    table = Table("night", {"pitch_deg": data.pitch_deg}, True, {})
    found = AttitudeTraced(table, data, trace(data, validate=False)).to_json()["sensors"]["x_V"]
    return _holds(found["effects"], HIDDEN[name].effect, truth)


def _whole_plots(seed: int, name: str) -> Result:
    transducer, truth = WHOLE_PLOTS[name]
    data = simulate_whole_plots(Bench((transducer,)), Run(), FIRST + seed)
    table = Table("run", {"pressure_psia": data.pressure_psia}, True, {})
    found = trace_whole_plots(data, validate=False)
    traced = WholePlotTraced(table, data, found, {}, Declared.of(table, None, data))
    return _holds(traced.to_json()["sensors"]["bridge_1_mV"]["effects"], name, truth)


def _table(seed: int, label: str) -> Result:
    table, roles, size = _drawn(seed, label)
    data, taken = roles_of(table, roles)
    found = GeneralTraced(table, roles, trace_general(data), taken).to_json()["sensors"]["y"]
    return _holds(found["effects"], _name(label), size)


def _told_table(seed: int, label: str) -> Result:
    table, roles, size = _drawn(seed, label)
    problem = problem_of(roles_of(table, roles)[0])
    own = next(one for one in problem.candidates if one.effect.name.startswith(_name(label)))
    fit = estimate(TableJudge(replace(problem, candidates=(own,))), (0,))
    off = abs(float(fit.coefficients[-1]) - size)
    return {"held": bool(off <= t_limit(0.95, float(fit.dfs[-1])) * float(fit.stderr[-1]))}


def _name(label: str) -> str:
    return label.partition(",")[0]


def _drawn(seed: int, label: str) -> tuple[Table, Roles, float]:
    """A table, what is said of its columns, and the coefficient of what is hidden in it."""
    (lab, column), sizes = TABLES[label], list[float]()

    def effect(c: dict[str, Any], _rng: np.random.Generator) -> Any:
        shape = np.asarray(column(c), float)
        line = np.column_stack([np.ones(len(shape)), c["x"]])
        left = shape - line @ np.linalg.lstsq(line, shape, rcond=None)[0]
        sizes.append(3.0 / np.sqrt(np.mean(left**2)))
        return sizes[0] * shape

    columns = simulate_table(lab, FIRST + seed, effect)
    return Table("table", columns, True, {}), Roles(**options(lab)), sizes[0]


PARTS = {
    "nights": Part(nights),
    "whole-plots": Part(whole_plots),
    "tables": Part(tables),
    "told-tables": Part(told_tables, 400),
}
