"""Runs of a few points on the ideal benches: hundredths of a second each."""

from __future__ import annotations

import itertools

import ideal_pressure_bench as pressure
from ideal_bench import PROCEDURE, new_run, run_session

from rig.engine.session import Outcome
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.run_file.read.reader import RunReader

MOST_MV = 0.02
MOST_NEWS = 2000
POINTS = 4
FIRST_LEGS = [{"pitch": -32.0, "roll": -2.0}, {"pitch": -30.0, "roll": 0.0}]
LEGS = [*FIRST_LEGS, {"roll": 90.0}, {"roll": 92.0}, {"pitch": 30.0, "roll": 90.0}, {"roll": 0.0}]
PARKED = {"pitch": 0.0}
"""At the end of these four points; roll stands there already."""


def attitude(**more):
    """Four points: pitch -30, -30, 30, 30 deg and roll 0, 90, 90, 0 deg."""
    design = {"type": "D", "pitch_deg": [-30, 30], "roll_deg": [0, 90]}
    usual = {"replications": 1, "design": design, "recovery": {"hold_max_s": 3.0}}
    values = PROCEDURE.model_dump(exclude_unset=True) | usual | more
    return PitchRollProcedure.model_validate(values)


def whole_plot(temperatures=((-60, 0),), pressures=(1.0, 2.5), **more):
    """Whole plots of few pressures, at which two readings are to scatter by no more than 0.02 mV."""
    design = {
        "type": "list",
        "temperatures_degC": list(temperatures),
        "pressures_psia": list(pressures),
        "repeated_psia": [],
    }
    measure = {"readings": 2, "max_sd_mV": MOST_MV, "repeats": 0}
    values = pressure.PROCEDURE.model_dump(exclude_unset=True) | {"design": design, "measure": measure} | more
    return WholePlotProcedure.model_validate(values)


class Killed(BaseException):
    """Stands for SIGKILL."""


def kill_where(condition):
    def on_progress(news):
        if condition(news):
            raise Killed

    return on_progress


def records(path, kind=None, status=None):
    with RunReader.open(path) as reader:
        reader.verify()
        return [r for r in reader.records() if kind in (None, r.kind) and status in (None, r.status)]


def accepted(path):
    return records(path, "observation", "accepted")


def run(folder, procedure=None, **options):
    """A complete run; its file and its head."""
    procedure = procedure or attitude()
    path = new_run(folder, procedure)
    outcome, _, head, message = run_session(path, procedure=procedure, **options)
    assert outcome is Outcome.COMPLETE, message
    assert [r.run_index for r in accepted(path)] == list(range(len(procedure.expand().points)))
    return path, head


def session_of_whole_plots(path, procedure, bench, on_progress=lambda _: None):
    """One session, its outcome and message; an error if it goes on for ever."""
    count = itertools.count()

    def on_bounded_progress(news):
        assert next(count) < MOST_NEWS, "there is no end to it"
        on_progress(news)

    outcome, _, message = pressure.run_session(path, bench, procedure=procedure, on_progress=on_bounded_progress)
    return outcome, message


def run_whole_plots(folder, procedure, bench, **options):
    """A complete run, its meter's last digit never the same twice."""
    fetch, path = bench.dvm.fetch, pressure.new_run(folder, procedure)
    bench.dvm.fetch = lambda: {n: [r + 1e-12 * bench.dvm.starts for r in rs] for n, rs in fetch().items()}
    outcome, message = session_of_whole_plots(path, procedure, bench, **options)
    assert outcome is Outcome.COMPLETE, message
    return path
