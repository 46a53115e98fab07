"""What readings of a point are judged by: scatter in volts whatever the unit, and the point that a policy counts at."""

from __future__ import annotations

import ideal_pressure_bench as pressure
import pytest

from procedures import WholePlotProcedure
from rig.engine.measuring import Channel, Observation
from rig.engine.session import Outcome
from rig.run_file.reader import RunReader

MOST_MV = 0.02


def whole_plot(**faults):
    """One whole plot of two pressures, at which two readings are to scatter by no more than 0.02 mV."""
    values = pressure.PROCEDURE.model_dump(exclude_unset=True)
    design = {"type": "list", "temperatures_degC": [[-60, 0]], "pressures_psia": [1.0, 2.5], "repeated_psia": []}
    measure = {"readings": 2, "max_sd_mV": MOST_MV, "repeats": 0}
    return WholePlotProcedure.model_validate(values | {"design": design, "measure": measure, "faults": faults})


def scattering(bench, sd_mV):
    """The bridge scatters by this much, by pressure; returns the pressures in the order in which they are read."""
    fetch, asked = bench.dvm.fetch, []

    def fetch_scattering():
        readings, psia = dict(fetch()), bench.supply.setpoint
        if len(readings["1"]) == 2:
            asked.append(psia)
            assert len(asked) < 9, "asked again and again"
            off_V = sd_mV[psia] / 2**0.5 / 1e3
            readings["1"] = [readings["1"][0] - off_V, readings["1"][1] + off_V]
        return readings

    bench.dvm.fetch = fetch_scattering
    return asked


def run_pressure(folder, sd_mV, **faults):
    procedure, bench = whole_plot(**faults), pressure.PressureBench()
    asked = scattering(bench, sd_mV)
    path = pressure.new_run(folder, procedure)
    outcome, _, message = pressure.run_session(path, bench, procedure=procedure)
    return path, outcome, message, asked


def records(path, kind):
    with RunReader.open(path) as reader:
        reader.verify()
        return list(reader.records(kind))


def flags(path):
    return {r.data["readback"]["pressure_psia"]: r.data["flags"] for r in records(path, "observation")}


def test_scatter_of_a_sensor_in_millivolts_is_held_against_millivolts(tmp_path):
    path, outcome, message, _ = run_pressure(tmp_path, {1.0: 0.9 * MOST_MV, 2.5: 1.1 * MOST_MV})
    assert outcome is Outcome.COMPLETE, message
    assert flags(path) == {1.0: [], 2.5: ["noisy"]}


def test_what_is_too_noisy_is_told_in_volts_with_the_point(tmp_path):
    path, outcome, message, asked = run_pressure(tmp_path, dict.fromkeys((1.0, 2.5), 0.06), noisy=["abort"])
    assert outcome is Outcome.FAULT
    words = "bridge_mV scatters by 6e-05 V at point 0, more than 2e-05 V"
    assert message.startswith(words)
    assert [(r.data["fault"], r.data["message"]) for r in records(path, "fault")] == [("noisy", words)]
    assert len(asked) == 1


def test_a_policy_counts_what_failed_at_the_point_in_hand(tmp_path):
    noisy = ["retry 1", "accept"]
    path, outcome, message, asked = run_pressure(tmp_path, dict.fromkeys((1.0, 2.5), 2 * MOST_MV), noisy=noisy)
    assert outcome is Outcome.COMPLETE, message
    assert [(r.run_index, r.status) for r in records(path, "fault")] == [(0, "retry"), (1, "retry")]
    assert flags(path) == {1.0: ["noisy"], 2.5: ["noisy"]}
    assert len(asked) == 4


def test_the_noisiest_of_outputs_in_different_units_is_told_by_their_volts():
    scales = {"x_V": 1.0, "bridge_mV": 1e3}
    found = Observation({"x_V": Channel((1.0, 1.002)), "bridge_mV": Channel((1.0, 1.2))}, {})
    assert found.noisiest(scales) == ("x_V", pytest.approx(0.002 / 2**0.5))
