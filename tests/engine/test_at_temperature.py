"""Every parameter says at which temperature it holds, and may be asked for at 20 or 23 degC."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from command import rig

from proving.truth.attitude import D1, Bench, Sensor, simulate
from rig.procedures.attitude.fit import fit_attitude
from rig.tables import write_csv

BENCH = Bench(sensors=(Sensor("x"),), sigma_deg=3e-4)


@pytest.fixture(scope="module")
def data():
    """A sensor whose offset goes by 30 uV/degC and whose sensitivity by 80 ppm/degC, both nothing at 20 degC."""
    run = simulate(BENCH, D1(180, 9, 9), 1)[0]
    rng = np.random.default_rng(2)
    degC = 27.0 + 4.0 * np.sin(np.arange(len(run)) / 37.0) + 0.1 * rng.standard_normal(len(run))
    name, y = next(iter(run.outputs.items()))
    warm = y * (1.0 + 80e-6 * (degC - 20.0)) + 30e-6 * (degC - 20.0)
    return replace(run, sensor_temperature_degC=degC, outputs={name: warm})


def direct(data, at_degC):
    """b, S along the axis and their covariance by a fit of the same model about that temperature, written out here."""
    name = data.sensors[0]
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    h = np.column_stack([np.ones(len(a)), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)])
    axis = fit_attitude(data, name, temperature=True).temperature.direction
    warm = data.sensor_temperature_degC - at_degC
    columns = np.column_stack([h, warm, warm * (h[:, 1:] @ axis)])
    c, rss, *_ = np.linalg.lstsq(columns, data.outputs[name], rcond=None)
    covariance = rss[0] / (len(a) - 6) * np.linalg.inv(columns.T @ columns)
    return c, covariance


@pytest.mark.parametrize("at_degC", [20.0, 23.0, 31.0])
def test_parameters_and_covariance_at_a_temperature(data, at_degC):
    fit = fit_attitude(data, data.sensors[0], temperature=True, at_degC=at_degC)
    c, covariance = direct(data, at_degC)
    assert fit.linear.coefficients == pytest.approx(c[:4], abs=1e-9)
    assert fit.linear.covariance == pytest.approx(covariance[:4, :4], rel=1e-5, abs=1e-16)
    assert fit.at_degC == at_degC


def test_at_20_degC_the_truth_comes_out(data):
    there = fit_attitude(data, data.sensors[0], temperature=True, at_degC=20.0)
    mean = fit_attitude(data, data.sensors[0], temperature=True)
    truth = BENCH.sensors[0]
    b_error, S_error = np.sqrt(np.diag(there.linear.covariance))[0], there.parameters.stderr[1]
    assert abs(there.parameters.b_V - truth.b) < 4 * b_error
    assert abs(there.parameters.S_V - truth.S) < 4 * S_error
    # at the run's mean, about 27 degC, both are some hundred standard errors away
    assert mean.parameters.b_V - truth.b == pytest.approx(7 * 30e-6, rel=0.1)
    assert pytest.approx(7 * 80e-6, rel=0.1) == mean.parameters.S_V / truth.S - 1.0
    # the tests of the model do not depend on where its parameters are given
    assert there.replication.bias.value == pytest.approx(mean.replication.bias.value, rel=1e-6)


def test_outside_what_was_measured_is_said(data):
    for at_degC, outside in ((20.0, True), (25.0, False)):
        words = fit_attitude(data, data.sensors[0], temperature=True, at_degC=at_degC).at_words
        assert words.startswith(f"parameters hold at {at_degC:.2f} degC, as asked")
        assert ("OUTSIDE what was measured" in words) == outside


@pytest.fixture(scope="module")
def table(data, tmp_path_factory):
    path = tmp_path_factory.mktemp("warm") / "run.csv"
    names = ("replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC")
    write_csv({**{name: getattr(data, name) for name in names}, "x_V": data.outputs[data.sensors[0]]}, path)
    return path


def test_the_command_line_says_it_of_every_parameter(table):
    done = rig("fit", table, "--temperature", "--at-degC", "23", "--json")
    assert done.returncode == 0, done.stderr
    sensor = json.loads(done.stdout)["sensors"]["x_V"]
    assert {row["at_degC"] for row in sensor["parameters"].values()} == {23.0}
    assert (
        "parameters hold at 23.00 degC, as asked (measured from"
        in rig("fit", table, "--temperature", "--at-degC", "23").stdout
    )
    plain = rig("fit", table)
    assert "degC, the mean of the run (22." in plain.stdout
    assert "no temperature in the model" in plain.stdout
    report = table.parent / "report.html"
    traced = rig("trace", table, "--temperature", "--full", "--report", report)
    assert "parameters hold at 27." in traced.stdout
    assert "parameters hold at 27." in report.read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--at-degC", "23"), "has no temperature in it"),
        (("--temperature", "--at-degC", "-300"), "is no temperature"),
        (("--temperature", "--traced", "--at-degC", "23"), "leave one of the two away"),
    ],
)
def test_what_cannot_be_asked_is_refused(table, options, said):
    done = rig("fit", table, *options)
    assert done.returncode == 2
    assert said in done.stderr
