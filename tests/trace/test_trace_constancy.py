"""A right name has a constant coefficient: what only looks like the true law over the whole run is doubtful.

Strangers' tables (tests/strangers) have the cases; of every rule there is a catalogue's own cause beside it that keeps
its name without a doubt.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from strangers_tables import table

import rig
from proving.strangers.traced import options_of, with_file, without_left_out
from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import CLEAN, sized
from rig.fitter.trace.constant import OWN_SIZE, change, products, stands_in
from rig.fitter.trace.engine import family
from rig.fitter.trace.flexible import waves
from rig.fitter.trace.sudden import lead_over_slopes, slopes
from rig.procedures.attitude.trace import trace


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def doubts(made):
    """What is doubted of each name found in a stranger's table, by name; of a name in several sensors all of it."""
    with without_left_out():
        told = with_file(made, lambda path: rig.open(path).trace(**options_of(list(made.options))).to_json())
    out: dict[str, list[str | None]] = {}
    for sensor in told["sensors"].values():
        for effect in sensor["effects"]:
            if effect["stratum"] != "noise":
                out.setdefault(effect["effect"], []).append(effect["doubtful"])
    return out


def beside_a_line(columns):
    left = np.column_stack([np.ones(len(columns)), np.linspace(-1.0, 1.0, len(columns))])
    basis = np.linalg.qr(left)[0]
    return columns - basis @ (basis.T @ columns)


def test_probabilities_of_sensors_are_combined_and_variables_are_paid_for():
    assert change({}) is None
    one = change({"with time": [0.02], "with pitch": [0.5]})
    three = change({"with time": [0.02, 0.02, 0.02], "with pitch": [0.5, 0.5, 0.5]})
    assert one is not None
    assert three is not None
    assert one.over == three.over == "with time"
    assert one.p == pytest.approx(0.04)
    assert three.p < 0.002


def test_products_of_what_a_name_adds():
    added = np.linspace(-1.0, 1.0, 50) ** 2
    over_x = waves(np.arange(50.0), 2)
    made = {one.place: one for one in products(added, {"with x": over_x, "with a constant": np.empty((50, 0))})}
    assert set(made) == {"with x", OWN_SIZE}
    assert made["with x"].columns == pytest.approx(added[:, None] * over_x)


def test_a_name_that_changes_stands_in_for_another_one():
    rng = np.random.default_rng(5)
    x, cold = rng.uniform(-1, 1, 300), rng.uniform(-1, 1, 300)
    noise = beside_a_line(rng.standard_normal(300))
    made = products(3.0 * x**2, {"in the cold": waves(cold, 2)})
    changing, near = 3.0 * x**2 * cold, beside_a_line((cold * np.abs(x))[:, None])
    assert stands_in(noise + beside_a_line(changing), near, made, beside_a_line, 1.0) == "in the cold"
    other = np.sign(x) * (cold > 0)
    assert stands_in(noise + beside_a_line(other), beside_a_line(other[:, None]), made, beside_a_line, 1.0) is None


@pytest.mark.parametrize("lasts", [False, True])
def test_a_step_is_told_from_a_change_that_lasts(lasts):
    rng, t = np.random.default_rng(7), np.arange(150.0)
    true = 2.0 * np.maximum(t - 80.0, 0.0) / 35.0 if lasts else 2.0 * (t >= 80.0)
    y = beside_a_line(rng.standard_normal(150) + true)
    steps = np.column_stack([beside_a_line((t >= at).astype(float)) for at in range(20, 130)])
    gain = float(np.max((y @ steps) ** 2 / np.sum(steps**2, axis=0)))
    lead = lead_over_slopes(y, gain, 1.0, slopes(t), beside_a_line)
    assert (lead < 0) if lasts else (lead > 9)


def test_creep_that_grows_when_hot_is_no_drift_within_whole_plots():
    """Fisher's combination over three transducers: alone each has p of some hundredths."""
    found = doubts(table("hot_creep"))
    assert found["subplot-drift"]
    assert all(found["subplot-drift"])


def test_two_names_that_are_one_in_the_cold_are_doubtful():
    """Ice in the line throttles it in the cold: carry-over, and a hysteresis that follows the temperature."""
    found = doubts(table("ice_plug"))
    assert "hysteresis-temperature" in found
    assert all(text for texts in found.values() for text in texts)
    assert any("with a coefficient that changes" in text for text in found["hysteresis-temperature"] if text)


def test_a_name_that_is_doubtful_in_one_transducer_is_so_in_all():
    """It was a step. What gives off gas when it is warm drifts faster then."""
    found = doubts(table("reference_outgassing"))
    assert set(found) == {"whole-plot-drift"}
    assert len(found["whole-plot-drift"]) == 2
    assert all(found["whole-plot-drift"])


def test_a_power_is_doubtful_where_a_corner_explains_as_much():
    """A regulator that drops out below some temperature; there are five temperatures."""
    found = doubts(table("regulator_dropout"))
    assert any("a law with a corner" in text for texts in found.values() for text in texts if text)


def test_a_drift_that_begins_late_is_no_step():
    """The lids of the standards are left open from some time on."""
    found = doubts(table("evaporation", "--response absorbance --formula 1_+_c_mgL --time t_min --group cuvette"))
    assert found["sensitivity-step:t_min,c_mgL"][0] is not None
    assert "goes on for a good part of the run" in found["sensitivity-step:t_min,c_mgL"][0]


def test_several_periods_of_one_cause_are_doubtful():
    """A rotor that locks in near one flow takes three waves that are no harmonics; the teeth of a screw are."""
    found = doubts(table("shedding_lock_in", "--response f_Hz --formula 1_+_q_Lmin --time t_min --replicate run"))
    assert "values of its constant" in (found["periodic:q_Lmin"][0] or "")


PLAN = D1(180, 13, 13, replications=4)


@pytest.mark.parametrize("changes", [False, True])
def test_a_backlash_that_wears_in_is_doubtful(changes):
    """The same size in all replications keeps its name without a doubt."""
    bench = sized("backlash, pitch", 1.5, PLAN)
    data, truth = simulate(bench, PLAN, 4)
    clean = simulate(CLEAN, PLAN, 4)[1]
    if changes:
        late = np.where(data.replicate_index >= 2, 0.5, -0.5)
        added = {name: late * (truth[name] - clean[name]) for name in data.outputs}
        data = replace(data, outputs={name: volts + added[name] for name, volts in data.outputs.items()})
    effects = {e.effect: e.doubtful for e in trace(data, validate=False).sensors["x_V"].added}
    assert "backlash-pitch" in effects
    assert bool(effects["backlash-pitch"]) == changes
