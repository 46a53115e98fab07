"""Processor time and memory of whole traces on one core, left-out errors included, of each kind of calibration.

    python -m benchmarks.bench_trace [attitude] [tables] [whole_plots]

The physical limit is the processor: nothing else that is known of does the same.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import resource
import sys
from dataclasses import replace
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
    """1,000 rows of six columns."""
    from proving.truth.table import MISSING, Lab, options, simulate
    from rig.procedures.general.column_roles import Roles, roles_of
    from rig.procedures.general.trace import trace_general
    from rig.procedures.tables.table import Table

    lab = Lab(1000, 4, clock=True)
    for name, effect in (("nothing missing", None), ("temperature", MISSING["temperature"].at(1.0))):
        columns = simulate(lab, 1, effect)
        begin = process_time()
        data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**options(lab)))
        verdict = trace_general(data).verdict
        print(f"{name}: {verdict}, {process_time() - begin:.1f} s", flush=True)


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
