"""Changes by a person: what an effect declares about them, forecasts and judgements; the truth is proving/truth's."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import rig
from test_confirm_forecast import traced_run

from proving.truth import attitude
from rig.bench.config import parse_procedure
from rig.fitter.confirm import Later, confirm, questions_of, separation
from rig.fitter.confirm.runs import join
from rig.fitter.effects.manual_changes import Done
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.together import AttitudeTogether
from rig.procedures.attitude.trace import trace
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.run_file.events.by_hand import DoneByHand
from rig.run_file.read.reader import RunReader
from rig.verbs.confirm import judge, open_traced

DAY_S = 86400.0
PADS, CROSS = "isolation-pad-deflection", "cross-axis"
GRID = np.linspace(-180, 180, 13), np.linspace(-180, 180, 7)
SAGS = attitude.Bench(sensors=(attitude.Sensor("x"),), compliance={("y", "x"): 8e-4})
CROSSED = attitude.Bench(sensors=(attitude.Sensor("x", cross=1.4e-5),))
"""A product of the components of about the same size."""


@pytest.fixture(scope="module")
def traced() -> dict:
    """A first run of both benches, traced."""
    runs = {}
    for true, bench in ((PADS, SAGS), (CROSS, CROSSED)):
        first, _ = attitude.simulate(bench, attitude.Plan(*GRID, replications=3), 3)
        runs[true] = first, trace(first)
    return runs


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A dry run of a bench with soft pads, and what `rig confirm --dry` told about it.

    The proposal has a probability of 98 % of settling it: worlds of seeds 5 and 7 to 10 do, that of seed 6 does not.
    """
    print("seed 5")
    folder = tmp_path_factory.mktemp("pads")
    first = traced_run(folder, "x", {"isolation_pad": {"pitch_compliance_deg_per_g": 8e-4}}, 13, seed=5)
    done = rig("confirm", first, "--dry", "--json", "--out", folder)
    assert done.returncode == 0, done.stderr
    return first, json.loads(done.stdout)


def test_a_person_locks_the_pads_half_way_and_the_cause_is_confirmed(followed) -> None:
    told = followed[1]
    (effect,) = told["effects"]
    assert (effect["verdict"], effect["holds"]) == ("confirmed", [PADS])
    assert CROSS in {member["effect"] for member in effect["members"]}
    best = told["proposals"][0]
    assert best["by_hand"] == [
        {"before_replication": 2, "say": "lock the isolation pads under the package", "change": "pads-locked"}
    ]
    assert best["person_hours"] == 0.5
    assert ["lock the isolation pads under the package"] in [pair["by_hand"] for pair in told["inseparable"]]
    with RunReader.open(Path(told["run"])) as reader:
        (done,) = (one.event for one in reader.records(DoneByHand.kind) if isinstance(one.event, DoneByHand))
    assert done.change == "pads-locked"
    assert 2 * done.before == best["points"], "half-way"


def test_without_the_record_of_the_change_its_run_confirms_nothing(followed, monkeypatch) -> None:
    """What the judge reads from the run file decides."""
    first, told = followed
    opened = open_traced(first)
    assert judge(opened, Path(told["run"])).settled
    monkeypatch.setattr(DoneByHand, "kind", "nothing of that kind")
    assert not judge(opened, Path(told["run"])).settled


def test_the_procedure_that_is_written_has_the_step(followed, tmp_path: Path) -> None:
    written = tmp_path / "by_hand.toml"
    shown = rig("confirm", followed[0], "--dry", "--write", written)
    assert shown.returncode == 0, shown.stderr
    assert "lock the isolation pads" in " ".join(shown.stdout.split())
    procedure = parse_procedure(written.read_text(), "by_hand.toml")
    assert [step.change for step in procedure.by_hand] == ["pads-locked"]
    assert "rig done" in written.read_text()


def further(before: attitude.Bench, after: attitude.Bench, *, seed: int = 4):
    """A run of two replications; between them the bench is changed, and the package moved a little."""
    halves = [
        attitude.simulate(b, attitude.Plan(*GRID, replications=1), seed + k)[0] for k, b in enumerate((before, after))
    ]
    later = join(*halves, float(halves[0].elapsed_s.max()) + 900.0)
    return later, Done("pads-locked", later.replicate > later.replicate.min())


def moved(bench: attitude.Bench) -> attitude.Bench:
    """Whoever touches the package moves it, and the sensor's offset."""
    return replace(bench, sensors=tuple(replace(s, Omega_deg=s.Omega_deg + 0.02, b=s.b + 3e-4) for s in bench.sensors))


def judged(traced, true: str, after: attitude.Bench):
    first, found = traced[true]
    before = SAGS if true == PADS else CROSSED
    later, done = further(before, after)
    both = AttitudeTogether.of(found, first, [Later(later, DAY_S, [done])])
    (question,) = questions_of(found)
    assert {m.effect for m in question.members} >= {PADS, CROSS}, "confounded before"
    return confirm(both, question)


