"""The trace on whole-plot runs.

The bench is proving/truth/whole_plot.py, what is hidden in it proving/truth/whole_plot_hidden.py. Sizes are root mean
squares of what the declared model cannot take up, over the error of the effect's stratum.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.statistics.told import free_of, powers
from proving.truth.whole_plot import CUBIC, GROWING, Bench, Run, Transducer, simulate
from proving.truth.whole_plot_hidden import HIDDEN, Hiding, hide
from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot import SplitPlotDesign
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.trace import trace_whole_plots

SEVEN = tuple(Transducer(offset=0.1 * k, sensitivity=1.9 + 0.03 * k) for k in range(7))
CLEAN = {
    "random orders": (Bench(), Run()),
    "fixed orders": (Bench(), Run(plots="fixed", pressures="fixed")),
    "temperatures, pressures ascending": (Bench(), Run(plots="ascending", pressures="ascending")),
    "temperatures ascending": (Bench(), Run(plots="ascending")),
    "pressures up and down": (Bench(), Run(pressures="up and down")),
    "four whole plots broken": (Bench(), Run(broken={2: 5, 5: 1, 9: 8, 14: 1})),
    "interrupted": (Bench(), Run(interrupted=True)),
    "sd grows with pressure": (Bench(subplot=GROWING), Run()),
    "no whole-plot error": (Bench(whole_plot=0.0), Run()),
    "long tails": (Bench(long_tails=True), Run()),
    "three readings off by 30 sd": (Bench(outliers=3, outliers_sd=30.0), Run()),
    "one whole plot off by 13 sd": (Bench(apart_mV=0.2), Run()),
    "errors remembered by 0.5": (Bench(remembered=0.5), Run()),
    "by 0.8, pressures ascending": (Bench(remembered=0.8), Run(pressures="ascending")),
    "whole plots' errors remembered by 0.5": (Bench(wanders=0.5), Run()),
    "by 0.7": (Bench(wanders=0.7), Run()),
    "temperatures 5 % unsettled": (Bench(), Run(unsettled=0.05)),
    "sensitivity drawn again, 0.1 %": (Bench(sensitivity_sd=1e-3), Run()),
}
CLEAN_7 = (
    "random orders",
    "fixed orders",
    "temperatures, pressures ascending",
    "four whole plots broken",
    "interrupted",
    "sd grows with pressure",
    "three readings off by 30 sd",
    "errors remembered by 0.5",
)


WITH_SEVEN = {
    **{name: (replace(CLEAN[name][0], transducers=SEVEN), CLEAN[name][1]) for name in CLEAN_7},
    "seven that share an error": (Bench(SEVEN, shared_sd=2e-3), Run()),
}
ONE = (Transducer(cubic=CUBIC),)
PAPERS = {"1 transducer": Bench(ONE, GROWING), "7": Bench(tuple(replace(t, cubic=CUBIC) for t in SEVEN), GROWING)}
SPOILT = {
    "4 readings off by 8 sd": Bench(outliers=4, outliers_sd=8.0),
    "4 readings off by 50 sd": Bench(outliers=4, outliers_sd=50.0),
    "errors remembered by 0.5": Bench(remembered=0.5),
    "one whole plot off by 13 sd": Bench(apart_mV=0.2),
}
ALIKE = (0.0, 0.25, 0.5, 0.7)
"""Correlations of neighbouring whole plots."""


def clean() -> Study:
    """How often anything is reported where nothing is missing, one transducer."""
    return Study({name: partial(_clean, case=name) for name in CLEAN}, _reported, pooled(_reported), block=2)


def clean7() -> Study:
    """The same on any of seven transducers, and on seven that share an error of the pressure."""
    return Study({name: partial(_clean7, case=name) for name in WITH_SEVEN}, _reported, pooled(_reported))


def _clean(seed: int, case: str) -> Result:
    return {"effects": sorted({effect for _, effect in _found(*CLEAN[case], seed)})}


def _clean7(seed: int, case: str) -> Result:
    return {"effects": sorted({effect for _, effect in _found(*WITH_SEVEN[case], seed)})}


def _found(bench: Bench, run: Run, seed: int) -> set[tuple[str, str]]:
    """Transducer and effect, for everything reported but the noise."""
    sensors = trace_whole_plots(simulate(bench, run, seed), "full", validate=False).sensors
    return {(s, e.effect) for s, t in sensors.items() for e in t.effects if e.stratum != "noise"}


def _reported(results: Results) -> Figures:
    which = Counter(effect for one in results for effect in one["effects"])
    return {"reported": sum(bool(one["effects"]) for one in results), "of": len(results), "effects": dict(which)}


def singles(within: float = 0.5, between: float = 1.3, transducers: int = 3) -> Study:
    """Each effect alone; sizes of effects within whole plots and between them."""
    cases = {}
    for k, (name, one) in enumerate(HIDDEN.items()):
        size = between if one.between else within
        cases[f"{name} at {size:g}"] = partial(_single, name=name, size=size, first=1000 * k, transducers=transducers)
    return Study(cases, _counted, pooled(_counted))


def _single(seed: int, name: str, size: float, first: int, transducers: int) -> Result:
    return _outcome([name], [size], first + seed, transducers)


def pairs(within: float = 0.5, between: float = 1.3, transducers: int = 3) -> Study:
    """Two effects of different names at once."""
    return _together(2, within, between, transducers)


def triples(within: float = 0.5, between: float = 1.3, transducers: int = 3) -> Study:
    """Three effects of different names at once."""
    return _together(3, within, between, transducers)


def _together(count: int, within: float, between: float, transducers: int) -> Study:
    several = partial(_several, count=count, within=within, between=between, transducers=transducers)
    return Study({f"{count} at once": several}, _counted)


def _several(seed: int, count: int, within: float, between: float, transducers: int) -> Result:
    rng = np.random.default_rng([count, seed])
    while True:
        names = rng.choice(list(HIDDEN), count, replace=False).tolist()
        if len({HIDDEN[name].expected for name in names}) == count:
            break
    return _outcome(names, [between if HIDDEN[name].between else within for name in names], seed, transducers)


def _outcome(names: Sequence[str], sizes: Sequence[float], seed: int, transducers: int) -> Result:
    """Hide some effects and trace them.

    Found by their names or among the aliases of what is; by their own names; more effects than hidden; names that are
    neither, without a doubt; whether something is said at all, an unnamed remainder too; noise-free prediction error
    over that of a fit told the truth.
    """
    hidden = hide(names, sizes, seed, transducers)
    trace = trace_whole_plots(hidden.data, hidden.model, validate=False)
    every = [e for t in trace.sensors.values() for e in t.effects if e.stratum != "noise"]
    wanted = [HIDDEN[name].expected for name in names]
    reported = sorted({e.effect for e in every})
    return {
        "hidden": list(names),
        "named": all(any(name in (e.effect, *e.aliases) for e in every) for name in wanted),
        "leads": all(name in reported for name in wanted),
        "more": len(reported) > len(set(wanted)),
        "wrong": sorted({e.effect for e in every if e.doubtful is None and not {e.effect, *e.aliases} & set(wanted)}),
        "said": bool(every) or any(t.unnamed for t in trace.sensors.values()),
        "ratio": _error(trace.predict(hidden.data), hidden) / _error(_told(hidden), hidden),
        "effects": reported,
    }


def _counted(results: Results) -> Figures:
    median, most = np.quantile([one["ratio"] for one in results], [0.5, 0.95])
    wrong = [one for one in results if not one["named"] or one["more"]]
    return {
        "named": sum(one["named"] for one in results),
        "by its own name": sum(one["leads"] for one in results),
        "more": sum(one["more"] for one in results),
        "a wrong name without a doubt": sum(bool(one["wrong"]) for one in results),
        "silent": sum(not one["said"] for one in results),
        "of": len(results),
        "error ratio": float(median),
        "95 %": float(most),
        "otherwise": [f"{', '.join(one['hidden'])} as {', '.join(one['effects']) or 'nothing'}" for one in wrong],
    }


def _told(hidden: Hiding) -> dict[str, FloatArray]:
    """Outputs predicted by the declared model and the true columns of what is hidden."""
    names, declared = named_formula(hidden.model).columns(hidden.data.table)
    predicted = {}
    for sensor, y in hidden.data.outputs.items():
        own = [added[sensor] for added in hidden.columns if np.ptp(added[sensor]) > 0]
        columns = np.column_stack([declared, *own])
        design = SplitPlotDesign(columns, hidden.data.whole_plot, (*names, *map(str, range(len(own)))))
        predicted[sensor] = columns @ design.fit(y).coefficients
    return predicted


def _error(predicted: Mapping[str, FloatArray], hidden: Hiding) -> float:
    return float(np.sqrt(np.mean([(predicted[s] - truth) ** 2 for s, truth in hidden.truth.items()])))


def told(size: float = 1.3, tests: int = 36) -> Study:
    """Power of a test told the true column, for each effect between whole plots.

    It compares the likelihoods of one transducer's twenty means with the column and without it, each at the likeliest
    correlation of neighbours, at 5 % shared by the `tests` of a search that is not told. It holds this level for
    independent whole plots alone, or also where neighbours correlate by 0.5 or 0.7. The true errors are independent.
    """
    between = [name for name, one in HIDDEN.items() if one.between]
    return Study(
        {name: partial(_told_power, name=name, size=size, level=0.05 / tests) for name in between},
        _powers,
        pooled(_powers),
    )


def _told_power(seed: int, name: str, size: float, level: float) -> Result:
    hidden, rng = hide([name], [size], seed, 1), np.random.default_rng([36, seed])
    plots = np.arange(int(hidden.data.whole_plot.max()) + 1)
    mean = (plots[:, None] == hidden.data.whole_plot).astype(np.float64)
    mean /= mean.sum(axis=1, keepdims=True)
    declared = mean @ named_formula(hidden.model).columns(hidden.data.table)[1]
    free = free_of(declared)
    column = free @ mean @ next(iter(hidden.columns[0].values()))
    column *= size * plots.size**0.5 / np.linalg.norm(column)
    roots = [np.linalg.cholesky(free @ rho ** abs(np.subtract.outer(plots, plots)) @ free.T) for rho in ALIKE]
    held = {f"{most:g}": ALIKE.index(most) + 1 for most in (0.0, 0.5, 0.7)}
    return {"power": powers(column[:, None], {"": column}, roots, held, level, rng)[""]}


def _powers(results: Results) -> Figures:
    each = [one["power"] for one in results]
    return {f"held to {most}": float(np.mean([power[most] for power in each])) for most in each[0]}


def cubic() -> Study:
    """The paper's transducers: sd 0.4 + 0.3 P and an undeclared cubic, one of them and seven."""
    return Study({name: partial(_cubic, case=name) for name in PAPERS}, _sums)


