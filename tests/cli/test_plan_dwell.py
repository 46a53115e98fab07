"""`rig plan` says where a dwell is short beside the time constants that bench and world state."""

from __future__ import annotations

from math import exp
from pathlib import Path

import numpy as np
import pytest
from general_lab import DVM, PROCEDURE

from rig.engine.session import Signals
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table
from rig.verbs.plan.dwells import narrow_bands, short_dwells

VALVE = """
[instruments.valve]
driver = "scpi-source"
address = "socket://192.0.2.31:5025"
maker = "ROHDE&SCHWARZ"
model = "HMP2020"
unit = "V"
low = 0
high = 10
set = "VOLT {value}"
decimals = 3
readback = 0.001
setpoint = "VOLT?"
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
dwell_s = 3
"""
BENCH = f"""name = "a valve"
{DVM}{VALVE}
[sensors.cell]
reader = "dvm"
[factors]
valve_V = "valve"
[limits]
valve_V = [0, 10]
"""
FLOW = PROCEDURE.replace("force_kN", "valve_V")
WORLD = 'seed = 3\n[sources.valve_V]\ntime_constant_s = {}\n[sensors.cell]\nformula = "0.5*valve_V"\nnoise = 1e-7\n'
EXPECT = '[expect]\nsigma = {{ cell = {} }}\noutput = {{ cell = "0.5*valve_V" }}\n'


def planned(folder: Path, bench: str = BENCH, procedure: str = FLOW, world: str = ""):
    names = ("bench", "procedure", "world")
    for name, text in zip(names, (bench, procedure, world), strict=True):
        (folder / f"{name}.toml").write_text(text)
    where = folder / "world.toml" if world else None
    return load_plan(folder / "procedure.toml", folder / "bench.toml", dry=bool(world), world=where)


def test_what_is_left_of_a_step_is_what_a_simulated_run_has(tmp_path):
    """3 s until the source counts as arrived and 5 s of the procedure, beside 2 s: exp(-4) of the largest step."""
    plan = planned(tmp_path, procedure=FLOW.replace("readings = 3", "readings = 1"), world=WORLD.format(2))
    (said,) = short_dwells(plan)
    left = 3 * exp(-4)
    assert f"valve_V: {left:.2g} V of a step of 3 V is left after the dwell" in said
    assert "by the time constant of sources.valve_V of the world, 2 s" in said
    paths: list[Path] = []
    start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
    columns = run_table(paths[0]).columns
    missing = np.abs(columns["cell_V"] - 0.5 * columns["valve_V"])[1:][np.abs(np.diff(columns["valve_V"])) == 3.0]
    assert np.all(missing <= 0.5 * left * 1.01)
    assert np.all(missing >= 0.5 * left * exp(-2.0 / 2.0))  # a poll and a reading later


def test_the_dwell_that_it_proposes_is_long_enough_and_not_much_longer(tmp_path):
    bench = BENCH.replace("dwell_s = 3\n", "dwell_s = 3\ntime_constant_s = 2\n")
    (said,) = short_dwells(planned(tmp_path, bench))
    assert "by the time constant of instruments.valve, 2 s" in said
    enough = int(said.rpartition("settle.dwell_s = ")[2].split()[0])
    assert not list(short_dwells(planned(tmp_path, bench, FLOW.replace("dwell_s = 5", f"dwell_s = {enough}"))))
    assert list(short_dwells(planned(tmp_path, bench, FLOW.replace("dwell_s = 5", f"dwell_s = {enough - 2}"))))


def test_it_is_compared_with_the_expected_scatter(tmp_path):
    bench = BENCH.replace("dwell_s = 3\n", "dwell_s = 3\ntime_constant_s = 2\n")
    (said,) = short_dwells(planned(tmp_path, bench, FLOW + EXPECT.format(0.001)))
    assert f"({0.5 * 3 * exp(-4):.2g} V of cell, expect.sigma 0.001 V)" in said
    assert not list(short_dwells(planned(tmp_path, bench, FLOW + EXPECT.format(2)))), "far below the scatter"


def test_an_approach_that_is_found_where_the_scatter_is_smaller_than_expected_is_said(tmp_path):
    """0.02 Hz of 180 Hz/V was named in clean worlds, with 0.05 Hz of scatter where 0.3 Hz was expected."""
    bench = BENCH.replace("dwell_s = 3\n", "dwell_s = 3\ntime_constant_s = 2\n")
    steep = EXPECT.format(0.3).replace("0.5*valve_V", "180*valve_V")
    dwells = {seconds: FLOW.replace("dwell_s = 5", f"dwell_s = {seconds}") + steep for seconds in (14, 25)}
    assert list(short_dwells(planned(tmp_path, bench, dwells[14])))
    assert not list(short_dwells(planned(tmp_path, bench, dwells[25])))


