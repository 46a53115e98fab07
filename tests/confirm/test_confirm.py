"""rig confirm: effects confounded in one run, separated by a further one; the world knows the truth."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import rig
from dry import SHORT

from rig.bench.config import parse_procedure, parse_toml
from rig.engine.session import Outcome, Signals
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.fitter.confirm import NOTHING, Separation, confirm, confirm_all, separation
from rig.fitter.confirm.compare import Comparison
from rig.fitter.confirm.minor_causes import MinorCause, minor_causes
from rig.procedures.attitude.further_runs import further_runs
from rig.procedures.attitude.model import mounting_matrix
from rig.procedures.attitude.settings import MountingSettings
from rig.procedures.attitude.table import attitude_data
from rig.procedures.plan.further_runs import Variation, possible
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import plan_of
from rig.tables.table_of_run import run_table
from rig.verbs.confirm import (
    Inseparable,
    Proposal,
    consider,
    judge,
    open_traced,
    ordered,
    otherwise,
    plan_for,
    propose,
)
from rig.verbs.confirm.answers import may_be_beside
from rig.verbs.confirm.proposals import MANY, planned

LAB = example("attitude-lab")
PADS = {"isolation_pad": {"pitch_compliance_deg_per_g": 8e-4}}
ECCENTRIC = {"head_error": [{"axis": "pitch", "amplitude_arcsec": 2.5, "periods_per_turn": 1.0}]}


def make(folder: Path, effects, *, pitches: int = 19, replications: int = 3) -> Path:
    """One x sensor, no roll: a sag of the pads and an eccentric head are both sin 2a."""
    bench = parse_toml((LAB / "bench.toml").read_text(), "bench")
    bench["sensors"] = {"x": bench["sensors"]["x"]}
    procedure = parse_toml((LAB / "night.toml").read_text(), "procedure") | {"replications": replications}
    procedure["design"] = {
        "type": "D", "pitch_deg": np.linspace(-180, 180, pitches).tolist(), "roll_deg": [0.0],
    }  # fmt: skip
    texts = {"bench.toml": bench, "procedure.toml": procedure, "world.toml": {"seed": 7, "effects": effects}}
    plan = plan_of({name: toml_text(values) for name, values in texts.items()}, dry=True)
    return run(plan, folder)


def run(plan, folder: Path, **more) -> Path:
    paths: list[Path] = []
    start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None, **more)
    return paths[0]


@pytest.fixture(scope="module")
def sagging(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("sagging"), PADS)


@pytest.fixture(scope="module")
def opened(sagging: Path):
    """That run traced, the best proposal of what to do next, and the further run that did it."""
    first = open_traced(sagging)
    proposal = propose(consider(first))[0]
    plan = plan_for(first, proposal.variation, dry=True)
    return first, proposal, run(plan, sagging.parent / "later", world_start_s=first.world_s + first.later_s)


@pytest.mark.parametrize(
    ("true", "false"),
    [("isolation-pad-deflection", "head-once-per-turn"), ("head-once-per-turn", "isolation-pad-deflection")],
)
def test_the_further_run_tells_which_it_is(tmp_path: Path, sagging: Path, true: str, false: str) -> None:
    first = sagging if true == "isolation-pad-deflection" else make(tmp_path, ECCENTRIC)
    done = rig("confirm", first, "--dry", "--json", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    (effect,) = told["effects"]
    assert effect["holds"] == [true]
    assert effect["verdict"] == ("confirmed" if effect["named"] == true else "replaced")
    behind = {member["effect"]: member["sigmas_behind"] for member in effect["members"]}
    assert behind[true] == 0
    assert behind[false] > 3
    error = told["error"]["x_V"]
    assert error["after_deg"] < error["before_deg"]
    assert Path(told["run"]).exists()


def test_two_causes_that_look_alike_are_told_to_be_two(tmp_path: Path) -> None:
    """Pads and head together: either alone has another size in the further run, and neither is confirmed."""
    first = make(tmp_path, PADS | ECCENTRIC)
    done = rig("confirm", first, "--dry", "--json", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    (effect,) = json.loads(done.stdout)["effects"]
    (held,) = effect["holds"]
    assert set(held.split(" with ")) == {"isolation-pad-deflection", "head-once-per-turn"}
    assert effect["verdict"] == "replaced"
    (both,) = (member for member in effect["members"] if member["effect"] == held)
    ends = next(ends for t, ends in zip(both["terms"], both["interval_95"], strict=True) if "by weight" in t)
    low, high = sorted(map(abs, ends))
    assert low < 8e-4 < high
    told = rig("confirm", first, "--by", json.loads(done.stdout)["run"])
    assert " with " in told.stdout


def test_what_it_says_and_shows_to_a_person(tmp_path: Path, sagging: Path) -> None:
    first = sagging
    page = tmp_path / "confirm.html"
    done = rig("confirm", first, "--dry", "--out", tmp_path, "--report", page)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert "isolation-pad-deflection is confirmed by a further run" in text
    assert "SIMULATED" in text
    assert text.count("data:image/png") == 1, "both models on the further run"
    later = next(line for line in done.stdout.splitlines() if line.endswith(".sqlite") and "judged" not in line)
    assert "isolation-pad-deflection is confirmed by a further run; head-once-per-turn is excluded" in done.stdout
    again = rig("confirm", first, "--by", later)
    assert again.returncode == 0
    assert "head-once-per-turn is excluded" in again.stdout


def test_the_procedure_can_be_had_and_run_by_hand(tmp_path: Path, sagging: Path) -> None:
    first = sagging
    listed = json.loads(rig("confirm", first, "--dry", "--list", "--json").stdout)["proposals"]
    turned = next(
        n for n, p in enumerate(listed, start=1) if p["mounting"] == {"x_deg": 180.0, "y_deg": 0.0, "z_deg": 0.0}
    )
    written = tmp_path / "confirm.toml"
    assert rig("confirm", first, "--dry", "--take", turned, "--write", written).returncode == 0
    procedure = parse_procedure(written.read_text(), "confirm.toml")
    assert procedure.mounting.turned
    assert len(procedure.expand()) == listed[turned - 1]["points"]


def test_nothing_found_is_nothing_to_confirm(tmp_path: Path) -> None:
    done = rig("confirm", make(tmp_path, {}), "--dry", "--out", tmp_path)
    assert done.returncode == 0
    assert "nothing to confirm" in done.stderr
    assert len(list(tmp_path.glob("*.sqlite"))) == 1


def test_what_cannot_be_confirmed_is_refused(tmp_path: Path, sagging: Path) -> None:
    first = sagging
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    for words, why in (
        ((first,), "add --dry"),
        ((tmp_path / "table.csv", "--dry"), "not a run file"),
        ((first, "--dry", "--take", "99"), "--list shows them"),
        ((first, "--world", tmp_path / "table.csv"), "it requires --dry"),
        ((first, "--by", first), "is the traced run itself"),
    ):
        done = rig("confirm", *words, "--out", tmp_path)
        assert done.returncode == 2, done.stderr
        assert why in " ".join(done.stderr.split())


def test_a_further_dry_run_is_made_in_the_same_worlds_next_night(tmp_path: Path) -> None:
    """Interrupted and resumed too: the world goes on where it was, and a drift is not begun again."""
    first = open_traced(make(tmp_path, {"offset_drift": {"uV_per_h": 100.0}}))
    every = possible(further_runs(first.procedure, first.bench.limits, chamber=True), first.bench.limits)
    plan = plan_for(first, next(v for v in every if v.what == "the same again"), dry=True)
    signals, paths = Signals(), []

    def stop_halfway(news) -> None:
        signals.interrupt = "SIGTERM" if news.done >= 10 else None

    began = first.world_s + first.later_s
    broken = start_run(
        plan, tmp_path, signals=signals, announce=paths.append, on_progress=stop_halfway, world_start_s=began
    )
    assert broken.outcome is Outcome.INTERRUPTED
    resumed = resume_run(paths[0], signals=Signals(), on_progress=lambda _: None)
    assert resumed.outcome is Outcome.COMPLETE, resumed.message
    before, later = (run_table(path).columns for path in (first.path, paths[0]))
    assert 0 < later["elapsed_s"][0] < 3 * 3600
    level, middle = (
        [np.mean(t[name][t["pitch_deg"] == 180]) for t in (before, later)] for name in ("x_V", "elapsed_s")
    )
    hours = (began + middle[1] - middle[0]) / 3600
    assert level[1] - level[0] == pytest.approx(100e-6 * hours, rel=0.02)


def test_what_is_predicted_of_a_run_is_what_it_does(opened) -> None:
    """Expected separation against the one that came about; the latter is uncertain by about one."""
    first, proposal, later = opened
    assert (
        separation(
            first.confirming.ways(
                proposal.variation, proposal.variation.procedure.expand(), first.questions, first.later_s
            ),
            first.questions,
        )
        == proposal.separations
    )
    (answer,) = judge(first, later).answers
    behind = {m.effect: m.sigmas for m in answer.members}["head-once-per-turn"]
    sizes = [size for m in answer.members for size in m.sizes.values()]
    assert sizes
    assert all(re.fullmatch(r"\S.* \(.+ to .+\)", size) for size in sizes), sizes
    expected = proposal.separations[0].sigmas["isolation-pad-deflection", "head-once-per-turn"]
    assert abs(behind - expected) < 3.5


def test_a_reading_that_went_wrong_does_not_decide(opened) -> None:
    """One reading off by 300 sd in the further run: pointed at, left out, and the answer is the same."""
    first, _, later = opened
    data = attitude_data(run_table(later))
    wrong = data.outputs["x_V"].copy()
    wrong[7] += 300 * 17e-6
    for values, aside in ((data.outputs["x_V"], ()), (wrong, (7,))):
        both = first.confirming.beside(replace(data, outputs={"x_V": values}), first.later_s)
        answer = confirm(both, first.questions[0])
        assert answer.verdict == "confirmed"
        assert answer.outliers == aside


def test_what_the_two_runs_leave_room_for_beside_the_confirmed_cause_is_said(opened) -> None:
    """Few later readings leave more room for an eccentric head beside the sag than many do."""
    first, _, later = opened
    question = first.questions[0]
    data = attitude_data(run_table(later))
    both = first.confirming.beside(data, first.later_s)
    held = confirm(both, question)
    limits = {}
    for every in (1, 30):
        kept = ~both.fresh
        kept[np.flatnonzero(both.fresh)[::every]] = True
        limits[every] = max((one.up_to for one in minor_causes(Comparison(both.only(kept), question), 0)), default=0.0)
    assert 1 / 3 < limits[30] <= 1.0
    assert limits[1] < limits[30]
    answer = replace(held, minor_causes=(MinorCause("head-once-per-turn", limits[30]),))
    assert f"head-once-per-turn up to {100 * limits[30]:.0f} %" in may_be_beside(answer)
    assert may_be_beside(replace(held, minor_causes=())) == ""


def test_effects_are_judged_beside_what_holds_of_the_others(tmp_path: Path) -> None:
    """A cause named wrongly would spoil the prediction of all that is judged beside it."""
    first = open_traced(make(tmp_path, {**PADS, "third_order": {"ug_per_g3": 40.0}}, pitches=37))
    asked = {question.effect: question for question in first.questions}
    assert set(asked) == {"isolation-pad-deflection", "sensor-third-order"}
    pads, cube = asked.values() if "isolation-pad" in next(iter(asked)) else reversed(asked.values())
    head = next(m for m in pads.members if m.effect == "head-once-per-turn")
    wrong = replace(pads, members=(head, pads.members[0]), terms=head.terms)
    every = possible(further_runs(first.procedure, first.bench.limits, chamber=True), first.bench.limits)
    variation = next(v for v in every if v.what.endswith("turned half a turn about its own x axis"))
    later = run(plan_for(first, variation, dry=True), tmp_path, world_start_s=first.world_s + first.later_s)
    both = first.confirming.beside(attitude_data(run_table(later)), first.later_s)
    judged = confirm_all(both, (wrong, replace(cube, rest=head.terms)))
    assert judged.answers[0].verdict == "replaced"
    error = judged.errors["x_V"]
    assert error.after < 1.3 * error.sigma < error.before


def test_a_run_that_cannot_show_an_effect_does_not_confirm_it(tmp_path: Path, opened) -> None:
    """The first observations of a further run, too few to tell; and a whole one of a world in which there is no sag."""
    first, proposal, later = opened
    plan = plan_for(first, proposal.variation, dry=True, world=toml_text({"seed": 7}))
    without = run(plan, tmp_path, world_start_s=first.world_s + first.later_s)
    for data in (attitude_data(run_table(later)).take(np.arange(2)), attitude_data(run_table(without))):
        judged = confirm_all(first.confirming.beside(data, first.later_s), first.questions)
        assert judged.answers[0].verdict in ("not shown", "none holds", "undecided")


def test_an_incomplete_further_run_is_not_judged(tmp_path: Path, sagging: Path, opened) -> None:
    first, proposal, _ = opened
    signals, paths = Signals(), []

    def stop(news) -> None:
        signals.interrupt = "SIGTERM" if news.done >= 5 else ""

    plan = plan_for(first, proposal.variation, dry=True)
    start_run(plan, tmp_path, signals=signals, announce=paths.append, on_progress=stop,
              world_start_s=first.world_s + first.later_s)  # fmt: skip
    done = rig("confirm", sagging, "--by", paths[0])
    assert done.returncode == 2
    assert "is not complete" in done.stderr


def test_a_turn_is_about_the_packages_own_axis_however_it_stands() -> None:
    standing = MountingSettings(y_deg=90.0, z_deg=180.0)
    procedure = parse_procedure((LAB / "night.toml").read_text(), "night").model_copy(update={"mounting": standing})
    before = mounting_matrix(0.0, 90.0, 180.0)
    turned = {v.what: v.procedure.mounting for v in further_runs(procedure, {}, chamber=True) if v.turned}
    for words, turn in (
        ("half a turn about its own x axis", (180, 0, 0)),
        ("a quarter turn about its own y axis", (0, 90, 0)),
    ):
        now = next(m for what, m in turned.items() if what.endswith(words))
        expected = mounting_matrix(*map(float, turn)) @ before
        np.testing.assert_allclose(mounting_matrix(now.x_deg, now.y_deg, now.z_deg), expected, atol=1e-7)


def _proposal(what: str, chance: float, hours: float) -> Proposal:
    """A run that shows both causes surely, and separates them by this chance."""
    pairs = {("pads", "head"): chance, ("pads", NOTHING): 1.0, ("head", NOTHING): 1.0}
    separation = Separation("pads", dict.fromkeys(pairs, 1.0), dict.fromkeys(pairs, (0.5, 2.0)), pairs)
    return Proposal(Variation(what, parse_procedure(SHORT, "short.toml")), (separation,), hours, "13 x 1", None)


def test_no_run_is_planned_for_an_effect_with_many_explanations_beside_others(opened) -> None:
    """903 pairs of 43 explanations outweighed a lag of 200 standard errors: the longest run came first."""
    first, few = opened[0], opened[0].questions[0]
    many = replace(few, members=few.members[:1] * (MANY + 1))
    assert planned(replace(first, questions=(few, many))).questions == (few,)
    assert planned(replace(first, questions=(many,))).questions == (many,)
    assert planned(first) is first


def test_a_run_that_is_unlikely_to_decide_does_not_come_first_and_is_said_to_be(opened) -> None:
    long, brief, good = _proposal("long", 0.08, 12.0), _proposal("brief", 0.02, 1.0), _proposal("good", 0.6, 30.0)
    assert [p.variation.what for p in ordered((long, brief, good))] == ["good", "brief", "long"]
    assert (long.likely, good.likely) == (False, True)
    never = [Inseparable("pads", ("pads", "head"), 1.0, "")]
    (said,) = otherwise(opened[0], long, never)
    assert said.startswith(
        "it is UNLIKELY to settle everything: probability 8% for its most difficult question, and 12 h"
    )
    assert not list(otherwise(opened[0], good, never))
    assert long.to_json()["likely"] is False
