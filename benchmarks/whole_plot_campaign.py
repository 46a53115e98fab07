"""Figures of the trace on whole-plot runs, over many seeds; each by one command from the project's root.

    python -m benchmarks.whole_plot_campaign clean --seeds 300      anything reported where nothing is, one transducer
    python -m benchmarks.whole_plot_campaign clean7 --seeds 100     the same with seven
    python -m benchmarks.whole_plot_campaign singles --seeds 40 --within 0.5 --between 1.3    every effect alone
    python -m benchmarks.whole_plot_campaign pairs --seeds 100      two at once; triples: three
    python -m benchmarks.whole_plot_campaign power --seeds 200      found, by size, beside a test told what to look for
    python -m benchmarks.whole_plot_campaign cubic --seeds 20       the undeclared cubic of the paper's transducers
    python -m benchmarks.whole_plot_campaign spoilt --seeds 100     a cubic beside outliers, remembered errors
    python -m benchmarks.whole_plot_campaign speed                  time of a trace, 220 readings

The bench is proving/truth/whole_plot.py, what is hidden in it proving/truth/whole_plot_hidden.py; neither shares
code with the fitter. Sizes are root mean squares of what the declared model cannot take up, over the error of
the effect's stratum.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from scipy.special import nctdtr, stdtrit

from fitter.split_plot import SplitPlotDesign
from procedures.pressure.fit import named_formula
from procedures.pressure.trace import trace_whole_plots
from proving.truth.whole_plot import CUBIC, GROWING, Bench, Run, Transducer, simulate
from proving.truth.whole_plot_hidden import HIDDEN, Hiding, hide

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


def found(bench: Bench, run: Run, seed: int, model: str = "full") -> set[tuple[str, str]]:
    """Transducer and effect, for everything reported but the noise."""
    sensors = trace_whole_plots(simulate(bench, run, seed), model, validate=False).sensors
    return {(s, e.effect) for s, t in sensors.items() for e in t.effects if e.stratum != "noise"}


def clean(asked: argparse.Namespace) -> None:
    """How often anything is reported where nothing is missing."""
    _clean(CLEAN, asked.seeds, asked.only)


def clean7(asked: argparse.Namespace) -> None:
    """The same on any of seven transducers, and on seven that share an error of the pressure."""
    cases = {name: (replace(CLEAN[name][0], transducers=SEVEN), CLEAN[name][1]) for name in CLEAN_7}
    _clean({**cases, "seven that share an error": (Bench(SEVEN, shared_sd=2e-3), Run())}, asked.seeds, asked.only)


def _clean(cases: Mapping[str, tuple[Bench, Run]], seeds: range, only: str) -> None:
    everything = 0
    for name, (bench, run) in cases.items():
        if only in name:
            reported = [found(bench, run, seed) for seed in seeds]
            which = Counter(effect for one in reported for effect in {effect for _, effect in one})
            everything += sum(map(bool, reported))
            print(f"{name:34s} {sum(map(bool, reported)):4d} of {len(seeds)}   {dict(which)}", flush=True)
    print(f"{'all':34s} {everything:4d} of {sum(only in name for name in cases) * len(seeds)}")


@dataclass(frozen=True)
class Outcome:
    """Of one run with something hidden in it.

    Attributes:
        named: of each effect, whether it is found, or among the aliases of what is.
        leads: whether it is found by its own name.
        more: whether more effects are reported than hidden.
        ratio: noise-free prediction error, over that of a fit told the truth.
        effects: reported.

    """

    named: tuple[bool, ...]
    leads: tuple[bool, ...]
    more: bool
    ratio: float
    effects: tuple[str, ...]


def outcome(names: Sequence[str], sizes: Sequence[float], seed: int, transducers: int) -> Outcome:
    """Hide some effects and trace them."""
    hidden = hide(names, sizes, seed, transducers)
    trace = trace_whole_plots(hidden.data, hidden.model, validate=False)
    every = [e for t in trace.sensors.values() for e in t.effects if e.stratum != "noise"]
    wanted = [HIDDEN[name].expected for name in names]
    reported = tuple(sorted({e.effect for e in every}))
    ratio = _error(trace.predict(hidden.data), hidden) / _error(_told(hidden), hidden)
    return Outcome(
        named=tuple(any(name in (e.effect, *e.aliases) for e in every) for name in wanted),
        leads=tuple(name in reported for name in wanted),
        more=len(reported) > len(set(wanted)),
        ratio=ratio,
        effects=reported,
    )


def _told(hidden: Hiding) -> dict[str, np.ndarray]:
    """Outputs predicted by the declared model and the true columns of what is hidden."""
    names, declared = named_formula(hidden.model).columns(hidden.data.table)
    predicted = {}
    for sensor, y in hidden.data.outputs.items():
        own = [added[sensor] for added in hidden.columns if np.ptp(added[sensor]) > 0]
        columns = np.column_stack([declared, *own])
        design = SplitPlotDesign(columns, hidden.data.whole_plot, (*names, *map(str, range(len(own)))))
        predicted[sensor] = columns @ design.fit(y).coefficients
    return predicted


def _error(predicted: Mapping[str, np.ndarray], hidden: Hiding) -> float:
    return float(np.sqrt(np.mean([(predicted[s] - truth) ** 2 for s, truth in hidden.truth.items()])))


def singles(asked: argparse.Namespace) -> None:
    """Each effect alone."""
    every: list[Outcome] = []
    for k, (name, one) in enumerate(HIDDEN.items()):
        if asked.only not in name:
            continue
        size = asked.between if one.between else asked.within
        runs = [outcome([name], [size], 1000 * k + seed, asked.transducers) for seed in asked.seeds]
        _print(f"{name} at {size:g}", runs)
        every += runs
    _print("all", every)


def pairs(asked: argparse.Namespace) -> None:
    """Two effects of different names at once."""
    _together(asked, 2)


def triples(asked: argparse.Namespace) -> None:
    """Three effects of different names at once."""
    _together(asked, 3)


def _together(asked: argparse.Namespace, count: int) -> None:
    runs = []
    for seed in asked.seeds:
        rng = np.random.default_rng([count, seed])
        while True:
            names = rng.choice(list(HIDDEN), count, replace=False).tolist()
            if len({HIDDEN[name].expected for name in names}) == count:
                break
        sizes = [asked.between if HIDDEN[name].between else asked.within for name in names]
        runs.append(outcome(names, sizes, seed, asked.transducers))
        if not all(runs[-1].named) or runs[-1].more:
            print(f"  {', '.join(names)}: {', '.join(runs[-1].effects) or 'nothing'}", flush=True)
    _print(f"{count} at once", runs)


def _print(label: str, runs: Sequence[Outcome]) -> None:
    median, most = np.quantile([run.ratio for run in runs], [0.5, 0.95])
    missed = Counter(run.effects for run in runs if not all(run.named)).most_common(2) if label != "all" else ""
    named, leads = sum(all(run.named) for run in runs), sum(all(run.leads) for run in runs)
    more = sum(run.more for run in runs)
    print(
        f"{label:36s} named {named:4d}, by its own name {leads:4d}, more {more:3d} of {len(runs)}; "
        f"error ratio {median:.2f}, 95 % {most:.2f}   {missed}",
        flush=True,
    )


def power(asked: argparse.Namespace) -> None:
    """Named, by size, beside the power of a 5 % t test of the true column alone."""
    for names, df, m, sizes in (
        (("sensor cubed", "drift of whole plots"), 13, 20, (0.9, 1.1, 1.3, 1.4, 1.5)),
        (("cubic", "hysteresis", "gain drifts"), 194, 220, (0.25, 0.35, 0.4, 0.45)),
    ):
        for size in sizes:
            limit = float(stdtrit(df, 0.975))
            told = 1.0 - float(nctdtr(df, size * m**0.5, limit))
            rates = {
                name: sum(outcome([name], [size], seed, asked.transducers).named[0] for seed in asked.seeds)
                for name in names
            }
            print(f"{size:5.2f} sd: a told test {told:6.1%}; named of {len(asked.seeds)}: {rates}", flush=True)


def cubic(asked: argparse.Namespace) -> None:
    """The paper's transducers: sd 0.4 + 0.3 P and an undeclared cubic, one of them and seven."""
    one = (Transducer(cubic=CUBIC),)
    for bench in (Bench(one, GROWING), Bench(tuple(replace(t, cubic=CUBIC) for t in SEVEN), GROWING)):
        named = besides = 0
        for seed in asked.seeds:
            effects = found(bench, Run(), seed)
            named += {s for s, e in effects if e == "pressure-third-order"} == {
                f"bridge_{k + 1}_mV" for k in range(len(bench.transducers))
            }
            besides += any(e != "pressure-third-order" for _, e in effects)
        count = len(asked.seeds)
        print(f"{len(bench.transducers)} transducers: cubic named on all {named} of {count}, besides {besides}")