@pytest.mark.parametrize("tau", ["", "time_constant_s = 0.5\n"])
def test_nothing_is_said_of_what_is_not_known_or_quick(tmp_path, tau):
    assert not list(short_dwells(planned(tmp_path, BENCH.replace("dwell_s = 3\n", f"dwell_s = 3\n{tau}"))))


def test_a_reading_of_its_own_that_must_be_near_is_counted(tmp_path):
    own = 'dwell_s = 3\ntime_constant_s = 2\nread = "MEAS?"\ntolerance = 0.005\n'
    assert not list(short_dwells(planned(tmp_path, BENCH.replace("dwell_s = 3\n", own))))


SOAKED = FLOW.replace("[factors.valve_V]", "[factors.oven_degC]\nlevels = [10, 40]\nhard = true\n[factors.valve_V]")
SOAKED += "[soak]\ndwell_s = {}\ndrift_degC_per_h = {}\n"
OVEN = """
[instruments.oven]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.10:502/1"
low_degC = -60
high_degC = 100
[temperatures.package_degC]
reader = "scanner"
channel = "108"
place = "oven_degC"
follows_s = 1800
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
nplc = 10
channels = { "108" = "rtd-4w-385" }
"""


@pytest.mark.parametrize(("dwell", "drift", "short"), [(600, 100, True), (600, 0.05, False), (14400, 100, False)])
def test_a_chamber_whose_load_follows_slowly(tmp_path, dwell, drift, short):
    bench = f"{BENCH}{OVEN}".replace("[factors]", '[factors]\noven_degC = "oven"').replace(
        "[limits]", "[limits]\noven_degC = [0, 60]"
    )
    found = [one for one in short_dwells(planned(tmp_path, bench, SOAKED.format(dwell, drift))) if "oven" in one]
    assert bool(found) == short
    if short:  # the thermometer is within 1 degC when the dwell begins
        assert f"oven_degC: {exp(-600 / 1800):.2g} degC of a step of 30 degC" in found[0]
        assert "temperatures.package_degC, 1800 s" in found[0]
        assert "soak.dwell_s = " in found[0]


@pytest.mark.parametrize(("dwell", "left"), [(60, 26.0), (1200, 2.5), (3600, None)])
def test_a_chamber_without_a_thermometer_in_it_is_compared_with_what_the_forecast_assumes(tmp_path, dwell, left):
    """Its own display settles long before what is in it: 60 s of soak were planned without a word."""
    alone = OVEN.partition("[temperatures.package_degC]")[0]
    bench = f"{BENCH}{alone}".replace("[factors]", '[factors]\noven_degC = "oven"').replace(
        "[limits]", "[limits]\noven_degC = [0, 60]"
    )
    found = [one for one in short_dwells(planned(tmp_path, bench, SOAKED.format(dwell, 2))) if "oven" in one]
    assert bool(found) == (left is not None)
    if left is not None:
        assert (
            f"oven_degC: {left:.2g} degC of a step of 30 degC is left after the dwell, by the time constant" in found[0]
        )
        assert "what is in the chamber, which is assumed, 480 s" in found[0]


def test_a_source_that_reads_back_is_waited_for_and_one_that_does_not_is_told(tmp_path):
    """4 degC were said to be left of a bath that had settled by its own reading; of a silent one nothing was said."""
    lab = Path(__file__).parents[2] / "examples" / "flow-lab"
    for file in lab.glob("*.toml"):
        (tmp_path / file.name).write_text(file.read_text())
    files = tmp_path / "procedure.toml", tmp_path / "bench.toml"
    assert [one for one in short_dwells(load_plan(*files)) if "chamber" in one] == []
    text = files[1].read_text()
    for line in ('read = "READ?"', "tolerance = 0.1 ", "time_constant_s = 300"):
        assert text.count(line) == 1
        text = text.replace(line, "")
    files[1].write_text(text)
    (found,) = [one for one in short_dwells(load_plan(*files)) if "chamber" in one]
    assert "which is assumed, 480 s" in found


def test_a_band_that_the_instrument_need_not_reach_is_named(tmp_path):
    """A flow controller that reads 1.004 at 1.000 counts as arrived within 0.02, and the band was 0.002: it waited."""
    bench = BENCH.replace("dwell_s = 3", 'read = "MEAS?"\ntolerance = 0.02\ndwell_s = 3')
    (said,) = narrow_bands(planned(tmp_path, bench=bench))
    assert "until valve reads within 0.005 V of the setpoint, and valve itself counts 0.02 V as arrived" in said
    assert "factors.valve_V.band = 0.02 waits for the latter" in said
    wide = FLOW.replace("[factors.valve_V]", "[factors.valve_V]\nband = 0.02")
    assert list(narrow_bands(planned(tmp_path, bench=bench, procedure=wide))) == []
