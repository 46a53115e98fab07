"""Processor time and memory of whole traces on one core, left-out errors included, of each kind of calibration.

    python -m benchmarks.bench_trace [attitude] [tables] [whole_plots]

The physical limit is the processor: nothing else that is known of does the same.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import csv
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time


def attitude():
    from proving.truth.attitude import D1, simulate
    from proving.truth.attitude_hidden import CLEAN, sized, together
    from rig.procedures.attitude.trace import trace  # memory is that of one kind: nothing of another is loaded

    plan = D1(180, 37, 13)
    two = together([sized("pads", 2, plan), sized("cube", 2, plan)])
    for label, bench in (("nothing to add", CLEAN), ("two effects", two)):
        data, _ = simulate(bench, plan, 0)
        begin = process_time()
        trace(data)
        print(f"{len(data)} points, three sensors, {label}: {process_time() - begin:.2f} s of processor time")
    print(f"largest memory of the process {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


def tables():
    """`rig trace` of large tables as a process of its own: seconds of processor time, start and reading included."""
    from proving.truth.table import MISSING, Lab, options, simulate

    thousands = Lab(4800, 4, clock=True)
    laboratories = {
        "4,800 nothing": (thousands, ""),
        "4,800 drift": (thousands, "drift"),
        "4,800 lag": (thousands, "lag"),
        "4,800 wave, no times": (replace(thousands, clock=False), "wave"),
        "4,800 kink": (thousands, "kink"),
        "4,800 drift beside a walk": (replace(thousands, walk=3.0), "drift"),
        "4,800 drift, walk, growing scatter, outliers": (
            replace(thousands, walk=3.0, growing=4.0, outliers=0.02),
            "drift",
        ),
        "2,400 six groups, two directions, drift": (Lab(2400, 3, groups=6, clock=True, sides=True), "drift"),
        "2,400 oscillation beside a walk": (Lab(2400, 3, clock=True, walk=2.0), "oscillation"),
        "1,300 drift, growing scatter, outliers": (Lab(1300, 5, clock=True, growing=5.0, outliers=0.05), "drift"),
        "1,300 forty whole plots, drift": (Lab(1300, 4, clock=True, plots=40), "drift"),
        "1,300 lag beside a walk, outliers": (Lab(1300, 4, clock=True, walk=2.0, outliers=0.03), "lag"),
    }
    with TemporaryDirectory() as folder:
        for number, (name, (lab, effect)) in enumerate(laboratories.items()):
            columns = simulate(lab, 7, MISSING[effect].at(1.0) if effect else None)
            table = Path(folder) / f"{number}.csv"
            with table.open("w", newline="") as file:
                csv.writer(file).writerows([list(columns), *zip(*(columns[c] for c in columns), strict=True)])
            said = [w for k, v in options(lab).items() for one in (v if isinstance(v, tuple) else (v,))
                    for w in (f"--{k.replace('_', '-')}", one)]  # fmt: skip
            begin = os.times()
            command = [sys.executable, "-m", "rig", "trace", table, "--json", *said]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            end = os.times()
            seconds = end.children_user + end.children_system - begin.children_user - begin.children_system
            print(f"{name:46s} {seconds:5.1f} s", flush=True)


def seven_transducers():
    """Of different offsets and sensitivities."""
    from proving.truth.whole_plot import Transducer

    return tuple(Transducer(offset=0.1 * k, sensitivity=1.9 + 0.03 * k) for k in range(7))


def whole_plots():
    """220 readings; the least of three."""
    from proving.truth.whole_plot import CUBIC, GROWING, Bench, Run, Transducer, simulate
    from rig.procedures.pressure.trace import trace_whole_plots

    seven = seven_transducers()
    for label, bench in (
        ("one, nothing to add", Bench()),
        ("one, cubic", Bench((Transducer(cubic=CUBIC),), GROWING)),
        ("seven, nothing to add", Bench(seven)),
        ("seven, cubic", Bench(tuple(replace(t, cubic=CUBIC) for t in seven), GROWING)),
    ):
        data = simulate(bench, Run(), 1)
        times = []
        for _ in range(3):
            begin = process_time()
            trace_whole_plots(data)
            times.append(process_time() - begin)
        print(f"{label:24s} {min(times):6.2f} s")


if __name__ == "__main__":
    for name in sys.argv[1:] or ["attitude", "tables", "whole_plots"]:
        {"attitude": attitude, "tables": tables, "whole_plots": whole_plots}[name]()
