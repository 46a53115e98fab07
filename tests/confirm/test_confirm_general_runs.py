"""Further runs of any laboratory: steps by hand, hard factors, chosen points, and what is refused at once."""

from __future__ import annotations

from pathlib import Path

import pytest
from certificate_lab import stand
from general_lab import BENCH, PROCEDURE, WORLD, run_dry

from rig.bench.config import parse_procedure
from rig.engine.session import Signals
from rig.errors import UsageError
from rig.procedures.errors import DataError
from rig.procedures.general.confirming import GeneralConfirming
from rig.procedures.general.further_runs import further_runs
from rig.procedures.general.planning import check_declared
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.plan.further_runs import Variation
from rig.runs.controller import start_run
from rig.tables import FileSource
from rig.verbs.budget.evaluation import run_with_register
from rig.verbs.budget.found import found_in
from rig.verbs.budget.result import budget
from rig.verbs.confirm import first as confirm_first
from rig.verbs.confirm.further_plan import plan_for, procedure_text
from rig.verbs.data.result import fit_source

FLOW = """kind = "general"
name = "meters"
replications = 2
[factors.flow_Lpm]
levels = [5, 10, 20, 30, 40, 50]
order = "up-down"
[factors.water_degC]
levels = [15, 25, 35]
hard = true
[model]
formula = "1 + flow_Lpm + flow_Lpm^2 + flow_Lpm:water_degC"
"""
CREEPS = WORLD.replace("noise = 1e-5", 'noise = 1e-5\nhidden = "0.002*(1 - exp(-force_for_s/40))*force_kN"')
BLEED = '[[by_hand]]\nbefore_whole_plot = {}\nsay = "bleed the air"\nchange = "bled"\nvalue = "line_kPa"\n'
NONLINEAR = PROCEDURE.replace('formula = "1 + force_kN"', 'formula = "a*force_kN"\nstart = { a = 0.4 }')


def parsed(text):
    procedure = parse_procedure(text, "procedure.toml")
    assert isinstance(procedure, GeneralProcedure)
    return procedure


def test_a_step_before_every_whole_plot_is_one_before_every_one_of_the_further_run():
    first = parsed(FLOW + "".join(BLEED.format(number) for number in range(1, 7)))
    runs = [run for run in further_runs(first, {}, chamber=False) if run.what.startswith("water_degC between")]
    assert [run.procedure.expand().whole_plots for run in runs] == [2, 4, 8]
    for run in runs:
        again = parsed(procedure_text(run.procedure, run.steps, routine=run.routine))
        places = [step.before_whole_plot for step in again.by_hand]
        assert places == list(range(1, 1 + again.expand().whole_plots))
        assert {step.value for step in again.by_hand} == {"line_kPa"}


def test_all_points_to_choose_from_are_had_with_fewer_replications_and_their_steps():
    first = parsed(
        FLOW.replace("[15, 25, 35]", "[10, 15, 20, 25, 30]") + "".join(BLEED.format(n) for n in range(1, 11))
    )
    group = [run for run in further_runs(first, {}, chamber=False) if run.what == "the same again"]
    whole = GeneralConfirming(None).whole(group, 1)
    assert whole is not None
    assert [step.before_whole_plot for step in whole.procedure.by_hand] == [1, 2, 3, 4, 5]
    assert whole.procedure.expand().whole_plots == 5


def test_chosen_whole_plots_are_as_many_as_the_declared_model_needs():
    first = parsed(FLOW)
    whole = Variation("all", first)
    chosen = GeneralConfirming(None).chosen(whole, [1]).procedure
    assert {point.setpoints[1] for point in chosen.expand().points} == {15.0, 25.0}  # one more: the product needs it
    check_declared(chosen, chosen.expand())
    assert chosen.conduct.tolerances == first.conduct.tolerances or chosen.factors["flow_Lpm"].order == "up-down"
    assert chosen.expand().whole_plots == 4


def test_what_no_run_can_confirm_is_refused_before_the_trace(tmp_path, monkeypatch):
    run, _ = run_dry(tmp_path, NONLINEAR, BENCH)

    def traced(*_args, **_options):
        raise AssertionError("it was traced")

    monkeypatch.setattr(confirm_first, "trace_table", traced)
    with pytest.raises(UsageError, match=r"not linear in their coefficients.*rig chart"):
        confirm_first.open_traced(run)
    linear, _ = run_dry(tmp_path / "linear", PROCEDURE, BENCH)
    with pytest.raises(UsageError, match="leave out --group"):
        confirm_first.open_traced(linear, group=["block"], ignore=["block"])


def test_what_the_trace_ignored_is_ignored_by_the_run_that_confirms_it(tmp_path, monkeypatch):
    """The trace advises --ignore COLUMN, and `rig confirm` refused it: what it had found could not be confirmed."""
    run, _ = run_dry(tmp_path, PROCEDURE, BENCH)
    asked: list[object] = []
    traced = confirm_first.trace_table
    monkeypatch.setattr(confirm_first, "trace_table", lambda *a, **o: asked.append(o) or traced(*a, **o))
    first = confirm_first.open_traced(run, ignore=["force_side"])
    assert asked == [{"ignore": ["force_side"], "quick": True}]
    assert first.command.endswith(" --ignore force_side")
    assert all("force_side" in one.roles.ignore for one in first.traced.each.values())  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A run with creep, and the same again, made to confirm what its trace found without `force_side`."""
    folder = tmp_path_factory.mktemp("pair")
    run = stand(folder, world=CREEPS)
    first = confirm_first.open_traced(run, ignore=["force_side"])
    plan = plan_for(first, Variation("the same again", first.procedure), dry=True)
    paths: list[Path] = []
    start_run(
        plan,
        folder / "later",
        signals=Signals(),
        announce=paths.append,
        on_progress=lambda _: None,
        world_start_s=first.world_s + first.later_s,
    )
    return run, paths[0]


@pytest.fixture
def asked(monkeypatch):
    """What each trace was told to ignore."""
    told: list[object] = []
    traced = confirm_first.trace_table
    monkeypatch.setattr(confirm_first, "trace_table", lambda *a, **o: told.append(o.get("ignore")) or traced(*a, **o))
    return told


def test_what_uses_a_further_run_ignores_what_its_confirmation_ignored(pair, asked):
    """rig fit, budget and certificate traced again with all columns, and could find, silently, something else."""
    run, later = pair
    assert confirm_first.open_asked(run, {}, [later]).ignore == ("force_side",)
    fit_source(FileSource(run), {}, confirmed_by=[later])
    noted = str(budget(run, confirmed_by=later).to_json())
    assert "the trace did not look at force_side" in noted
    assert asked == [["force_side"]] * 3
    of = run_with_register(run, None)
    assert found_in(of, run, [later]).ignored == ("force_side",)


def test_the_option_says_otherwise(pair, asked):
    run, later = pair
    confirm_first.open_asked(run, {"ignore": ["elapsed_s"]}, [later])
    fit_source(FileSource(run), {"ignore": ["elapsed_s"]}, confirmed_by=[later])
    budget(run, confirmed_by=later, ignore=["elapsed_s"])
    assert asked == [["elapsed_s"]] * 3


def test_a_fit_without_a_trace_ignores_nothing(pair):
    with pytest.raises(DataError, match="--ignore is for a trace: with --traced or --confirmed-by"):
        fit_source(FileSource(pair[0]), {"ignore": ["force_side"]})
