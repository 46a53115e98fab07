"""What a further run is promised to tell beside what comes; a small share of proving/statistics/forecasts.py.

Worlds are those of proving/truth, which share no code with the fitter. Sizes, errors and drifts differ from world to
world; the forecast sees the later run's settings, never its outputs.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import rig
from test_confirm import LAB, run

from proving.truth import attitude
from proving.truth import whole_plot as pressure
from rig.bench.config import parse_toml
from rig.files.toml_text import toml_text
from rig.fitter.confirm import NOTHING, Confirmation, Later, Separation, confirm, questions_of, separation
from rig.procedures.attitude.together import AttitudeTogether
from rig.procedures.attitude.trace import trace
from rig.procedures.pressure.together import WholePlotTogether
from rig.procedures.pressure.trace import trace_whole_plots
from rig.runs.plans import plan_of
from rig.verbs.confirm import consider, inseparable, open_traced, propose

DAY_S = 86400.0
FEWER = pressure.Run(pairs=((-1.0, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (0.0, 0.0)))
Told = list[tuple[float, float, float, float]]


def what_came(promise: Separation, answer: Confirmation, true: str) -> Told:
    """(promised, low, high, came) for every pair that the true effect is one of."""
    members = {m.effect: m for m in answer.members}
    out: Told = []
    for pair, sigmas in promise.sigmas.items():
        if true in pair:
            if pair[1] == NOTHING:
                came = members[true].shown
            else:
                one, other = (members[name].sigmas for name in pair)
                came = abs(one**2 - other**2) ** 0.5
            out.append((sigmas, *promise.intervals[pair], came))
    return out


def of_pressure(seed: int) -> Told:
    rng = np.random.default_rng([16, seed])
    size = 3e-3 * float(np.exp(rng.uniform(-0.7, 0.9)))
    bench = pressure.Bench(
        transducers=(pressure.Transducer(cubic=size, drift=float(rng.normal(0, 1e-5))),),
        subplot=(pressure.SUBPLOT * float(np.exp(rng.normal(0, 0.3))), 0.0),
        whole_plot=pressure.WHOLE_PLOT * float(np.exp(rng.normal(0, 0.4))),
    )
    first = pressure.simulate(bench, seed=seed)
    found = trace_whole_plots(first)
    later = pressure.simulate(bench, FEWER if seed % 2 else pressure.Run(), seed=seed + 1000)
    both = WholePlotTogether.of(found, first, [Later(later, 2 * DAY_S)])
    return [
        told
        for question in questions_of(found)
        for told in what_came(separation(both, [question])[0], confirm(both, question), "pressure-third-order")
    ]


def of_attitude(seed: int) -> Told:
    """A sag of the pads on one sensor without roll; the later run has roll 0 and 180 deg."""
    rng = np.random.default_rng([17, seed])
    bench = attitude.Bench(
        sensors=(attitude.Sensor("x", b_per_h=float(rng.normal(0, 1e-7))),),
        sigma_deg=1.5e-4 * float(np.exp(rng.normal(0, 0.3))),
        compliance={("y", "x"): 4e-4 * float(np.exp(rng.uniform(-0.7, 0.7)))},
    )
    pitch = np.linspace(-180, 180, 19)
    first, _ = attitude.simulate(bench, attitude.Plan(pitch, np.zeros(1), replications=4), seed)
    found = trace(first)
    later, _ = attitude.simulate(bench, attitude.Plan(pitch, np.array([0.0, 180.0]), replications=1), seed + 1000)
    both = AttitudeTogether.of(found, first, [Later(later, DAY_S)])
    return [
        told
        for question in questions_of(found)
        for told in what_came(separation(both, [question])[0], confirm(both, question), "isolation-pad-deflection")
    ]


@pytest.mark.parametrize(("of_world", "worlds"), [(of_attitude, 12), (of_pressure, 7)])
def test_what_comes_is_what_was_promised(of_world, worlds: int) -> None:
    promised, low, high, came = np.array([told for seed in range(worlds) for told in of_world(seed)]).T
    worth = promised >= 0.5
    assert worth.sum() >= worlds
    assert 0.9 <= np.median(came[worth] / promised[worth]) <= 1.1
    inside = np.mean((low <= came) & (came <= high))
    assert inside >= 0.75, "intervals of 90 %, of more than fifteen"


def traced_run(folder: Path, sensors: str, effects: dict, pitches: int, seed: int = 6) -> Path:
    bench, procedure = (parse_toml((LAB / f"{name}.toml").read_text(), name) for name in ("bench", "night"))
    bench["sensors"] = {name: bench["sensors"][name] for name in sensors}
    procedure["replications"] = 3
    pitch, roll = np.linspace(-180, 180, pitches).tolist(), np.linspace(-180, 180, 7).tolist()
    procedure["design"] = {"type": "D", "pitch_deg": pitch, "roll_deg": roll}
    texts = {"bench.toml": bench, "procedure.toml": procedure, "world.toml": {"seed": seed, "effects": effects}}
    return run(plan_of({name: toml_text(values) for name, values in texts.items()}, dry=True), folder)


def test_what_no_run_of_the_bench_separates_is_said_and_needs_a_person(tmp_path: Path) -> None:
    """A cube of the sensors' outputs and one of the voltmeter's: it reads those sensors whatever is run."""
    first = traced_run(tmp_path, "xz", {"third_order": {"ug_per_g3": 40.0}}, 9)
    listed = rig("confirm", first, "--list", "--json")
    assert listed.returncode == 0, listed.stderr
    told = json.loads(listed.stdout)
    (pair,) = told["inseparable"]
    assert [step["change"] for run in told["proposals"] for step in run["by_hand"]] == ["voltmeter-swapped"] * len(
        told["proposals"]
    ), "no run without another voltmeter"
    assert set(pair["pair"]) == {"sensor-third-order", "voltmeter-nonlinearity"}
    assert "voltage standard" in pair["would"]
    said = " ".join(rig("confirm", first, "--list").stdout.split())
    assert "no run of this bench separates them" in said
    assert (pair["by_hand"] or [pair["would"]])[0] in said


def test_where_nobody_can_change_anything_nothing_is_proposed(tmp_path: Path, monkeypatch) -> None:
    """The same with a voltmeter of which nothing is declared about another one."""
    first = traced_run(tmp_path, "xz", {"third_order": {"ug_per_g3": 40.0}}, 9)
    monkeypatch.setattr("rig.procedures.attitude.effects.effect.FAMILIES", {})
    opened = open_traced(first)
    considered = consider(opened)
    (never,) = inseparable(opened, considered)
    assert "voltage standard" in never.would
    assert never.by_hand == ()
    assert propose(considered) == ()


def test_a_pair_that_stays_open_whatever_is_run_is_named(tmp_path: Path) -> None:
    """A square of gravity and a sag look alike in one sensor however it is turned: the pads have to be locked."""
    first = traced_run(tmp_path, "x", {"second_order": {"ug_per_g2": 20.0}}, 13)
    told = json.loads(rig("confirm", first, "--list", "--json").stdout)
    (open_pair,) = told["inseparable"]
    assert set(open_pair["pair"]) == {"sensor-second-order", "isolation-pad-deflection"}
    assert "lock the pads" in open_pair["would"]
    assert told["proposals"], "the head is distinguished from both"
    assert "the same again" not in {proposal["what"] for proposal in told["proposals"]}
    for proposal in told["proposals"]:
        for one in proposal["sigmas"]:
            low, high = one["interval_90"]
            assert low <= one["sigmas"] <= high
            assert 0.0 <= one["chance"] <= 1.0