def _cubic(seed: int, case: str) -> Result:
    bench = PAPERS[case]
    effects = _found(bench, Run(), seed)
    every = {f"bridge_{k + 1}_mV" for k in range(len(bench.transducers))}
    named = {s for s, e in effects if e == "pressure-third-order"} == every
    return {"named on all": named, "besides": any(e != "pressure-third-order" for _, e in effects)}


def spoilt() -> Study:
    """A cubic of 1e-3 mV/psi^3 beside readings that stand out and errors that are remembered."""
    return Study({name: partial(_spoilt, case=name) for name in SPOILT}, _sums)


def _spoilt(seed: int, case: str) -> Result:
    run = simulate(replace(SPOILT[case], transducers=(Transducer(cubic=1e-3),)), Run(), seed)
    effects = trace_whole_plots(run, validate=False).sensors["bridge_1_mV"].effects
    means = {e.effect for e in effects if e.stratum != "noise"}
    pointed = any(
        e.effect in ("autocorrelation", "outlying-whole-plot") or len(e.terms) == 4
        for e in effects
        if e.stratum == "noise"
    )
    cubic = "pressure-third-order"
    return {"cubic named": cubic in means, "besides": bool(means - {cubic}), "said of the noise": pointed}


def _sums(results: Results) -> Figures:
    return {**{name: sum(one[name] for one in results) for name in results[0]}, "of": len(results)}


PARTS = {
    name: Part(study, 20, 1)
    for name, study in {
        "clean": clean,
        "clean7": clean7,
        "singles": singles,
        "pairs": pairs,
        "triples": triples,
        "told": told,
        "cubic": cubic,
        "spoilt": spoilt,
    }.items()
}