def test_what_is_gone_with_the_pads_was_the_pads(traced) -> None:
    answer = judged(traced, PADS, moved(replace(SAGS, compliance={})))
    assert answer.holding == (PADS,)
    assert answer.verdict in ("confirmed", "replaced")
    behind = {m.effect: m.sigmas for m in answer.members}
    assert behind[CROSS] > 10


def test_what_stays_with_locked_pads_is_the_sensors(traced) -> None:
    answer = judged(traced, CROSS, moved(CROSSED))
    assert answer.holding == (CROSS,)
    assert {m.effect: m.sigmas for m in answer.members}[PADS] > 10


def test_half_of_it_gone_is_neither(traced) -> None:
    """The pads were locked badly: neither explanation predicts half of the effect."""
    answer = judged(traced, PADS, moved(replace(SAGS, compliance={("y", "x"): 4e-4})))
    assert answer.verdict in ("none holds", "replaced")
    assert answer.holding not in ((PADS,), (CROSS,))


def test_what_was_not_there_before_the_change_either_is_not_confirmed_by_its_absence(traced) -> None:
    """The effect went by itself between the two runs: its absence after the change proves nothing."""
    first, found = traced[PADS]
    gone = replace(SAGS, compliance={})
    later, done = further(gone, moved(gone))
    (question,) = questions_of(found)
    answer = confirm(AttitudeTogether.of(found, first, [Later(later, DAY_S, [done])]), question)
    assert answer.verdict in ("none holds", "not shown")


def test_the_forecast_knows_what_a_change_separates(traced) -> None:
    first, found = traced[PADS]
    later, done = further(SAGS, SAGS)
    questions = questions_of(found)
    names = [m.effect for m in questions[0].members]
    pair = next(p for p in ((PADS, CROSS), (CROSS, PADS)) if names.index(p[0]) < names.index(p[1]))
    chances = [
        separation(AttitudeTogether.of(found, first, [Later(later, DAY_S, steps)]), questions)[0].chances[pair]
        for steps in ((), (done,))
    ]
    assert chances[0] < 0.2
    assert chances[1] > 0.95


def test_every_change_has_one_word_and_one_sentence() -> None:
    for catalogue in (CATALOGUE, PRESSURE_CATALOGUE):
        changes = {own.change for effect in catalogue for own in effect.by_hand}
        assert len({change.word for change in changes}) == len(changes) > 0
        for change in changes:
            assert change.say[0].islower()
            assert not change.say.endswith(".")


def test_families_have_defaults_and_entries_may_differ() -> None:
    attitude_by_name = {effect.name: effect for effect in CATALOGUE}
    assert attitude_by_name["voltmeter-range"].influence("voltmeter-swapped") == "resizes"
    assert attitude_by_name["isolation-pad-deflection"].influence("pads-locked") == "removes"
    assert attitude_by_name["sensor-second-order"].by_hand == ()
    pressure = {effect.name: effect for effect in PRESSURE_CATALOGUE}
    assert pressure["carry-over"].influence("line-swapped") == "resizes"
    assert pressure["reference-nonlinearity"].influence("line-swapped") is None
    assert pressure["reference-nonlinearity"].influence("gauge-swapped") == "resizes"


def test_a_cause_that_should_have_another_size_and_has_not_is_less_likely(traced) -> None:
    """The same size by chance has a price that grows with the precision of the coincidence."""
    first, found = traced[PADS]
    (question,) = questions_of(found)
    terms = tuple(
        replace(t, effect=replace(t.effect, manual_changes=None, source="voltmeter")) for t in question.members[0].terms
    )
    member = replace(question.members[0], terms=terms)
    asked = replace(question, members=(member, *question.members[1:]))
    sigmas = {}
    for name, after in (("same", SAGS), ("other", replace(SAGS, compliance={("y", "x"): -3e-4}))):
        later, done = further(SAGS, after)
        both = AttitudeTogether.of(found, first, [Later(later, DAY_S, [replace(done, word="voltmeter-swapped")])])
        answer = confirm(both, asked)
        sigmas[name] = {m.effect: m.sigmas for m in answer.members}
    assert 1.0 < sigmas["same"][question.members[0].effect] < 5.0
    assert sigmas["other"][question.members[0].effect] == 0.0


@pytest.mark.parametrize("twice_deg", [0.0, 1.8e-4])
def test_a_cause_is_not_confirmed_by_a_run_that_it_does_not_fit(traced, twice_deg: float) -> None:
    """A further cause appears in the later run only, too small to raise its residuals by half: an elliptic scale."""
    first, found = traced[PADS]
    before = replace(SAGS, pitch_error_deg=(0.0, 0.0, twice_deg, 0.0))
    later, done = further(before, replace(before, compliance={}))
    (question,) = questions_of(found)
    answer = confirm(AttitudeTogether.of(found, first, [Later(later, DAY_S, [done])]), question)
    held = (PADS,) if twice_deg == 0.0 else ()
    assert answer.holding == held
