"""Further runs of any laboratory: steps by hand, hard factors, chosen points, and what is refused at once."""

from __future__ import annotations

import pytest
from general_lab import BENCH, PROCEDURE, run_dry

from rig.bench.config import parse_procedure
from rig.errors import UsageError
from rig.procedures.general.confirming import GeneralConfirming
from rig.procedures.general.further_runs import further_runs
from rig.procedures.general.planning import check_declared
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.plan.further_runs import Variation
from rig.verbs.confirm import first as confirm_first
from rig.verbs.confirm.further_plan import procedure_text

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
BLEED = '[[by_hand]]\nbefore_whole_plot = {}\nsay = "bleed the air"\nchange = "bled"\nvalue = "line_kPa"\n'
NONLINEAR = PROCEDURE.replace('formula = "1 + force_kN"', 'formula = "a*force_kN"\nstart = { a = 0.4 }')


def parsed(text):
    procedure = parse_procedure(text, "procedure.toml")
    assert isinstance(procedure, GeneralProcedure)
    return procedure


def test_a_step_before_every_whole_plot_is_one_before_every_one_of_the_further_run():
    first = parsed(FLOW + "".join(BLEED.format(number) for number in range(1, 7)))
    runs = [run for run in further_runs(first) if run.what.startswith("water_degC between")]
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
    group = [run for run in further_runs(first) if run.what == "the same again"]
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
    assert asked == [{"ignore": ["force_side"]}]
    assert first.command.endswith(" --ignore force_side")
    assert all("force_side" in one.roles.ignore for one in first.traced.each.values())  # type: ignore[attr-defined]
