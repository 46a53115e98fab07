"""The checker of the chaos campaign sees what it is there for: five forgeries of a run whose tape is at hand.

Run file and tape are written here line by line, as their documents say, by nothing that the project runs with.
"""

from __future__ import annotations

import ast
import json
import sqlite3
import sys
from pathlib import Path

import pytest

from proving.chaos.checker import KINDS, check
from proving.chaos.tape import accepted_in

BOOT_S, SPEED = 1000.0, 10.0
BENCH = """
[instruments.supply]
[sensors.bridge]
reader = "scanner"
channel = "101"
unit = "mV"
[temperatures.sensor_temperature_degC]
reader = "scanner"
channel = "108"
[factors]
pressure_psia = "supply"
sensor_temperature_degC = "oven"
"""
PROCEDURE = """
kind = "whole-plot"
[soak]
poll_s = 30
[recovery]
continue_gap_s = 600
"""
SCHEMA = """
CREATE TABLE document (name, body);
CREATE TABLE factor (position, name, axis, overtravel, hard, stays);
CREATE TABLE point (run_index, replication, whole_plot, pressure_psia, sensor_temperature_degC, p_side, s_side);
CREATE TABLE record
    (seq, session, kind, elapsed_s, utc_s, run_index, whole_plot, attempt, status, body, previous, hash);
"""
PLAN = [(0, 1, 0.5, 10.0), (1, 1, 1.0, 10.0), (2, 2, 1.0, 20.0), (3, 2, 0.5, 20.0)]
"""Point, whole plot, pressure, temperature; one is read every 100 s, and a plot begins with its chamber."""


class Lines:
    """What is written of a night: on the tape, and in the run file."""

    def __init__(self):
        self.tape = [{"t": 0.0, "what": "server", "boot_s": BOOT_S, "speed": SPEED, "epoch_utc": 5e8, "utc_s": 1.7e9}]
        self.records = [(0, "run", 0.0, None, None, None, {})]
        session = {"clock_s": BOOT_S * SPEED, "elapsed_s": 0.0, "gap_s": 0.0, "gap_known": True, "gap_certain": True}
        self.record(0.0, "session", None, None, None, session)

    def on_tape(self, t, what, **fields):
        self.tape.append({"t": t, "what": what, **fields})

    def record(self, t, kind, index, plot, status, body):
        self.records.append((1, kind, t, index, plot, status, body))

    def write(self, folder: Path) -> tuple[Path, Path]:
        run, tape = folder / "run.sqlite", folder / "bench.tape"
        tape.write_text("".join(f"{json.dumps(line)}\n" for line in self.tape))
        db = sqlite3.connect(run)
        db.executescript(SCHEMA)
        db.executemany("INSERT INTO document VALUES (?, ?)", [("bench.toml", BENCH), ("procedure.toml", PROCEDURE)])
        factors = [(0, "pressure_psia", "pressure", 0.05, 0, 0), (1, "sensor_temperature_degC", "t", 0.0, 1, 1)]
        db.executemany("INSERT INTO factor VALUES (?, ?, ?, ?, ?, ?)", factors)
        db.executemany("INSERT INTO point VALUES (?, 1, ?, ?, ?, 0, 0)", PLAN)
        for seq, (session, kind, t, index, plot, status, body) in enumerate(self.records, 1):
            row = (seq, session, kind, t, 5e8 + t, index, plot, 1, status, json.dumps(body), b"", b"")
            db.execute(f"INSERT INTO record VALUES ({', '.join('?' * 12)})", row)
        db.commit()
        db.close()
        return run, tape


def observed(lines: Lines, t: float, index: int, *, plot: int, psia: float, degC: float, stay: int) -> None:
    true = {"pressure_psia": psia, "sensor_temperature_degC": degC}
    there = {
        "end_s": t + 1.0,
        "true": 0.0,
        "found": 0.0,
        "factors": true,
        "sides": {},
        "stay": stay,
        "air_degC": {"oven": degC},
    }
    volts, temperatures = [2e-3 * psia + 1e-6 * n for n in range(3)], [degC, degC + 0.001, degC]
    for n in range(3):
        at = {**there, "end_s": t + n + 0.9}
        lines.on_tape(t + n, "reading", on="scanner", channel="101", unit="V", given=volts[n], **at)
        lines.on_tape(t + n + 0.1, "reading", on="scanner", channel="108", unit="degC", given=temperatures[n], **at)
        lines.on_tape(t + n, "readback", on="supply", true=psia, given=psia)
    mV = [1e3 * v for v in volts]
    body = {
        "outputs": {"bridge_mV": {"mean": sum(mV) / 3, "readings": mV}},
        "temperatures": {"sensor_temperature_degC": {"mean": sum(temperatures) / 3, "readings": temperatures}},
        "references": {"pressure_psia": {"mean": psia, "readings": [psia] * 3}},
        "readback": {"pressure_psia": psia},
        "environment": {"oven": {"setpoint_degC": degC, "temperature_degC": degC}},
        "measured_s": [t - 1.0, t + 4.0],
    }
    lines.record(t + 5.0, "observation", index, plot, "accepted", body)


