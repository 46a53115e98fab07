"""How often the 95 % interval of an effect that was found holds what was put in.

    python -m benchmarks.interval_campaign [seeds]

Effects of one coefficient, hidden at a size at which they are nearly always found: what is chosen for being large is
then no matter. Nights of 13 x 13 points over +-90 deg, six replications, three sensors
(proving/truth/attitude.py), with replications that agree and that have offsets of one reading's standard deviation; runs
in whole plots (proving/truth/whole_plot.py); tables (proving/truth/table.py).
"""

from __future__ import annotations

import os
import sys
from dataclasses import fields, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import numpy as np

from procedures.attitude.evaluate import AttitudeTraced
from procedures.attitude.trace import trace
from procedures.general.column_roles import Roles, roles_of
from procedures.general.evaluate import GeneralTraced
from procedures.general.trace import trace_general
from procedures.pressure.evaluate import Declared, WholePlotTraced
from procedures.pressure.trace import trace_whole_plots
from procedures.table import Table
from proving.truth.attitude import D1
from proving.truth.attitude import simulate as simulate_night
from proving.truth.attitude_hidden import CLEAN, HIDDEN, sized
from proving.truth.table import Lab, options
from proving.truth.table import simulate as simulate_table
from proving.truth.whole_plot import Bench, Run, Transducer
from proving.truth.whole_plot import simulate as simulate_whole_plots

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
TABLES = {
    "second-order": (Lab(60), lambda c: c["x"] ** 2),
    "direction": (Lab(60, sides=True), lambda c: c["side"]),
    "temperature": (Lab(120, clock=True), lambda c: c["temp_c"]),
    "temperature, correlated errors": (Lab(120, clock=True, ar=0.7), lambda c: c["temp_c"]),
    "temperature, 12 whole plots": (Lab(60, plots=12), lambda c: c["temp_c"]),
}


def held(effects, name, truth):
    """Whether the interval of the effect holds the truth; None where it was not found by that name."""
    for effect in effects:
        if effect["effect"].startswith(name) and len(effect["interval_95"]) == 1:
            low, high = effect["interval_95"][0]
            return low <= truth <= high
    return None


def show(label, answers):
    found = [answer for answer in answers if answer is not None]
    print(f"{label:58s} found {len(found):3d} of {len(answers)}, held by the interval {sum(found):3d}", flush=True)
    return found


def put_in(bench):
    """The one number by which a bench differs from a clean one."""
    for f in fields(bench):
        if f.name != "sensors" and getattr(bench, f.name) != getattr(CLEAN, f.name):
            return getattr(bench, f.name)
    own, clean = bench.sensors[0], CLEAN.sensors[0]
    return next(getattr(own, f.name) for f in fields(own) if getattr(own, f.name) != getattr(clean, f.name))


def nights(seeds):
    every = []
    for offset_sd in (0.0, 1.0):
        for name, (per_unit, rms) in NIGHTS.items():
            bench, answers = replace(sized(name, rms, GRID), offset_sd=offset_sd), []
            truth = put_in(replace(bench, offset_sd=CLEAN.offset_sd)) * per_unit
            for seed in range(seeds):
                data, _ = simulate_night(bench, GRID, 2000 + seed, **HIDDEN[name].options)
                table = Table("night", {"pitch_deg": data.pitch_deg}, True, {})
                found = AttitudeTraced(table, data, trace(data, validate=False)).to_json()["sensors"]["x_V"]
                answers.append(held(found["effects"], HIDDEN[name].effect, truth))
            every += show(f"night, offsets of {offset_sd:g} sd: {name}", answers)
    return every


def whole_plots(seeds):
    every = []
    for name, (transducer, truth) in WHOLE_PLOTS.items():
        answers = []
        for seed in range(seeds):
            data = simulate_whole_plots(Bench((transducer,)), Run(), 2000 + seed)
            table = Table("run", {"pressure_psia": data.pressure_psia}, True, {})
            found = WholePlotTraced(table, data, trace_whole_plots(data), {}, Declared.of(table, None)).to_json()[
                "sensors"
            ]["bridge_1_mV"]
            answers.append(held(found["effects"], name, truth))
        every += show(f"whole plots: {name}", answers)
    return every


def tables(seeds):
    every = []
    for label, (lab, column) in TABLES.items():
        answers = []
        for seed in range(seeds):
            sizes = []

            def effect(c, _rng, column=column, sizes=sizes):
                shape = np.asarray(column(c), float)
                line = np.column_stack([np.ones(len(shape)), c["x"]])
                left = shape - line @ np.linalg.lstsq(line, shape, rcond=None)[0]
                sizes.append(3.0 / np.sqrt(np.mean(left**2)))
                return sizes[0] * shape

            c, roles = simulate_table(lab, 2000 + seed, effect), Roles(**options(lab))
            table = Table("table", c, True, {})
            data, taken = roles_of(table, roles)
            found = GeneralTraced(table, roles, trace_general(data), taken).to_json()["sensors"]["y"]
            answers.append(held(found["effects"], label.partition(",")[0], sizes[0]))
        every += show(f"table: {label}", answers)
    return every


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for part in (nights, whole_plots, tables):
        every = part(seeds)
        print(f"{part.__name__}: {sum(every)} of {len(every)} intervals hold what was put in\n", flush=True)


if __name__ == "__main__":
    main()
