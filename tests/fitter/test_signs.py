"""Signs that physics leaves an effect, causes that data cannot separate, and what intervals cover of either."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from command import rig
from test_confirm import make, run

from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate
from proving.truth.attitude_hidden import HIDDEN
from proving.truth.whole_plot import Bench as PressureBench
from proving.truth.whole_plot import Transducer
from proving.truth.whole_plot import simulate as simulate_pressure
from rig.fitter.confirm import Member
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.evaluate import trace_attitude_table
from rig.procedures.attitude.fit import fit_all
from rig.procedures.attitude.fitted import fit_attitude_table
from rig.procedures.attitude.infer import AttitudeCalibration, calibrate_package, infer_attitude
from rig.procedures.attitude.options import FitOptions
from rig.procedures.attitude.trace import Trace, trace
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table
from rig.verbs.confirm import (
    Confirmed,
    First,
    consider,
    evidence,
    judge,
    open_traced,
    plan_for,
    propose,
    sentences,
)
from rig.verbs.confirm.calibration import with_confirmed

X = Sensor("x")
TILTED = Plan(np.linspace(-30.0, 30.0, 25), np.zeros(1), replications=8)
"""One sensor over +-30 deg without roll: a cube and a sag of the pads, of the other sign, look alike."""
TURNED = Plan(np.linspace(-180.0, 180.0, 37), np.zeros(1), replications=6)


def cubic(size: float, **more: float) -> Bench:
    return Bench(sensors=(replace(X, cubic=size),), **more)


def truth(plan: Plan) -> dict[str, float]:
    """Parameters of the same bench without effects and noise."""
    data, exact = simulate(Bench(sensors=(X,)), plan, 0)
    p = calibrate_package(replace(data, outputs=exact)).parameters("x_V")[0]
    return {"b_V": p.b_V, "S_V": p.S_V}


def table_of(data) -> Table:
    """As `rig fit` reads it."""
    columns = {
        "replicate": data.replicate, "order": data.order, "elapsed_s": data.elapsed_s, "pitch_deg": data.pitch_deg,
        "roll_deg": data.roll_deg, "sensor_temperature_degC": data.sensor_temperature_degC,
        "pitch_side": data.pitch_side, "roll_side": data.roll_side, **data.outputs,
    }  # fmt: skip
    return Table("table.csv", {name: np.asarray(v, np.float64) for name, v in columns.items()}, False, {})


def kept(bench: Bench, plan: Plan, seed: int):
    """What `rig fit --traced` keeps of one run: parameters, and the calibration read back."""
    result = fit_attitude_table(table_of(simulate(bench, plan, seed)[0]), traced=True)
    return result["kept"]["x_V"], AttitudeCalibration.from_dict(json.loads(json.dumps(result["calibration"])))


def named(found: Trace, sensor: str = "x_V") -> dict[str, tuple[float, ...]]:
    return {e.effect: e.coefficients for e in found.sensors[sensor].added}


def test_a_cube_is_no_pad_of_negative_compliance() -> None:
    data, _ = simulate(cubic(2e-4, pitch_backlash_deg=2e-3), TILTED, 1)
    found = trace(data, validate=False).sensors["x_V"]
    assert {e.effect for e in found.added} == {"backlash-pitch", "sensor-third-order"}
    assert all("isolation-pad-deflection" not in e.aliases for e in found.added)
    (refused,) = found.refused
    assert refused.instead_of == "sensor-third-order"
    assert refused.value < -10.0 * refused.stderr
    text = json.dumps(found.outcome().to_json())
    assert "isolation-pad-deflection would need negative compliance (-0.0215 +- 0.0010 deg/g): refused" in text


@pytest.mark.parametrize("compliance", [2e-3, 8e-4])
def test_pads_that_give_way_keep_their_name(compliance: float) -> None:
    data, _ = simulate(Bench(sensors=(X,), compliance={("y", "x"): compliance}), TURNED, 2)
    found = trace(data, validate=False)
    assert list(named(found)) == ["isolation-pad-deflection"]
    assert not found.sensors["x_V"].refused


def test_what_only_pads_of_negative_compliance_would_explain_is_said() -> None:
    """A package that hangs below its pads: sensors get terms of their own for it, and the reader learns why."""
    bench = Bench(compliance={("y", "x"): -1.5e-3})
    found = trace(simulate(bench, D1(180, 13, 7, replications=2), 3)[0], validate=False)
    for sensor in found.sensors.values():
        assert "isolation-pad-deflection" not in {e.effect for e in sensor.added}
        assert any("a package that hangs below its pads" in note for note in sensor.notes)


SIGNED = {effect.name for effect in CATALOGUE if effect.signed}


@pytest.mark.parametrize("name", [name for name, hidden in HIDDEN.items() if hidden.effect in SIGNED])
def test_a_signed_effect_that_is_there_is_not_refused(name: str) -> None:
    hidden = HIDDEN[name]
    signed = next(e for e in CATALOGUE if e.name == hidden.effect)
    data, _ = simulate(hidden.bench(3 * hidden.unit), D1(180, 13, 7, replications=2), 4, **hidden.options)
    found = trace(data, validate=False)
    assert hidden.effect in {c.effect.name for c in found.chosen}
    for candidate, gamma in zip(found.chosen, found.gamma, strict=True):
        if candidate.effect.name == hidden.effect:
            assert signed.sign(candidate.term.name) * gamma >= 0
    assert hidden.effect not in {r.effect for s in found.sensors.values() for r in s.refused}


@pytest.mark.parametrize(("name", "size"), [("carry-over", 8e-4), ("leak", 4e-3)], ids=str)
def test_a_line_loses_nothing_that_it_cannot_lose(name: str, size: float) -> None:
    """What is there keeps its name; the same with the other sign is refused."""
    field = {"carry-over": "carry_over", "leak": "leak_per_h"}[name]
    effect = {"leak": "line-leak"}.get(name, name)
    assert next(e for e in PRESSURE_CATALOGUE if e.name == effect).signed is not None
    two = (Transducer(), Transducer(sensitivity=1.7))
    there = trace_whole_plots(simulate_pressure(PressureBench(two, **{field: size}), seed=2), validate=False)
    first = there.sensors["bridge_1_mV"]
    assert effect in {first.added[0].effect, *first.added[0].aliases}
    assert not first.refused
    other = trace_whole_plots(simulate_pressure(PressureBench(two, **{field: -size}), seed=2), validate=False)
    assert effect not in {c.effect.name for c in other.chosen}
    refused = [r for s in other.sensors.values() for r in s.refused if r.effect == effect]
    assert refused
    assert all(r.value < -3 * r.stderr for r in refused)


def test_backlash_of_the_simulated_bench_is_positive(tmp_path: Path) -> None:
    path = make(tmp_path, {"backlash": {"pitch_arcsec": 20.0}}, pitches=9, replications=6)
    (effect,) = json.loads(rig("trace", path, "--json").stdout)["sensors"]["x_V"]["effects"]
    assert effect["effect"] == "backlash-pitch"
    assert float(effect["size"].removesuffix(" arcsec")) == pytest.approx(20.0, abs=2.0)


def test_intervals_cover_every_cause_that_the_data_cannot_separate() -> None:
    """Without it S was 15 standard errors off: pads were named, and it was a cube."""
    true = truth(TILTED)["S_V"]
    for seed in (0, 1):
        one, calibration = kept(cubic(-2e-4, pitch_backlash_deg=2e-3), TILTED, seed)
        row = one["parameters"]["S_V"]
        assert "isolation-pad-deflection" in one["effects"]
        low, high = row["interval95_as_named"]
        assert not low < true < high, "as named it is wrong, or this shows nothing"
        assert row["interval95"][0] < true < row["interval95"][1]
        assert row["depends_on"][0][:2] == ["isolation-pad-deflection", "sensor-third-order"]
        assert row["sentence"] in one["depends_on"]
        assert row["sentence"].startswith("S depends on which of isolation-pad-deflection, sensor-third-order")
        assert any("isolation-pad-deflection or sensor-third-order or" in note for note in calibration.notes)


def test_a_trace_says_which_parameters_depend_on_the_cause() -> None:
    traced = trace_attitude_table(table_of(simulate(cubic(-2e-4), TILTED, 1)[0]))
    told = traced.to_json()["sensors"]["x_V"]["depends_on"]
    assert any(sentence.startswith("S depends on which of isolation-pad-deflection, sensor-third") for sentence in told)


def test_angles_in_use_are_inside_intervals_that_cover_every_cause() -> None:
    bench = cubic(-2e-4)
    data, exact = simulate(bench, TILTED, 1)
    calibration = kept(bench, TILTED, 1)[1]
    found = infer_attitude(calibration, exact["x_V"], roll_deg=0.0) if calibration.roll else infer_attitude(
        calibration, exact["x_V"]
    )  # fmt: skip
    alone = infer_attitude(replace(calibration, alternatives=()), exact["x_V"])
    true = data.pitch_deg
    assert np.all((found.pitch_lo95_deg <= alone.pitch_lo95_deg) & (found.pitch_hi95_deg >= alone.pitch_hi95_deg))
    assert np.all((found.pitch_lo95_deg < true) & (true < found.pitch_hi95_deg))
    wide, narrow = (f.pitch_hi95_deg - f.pitch_lo95_deg for f in (found, alone))
    assert wide.max() > 1.05 * narrow.max()


def test_a_cause_that_nothing_else_resembles_leaves_intervals_as_they_are() -> None:
    one, calibration = kept(Bench(sensors=(X,), pitch_backlash_deg=2e-3), TILTED, 1)
    assert one["effects"] == ["backlash-pitch"]
    assert one["depends_on"] == []
    assert calibration.alternatives == ()


def test_an_interval_says_that_it_leaves_out_what_repeats(tmp_path: Path) -> None:
    """Pads are the same in every replication: their scatter says nothing of an offset that is far from the truth."""
    bench = Bench(sensors=(X,), compliance={("y", "z"): 2e-3}, offset_sd=0.5)
    data, _ = simulate(bench, TURNED, 3)
    fit = fit_all(data)["x_V"]
    told, error = fit.to_dict(), fit.parameters.stderr[0]
    off = abs(fit.parameters.b_V - truth(TURNED)["b_V"])
    assert off > 8 * error
    assert "do not cover model error, which repeats in every replication" in told["intervals_cover"]
    assert off < told["model_error"]["b_V"] < 10 * off
    plain = fit_all(simulate(Bench(sensors=(X,)), TURNED, 3)[0])["x_V"].to_dict()
    assert plain["model_error"] is None
    notes = calibrate_package(data).notes
    assert any("model error, which repeats in every replication, is not in" in note for note in notes)


def test_the_terminal_says_what_intervals_cover(tmp_path: Path) -> None:
    path = make(tmp_path, {"isolation_pad": {"pitch_compliance_deg_per_g": 1.5e-3}}, pitches=13)
    shown = rig("fit", path).stdout
    assert "they do not cover model error, which repeats in every replication" in shown
    assert "lack of fit is significant: a model error of the size that is left" in shown
    assert "hold all the same" not in shown


@dataclass(frozen=True)
class Followed:
    """A run with a sag of the pads that an eccentric head resembles, and the follow-up run that separates them."""

    path: Path
    later: Path
    first: First
    confirmed: Confirmed

    def with_members(self, *members: Member) -> dict:
        """The calibration, had the follow-up run left these members."""
        (answer,) = self.confirmed.answers
        other = replace(answer, members=members)
        judged = replace(self.confirmed.judged, answers=(other,))
        return with_confirmed(self.first, replace(self.confirmed, judged=judged), FitOptions()).to_json()


@pytest.fixture(scope="module")
def pads(tmp_path_factory: pytest.TempPathFactory) -> Followed:
    folder = tmp_path_factory.mktemp("pads")
    path = make(folder, {"isolation_pad": {"pitch_compliance_deg_per_g": 8e-4}}, pitches=13)
    first = open_traced(path)
    plan = plan_for(first, propose(consider(first))[0].variation, dry=True)
    later = run(plan, folder / "later", world_start_s=first.world_s + first.later_s)
    return Followed(path, later, first, judge(first, later))


def test_a_calibration_takes_what_a_follow_up_run_confirmed(tmp_path: Path, pads: Followed) -> None:
    wide = fit_attitude_table(pads.first.traced.table, traced=True)
    assert [one["member"] for one in wide["calibration"]["alternatives"]] == ["head-once-per-turn"]
    out = tmp_path / "package.json"
    done = rig("fit", pads.path, "--confirmed-by", pads.later, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "confirmed by the follow-up run; the calibration has isolation-pad-deflection alone" in done.stdout
    told = json.loads(out.read_text())
    assert told["calibration"]["alternatives"] == []
    record = told["confirmed_by"]
    assert (record["run_id"], record["by_run_id"]) == (pads.path.stem, pads.later.stem)
    (effect,) = record["effects"]
    assert (effect["verdict"], effect["holds"]) == ("confirmed", ["isolation-pad-deflection"])
    assert "standard errors (limit 3." in effect["evidence"]
    assert any("confirmed by the follow-up run" in note for note in told["calibration"]["notes"])
    assert rig("fit", pads.path, "--confirmed-by", tmp_path / "a.csv").returncode == 2


def test_what_a_follow_up_run_leaves_open_stays_in_the_intervals(pads: Followed) -> None:
    (answer,) = pads.confirmed.answers
    sag, head = answer.members
    undecided = pads.with_members(sag, replace(head, sigmas=1.0, p_changed=0.5, fits=True))
    assert undecided["confirmed_by"]["effects"][0]["verdict"] == "undecided"
    assert [one["member"] for one in undecided["calibration"]["alternatives"]] == ["head-once-per-turn"]
    none = pads.with_members(replace(sag, p_changed=1e-9), head)
    assert len(none["calibration"]["alternatives"]) == 1
    assert any("may still be invalid" in note for note in none["calibration"]["notes"])
    other = pads.with_members(replace(head, sigmas=0.0, p_changed=0.5, fits=True, shown=9.0), replace(sag, sigmas=9.0))
    assert other["confirmed_by"]["effects"][0]["verdict"] == "replaced"
    assert other["kept"]["x_V"]["effects"] == ["head-once-per-turn"]
    assert other["calibration"]["alternatives"] == []
    assert any("not applied in use: head-once-per-turn" in note for note in other["calibration"]["notes"])


def test_the_evidence_stands_beside_the_verdict(pads: Followed) -> None:
    (effect,) = pads.confirmed.to_json()["effects"]
    best, other = effect["members"]
    assert effect["verdict"] == "confirmed"
    assert best["sigmas_shown"] > best["limit_sigmas"] >= 3.0
    assert best["p_shown"] < 1e-3
    assert f"by {best['sigmas_shown']:.1f} standard errors (limit {best['limit_sigmas']:.1f}, p " in effect["evidence"]
    assert f"head-once-per-turn: {other['sigmas_behind']:.1f} standard errors worse" in effect["evidence"]
    assert any(effect["evidence"] in sentence for sentence in sentences(pads.confirmed))


def test_a_verdict_beside_an_interval_that_holds_zero_says_what_it_rests_on(pads: Followed) -> None:
    (answer,) = pads.confirmed.answers
    best = answer.members[0]
    assert not best.zero
    weak = replace(best, intervals=tuple((-1.0, 1.0) for _ in best.intervals))
    text = evidence(replace(answer, members=(weak, *answer.members[1:])))
    assert "contains zero" in text
    assert "uses both runs together, with" in text
    nothing = replace(weak, intervals_together=tuple((-1.0, 1.0) for _ in best.intervals))
    assert replace(answer, members=(nothing, *answer.members[1:])).verdict == "not shown"