def night(stays=(1, 1, 2, 2), silence: tuple[float, float] = (0.0, 0.0)) -> Lines:
    """A run of two whole plots of two points, polled every 20 s but for a silence."""
    lines, t = Lines(), 0.0
    for (index, planned, psia, degC), stay in zip(PLAN, stays, strict=True):
        if index in (0, 2):
            lines.on_tape(t, "change", on="oven", of="setpoint_degC", value=degC)
            lines.record(t + 90.0, "event", None, planned, "whole-plot", {"planned": planned})
        observed(lines, t + 95.0, index, plot=planned, psia=psia, degC=degC, stay=stay)
        t += 200.0
    for at in range(0, 900, 20):
        if not silence[0] < at < silence[1]:
            lines.on_tape(float(at), "asked", on="oven", text="?")
    lines.record(899.0, "end", None, None, "complete", {})
    return lines


def forged(run: Path, statement: str) -> None:
    db = sqlite3.connect(run)
    db.executescript(statement)
    db.close()


def found(run: Path, tape: Path, ledger=None) -> dict[str, int]:
    verdict = check(run, tape, ledger)
    return {kind: len(verdict.findings[kind]) for kind in KINDS if verdict.findings[kind]}


@pytest.mark.parametrize("module", ["checker", "tape"])
def test_the_checker_shares_no_code_with_the_project(module):
    tree = ast.parse(Path(sys.modules[f"proving.chaos.{module}"].__file__).read_text())
    imported = [a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names]
    imported += [str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert {name.partition(".")[0] for name in imported if name != "proving.chaos.tape"} <= sys.stdlib_module_names


def test_a_true_run_is_found_true(tmp_path):
    run, tape = night().write(tmp_path)
    verdict = check(run, tape, accepted_in(run))
    assert verdict.clean, verdict.findings
    assert (verdict.counts["readings"], verdict.counts["plots"], verdict.counts["silences"]) == (24, 2, 0)


@pytest.mark.parametrize(
    ("statement", "seen"),
    [
        ("DELETE FROM record WHERE run_index = 2", {"lost": 2}),  # of the plan, and of what was accepted once
        ("INSERT INTO record SELECT * FROM record WHERE run_index = 1", {"doubled": 1, "wrong": 1}),
        ("UPDATE record SET body = replace(body, '2.001', '2.005') WHERE run_index = 1", {"wrong": 3}),
    ],
    ids=["removed", "doubled", "a reading changed"],
)
def test_a_forged_file_is_seen(tmp_path, statement, seen):
    run, tape = night().write(tmp_path)
    ledger = accepted_in(run)
    forged(run, statement)
    assert found(run, tape, ledger) == seen


def test_a_plot_of_two_stays_is_seen(tmp_path):
    assert found(*night(stays=(1, 3, 2, 2)).write(tmp_path)) == {"stays": 1}
    lines = night()
    lines.on_tape(250.0, "change", on="oven", of="setpoint_degC", value=15.0)
    lines.on_tape(260.0, "change", on="oven", of="setpoint_degC", value=10.0)
    (tmp_path / "set").mkdir()
    assert found(*lines.write(tmp_path / "set")) == {"stays": 2}


@pytest.mark.parametrize(
    ("told", "seen"), [({}, {"holes": 1}), ({"hole_s": 250.0}, {}), ({"hole_s": 20.0}, {"holes": 1})]
)
def test_a_hole_that_is_not_recorded_or_with_a_wrong_length_is_seen(tmp_path, told, seen):
    lines = night(silence=(110.0, 290.0))
    if told:
        lines.records.insert(-1, (1, "event", 292.0, None, None, "hole", told))
    assert found(*lines.write(tmp_path)) == seen