def spoilt(asked: argparse.Namespace) -> None:
    """A cubic of 1e-3 mV/psi^3 beside readings that stand out and errors that are remembered."""
    for label, bench in (
        ("4 readings off by 8 sd", Bench(outliers=4, outliers_sd=8.0)),
        ("4 readings off by 50 sd", Bench(outliers=4, outliers_sd=50.0)),
        ("errors remembered by 0.5", Bench(remembered=0.5)),
        ("one whole plot off by 13 sd", Bench(apart_mV=0.2)),
    ):
        named = besides = pointed = 0
        for seed in asked.seeds:
            run = simulate(replace(bench, transducers=(Transducer(cubic=1e-3),)), Run(), seed)
            effects = trace_whole_plots(run, validate=False).sensors["bridge_1_mV"].effects
            means = {e.effect for e in effects if e.stratum != "noise"}
            named += "pressure-third-order" in means
            besides += bool(means - {"pressure-third-order"})
            pointed += any(
                e.effect in ("autocorrelation", "outlying-whole-plot") or len(e.terms) == 4
                for e in effects
                if e.stratum == "noise"
            )
        print(f"{label:30s} cubic {named}, besides {besides}, said of the noise {pointed} of {len(asked.seeds)}")


def speed(asked: argparse.Namespace) -> None:
    """Processor time of one trace on one thread; other work on the machine does not count."""
    for label, bench in (
        ("one, nothing to add", Bench()),
        ("one, cubic", Bench((Transducer(cubic=CUBIC),), GROWING)),
        ("seven, nothing to add", Bench(SEVEN)),
        ("seven, cubic", Bench(tuple(replace(t, cubic=CUBIC) for t in SEVEN), GROWING)),
    ):
        data = simulate(bench, Run(), asked.seeds[0])
        times = []
        for _ in range(3):
            begin = process_time()
            trace_whole_plots(data)
            times.append(process_time() - begin)
        print(f"{label:24s} {min(times):6.2f} s")


CAMPAIGNS: Mapping[str, Callable[[argparse.Namespace], None]] = {
    campaign.__name__: campaign for campaign in (clean, clean7, singles, pairs, triples, power, cubic, spoilt, speed)
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=CAMPAIGNS)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--within", type=float, default=0.5, help="size of effects within whole plots")
    parser.add_argument("--between", type=float, default=1.3, help="size of effects between whole plots")
    parser.add_argument("--transducers", type=int, default=3)
    parser.add_argument("--only", default="", help="part of a name")
    asked = parser.parse_args()
    asked.seeds = range(asked.first, asked.first + asked.seeds)
    CAMPAIGNS[asked.what](asked)


if __name__ == "__main__":
    main()
