"""The kind "general" on a bench: orders, people who set factors, reference standards, whole plots, recovery."""

from __future__ import annotations

import csv
import itertools
import json
import random
import re
from itertools import count

import few_points
import general_lab as lab
import numpy as np
import pytest
from command import rig
from few_points import Killed, kill_where, records
from general_lab import BENCH, PROCEDURE, REFERENCE, WORLD, WORLD_WITH_STANDARD, run_dry, written

from rig.bench.config import parse_bench, parse_procedure
from rig.engine.by_hand.to_set import ToSet
from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError
from rig.procedures.general.orders import sides, visits
from rig.procedures.general.planning import advice
from rig.run_file.live import live_path, read_json, request_path
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.sense import judged
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.sims.physics.expression import Formula
from rig.sims.physics.fields import WorldError
from rig.tables.table_of_run import run_table
from rig.units.of_instruments import scale
from rig.verbs.plan.unit_doubts import unit_doubts

TWO = f"""name = "two"
{lab.DVM}{lab.CHAMBER}{lab.PACE}
[sensors.cell]
reader = "dvm"
unit = "mV"
[factors]
bath_degC = "oven"
line_psia = "supply"
[limits]
bath_degC = [-60, 100]
line_psia = [0, 15.5]
"""

# --- orders ------------------------------------------------------------------------------------------------------


def test_up_and_down_visits_the_highest_level_once_and_plans_its_sides():
    run_list = parse_procedure(PROCEDURE, "p").expand()
    assert run_list.column("force_kN") == [0, 1, 2, 5, 2, 1, 0] * 2
    assert [point.sides[0] for point in run_list.points] == [0, 1, 1, 1, -1, -1, -1, -1, 1, 1, 1, -1, -1, -1]


def test_a_sweep_is_never_interrupted_by_another_factor():
    points = [(force, slope) for force in (0.0, 1.0, 5.0) for slope in (0.0, 3.0)]
    found = [p for _, p in visits(points, ["up-down", "random"], [False, False], random.Random(4), None)]
    assert [p[0] for p in found] == [0, 1, 5, 1, 0] * 2
    assert len({p[1] for p in found[:5]}) == len({p[1] for p in found[5:]}) == 1


@pytest.mark.parametrize("seed", range(5))
def test_random_points_are_all_of_the_grid_and_hard_settings_stay_together(seed):
    points = [(float(a), float(b)) for a in range(3) for b in range(4)]
    found = list(visits(points, ["random", "random"], [True, False], random.Random(seed), (1.0,)))
    assert sorted(p for _, p in found) == points
    plots = [number for number, _ in found]
    assert plots == sorted(plots)
    assert all(len({p[0] for n, p in found if n == plot}) == 1 for plot in set(plots))
    assert found[0][1][0] != 1.0, "the last whole plot of the replication before is not repeated at once"


def test_sides_of_settings_that_stay_are_kept_and_hard_ones_have_none():
    settings = [(0.0, 1.0), (2.0, 1.0), (2.0, 5.0), (1.0, 5.0)]
    assert list(sides(settings, [False, True])) == [(0, 0), (1, 0), (1, 0), (-1, 0)]


def test_points_come_from_a_file_which_the_run_file_then_has(tmp_path):
    procedure = PROCEDURE.replace("levels = [0, 1, 2, 5]", "").replace('"up-down"', '"as written"')
    procedure = (
        procedure.replace("replications = 2", "replications = 1") + '[design]\ntype = "file"\npoints = "p.csv"\n'
    )
    files = written(tmp_path, procedure)
    (tmp_path / "p.csv").write_text("# of 2026\nforce_kN\n2\n0\n5\n")
    plan = load_plan(files[0], files[1])
    assert plan.run_list.column("force_kN") == [2, 0, 5]
    again = parse_procedure(plan.documents["procedure.toml"], "stored")
    assert again.expand().sha256() == plan.run_list.sha256()
    for text, says in (
        ("force_kN\nmuch\n", "line 2, force_kN: 'much' is not a number"),
        ("load_kN\n1\n", "has no column force_kN"),
        ("force_kN,x\n1,2\n", "which is not a factor"),
        ("", "is empty"),
    ):
        (tmp_path / "p.csv").write_text(text)
        with pytest.raises(ConfigurationError, match=says):
            load_plan(files[0], files[1])
    (tmp_path / "p.csv").unlink()
    with pytest.raises(ConfigurationError, match="does not exist"):
        load_plan(files[0], files[1])


def from_file(folder, procedure, rows, bench=None):
    """The plan of a procedure whose points are in a file."""
    procedure = re.sub(r"levels = .*\n", "", procedure) + '[design]\ntype = "file"\npoints = "p.csv"\n'
    files = written(folder, procedure, *([] if bench is None else [bench]))
    (folder / "p.csv").write_text(rows)
    return load_plan(files[0], files[1])


def test_rows_of_a_file_as_written_are_steps_in_their_order(tmp_path):
    steps = [0, 1, 2, 5, 5, 2, 1, 0]
    rows = "force_kN\n" + "\n".join(map(str, steps)) + "\n"
    plan = from_file(tmp_path, PROCEDURE.replace('"up-down"', '"as written"'), rows)
    assert plan.run_list.column("force_kN") == steps * 2
    assert [point.sides[0] for point in plan.run_list.points][:8] == [0, 1, 1, 1, 1, -1, -1, -1]
    again = parse_procedure(plan.documents["procedure.toml"], "stored")
    assert again.expand().sha256() == plan.run_list.sha256()
    once = from_file(
        tmp_path, PROCEDURE.replace('"up-down"', '"as written"').replace("replications = 2", "replications = 1"), rows
    )
    assert not [one for one in advice(once.procedure) if "look alike" in one.sentence], "it goes up and down"


@pytest.mark.parametrize("numbered", [True, False])
def test_whole_plots_of_a_file_as_written_keep_their_order(tmp_path, numbered):
    baths = [10, 25, 40, 40, 25, 10]
    lines = [
        f"{plot},{bath},{line}" if numbered else f"{bath},{line}"
        for plot, bath in enumerate(baths, 1)
        for line in (1, 5, 3, 1)
    ]
    rows = "\n".join(["whole_plot,bath_degC,line_psia" if numbered else "bath_degC,line_psia", *lines]) + "\n"
    both = TWO_FACTORS.replace("[factors.line_psia]", '[factors.line_psia]\norder = "as written"')
    both = both.replace("HARD\n[design]\nDESIGN\n", 'hard = true\norder = "as written"\n')
    run_list = from_file(tmp_path, both, rows, TWO).run_list
    assert run_list.column("bath_degC") == [bath for bath in baths for _ in range(4)] * 2
    assert run_list.column("line_psia") == [1, 5, 3, 1] * 12
    plots = [point.whole_plot for point in run_list.points]
    assert plots == sorted(plots)
    assert run_list.whole_plots == (12 if numbered else 10), "neighbours share one if not numbered"


def test_a_factor_that_is_varied_and_in_no_model_is_said_to_be_left_to_the_residual(tmp_path):
    files = written(tmp_path, TWO_FACTORS.replace("HARD\n[design]\nDESIGN\n", ""), TWO)
    bath = "bath_degC is varied and in no sensor's model"

    def said(formula, more=""):
        text = re.sub(r'formula = ".*"', f'formula = "{formula}"', files[0].read_text()) + more
        return [one.sentence for one in advice(parse_procedure(text, "p")) if bath in one.sentence]

    (one,) = said("1 + line_psia")
    assert "goes into the residual, and calibrations hold at its mean, 25 degC; `+ bath_degC` in model.formula" in one
    assert not said("1 + line_psia + bath_degC")
    assert not said("1 + line_psia + oven_air_degC"), "a thermometer may follow it"
    assert not said("1 + line_psia", '[model.cell]\nformula = "1 + line_psia + bath_degC"\n')


def test_whole_plots_as_written_whose_rows_are_apart_are_refused(tmp_path):
    rows = "whole_plot,bath_degC,line_psia\n1,10,1\n2,40,1\n1,10,5\n"
    procedure = TWO_FACTORS.replace("HARD\n[design]\nDESIGN\n", 'hard = true\norder = "as written"\n')
    with pytest.raises(ConfigurationError, match=r"whole plot 1 of the points are not together.*number of their own"):
        from_file(tmp_path, procedure, rows, TWO)


TWO_FACTORS = """kind = "general"
name = "two"
seed = 4
replications = 2
[factors.line_psia]
levels = [1, 2, 3, 4, 5]
[factors.bath_degC]
levels = [10, 25, 40]
HARD
[design]
DESIGN
[model]
formula = "(line_psia + bath_degC)^2 + line_psia^2 + bath_degC^2"
"""


def planned(folder, design, hard=""):
    files = written(folder, TWO_FACTORS.replace("DESIGN", design).replace("HARD", hard), TWO)
    return load_plan(files[0], files[1])


def test_a_central_composite_design_stays_within_the_levels(tmp_path):
    plan = planned(tmp_path, 'type = "central-composite"\ncentre = 3')
    points = {tuple(p.setpoints) for p in plan.run_list.points}
    assert len(plan.run_list) == 2 * (4 + 4 + 3)
    assert {(1.0, 25.0), (5.0, 25.0), (3.0, 10.0), (3.0, 40.0), (3.0, 25.0)} <= points
    corner = 3 - 2 / np.sqrt(2)
    assert min(abs(p[0] - corner) for p in points) < 1e-9, "the cube is inside by the square root of two"


def test_an_optimal_design_is_searched_once_and_is_then_in_the_run_file(tmp_path):
    plan = planned(tmp_path, 'type = "optimal"\npoints = 9')
    assert len(plan.run_list) == 18
    corners = {(a, b) for a in (1.0, 5.0) for b in (10.0, 40.0)}
    assert corners < {tuple(p.setpoints) for p in plan.run_list.points}, (
        "the D-optimal nine are the 3 x 3 (Box, Draper)"
    )
    stored = parse_procedure(plan.documents["procedure.toml"], "stored")
    assert stored.design.rows is not None
    assert stored.expand().sha256() == plan.run_list.sha256()


def test_hard_factors_of_an_optimal_design_are_its_whole_plots(tmp_path):
    with pytest.raises(ConfigurationError, match="say their number"):
        planned(tmp_path, 'type = "optimal"\npoints = 16', "hard = true")
    plan = planned(tmp_path, 'type = "optimal"\npoints = 16\nwhole_plots = 5', "hard = true")
    assert plan.run_list.whole_plots == 10
    for plot in range(1, 11):
        assert len({p.setpoints[1] for p in plan.run_list.points if p.whole_plot == plot}) == 1
    with pytest.raises(ConfigurationError, match="no factor is hard to change"):
        planned(tmp_path, 'type = "optimal"\npoints = 16\nwhole_plots = 5')


def test_a_file_of_points_may_say_its_whole_plots(tmp_path):
    text = "whole_plot,bath_degC,line_psia\n1,10,1\n1,10,5\n2,40,1\n2,40,5\n3,10,3\n3,10,1\n4,25,2\n4,25,3\n"
    (tmp_path / "p.csv").write_text(text)
    procedure = re.sub(r"levels = .*\n", "", TWO_FACTORS).replace("DESIGN", 'type = "file"\npoints = "p.csv"')
    files = written(tmp_path, procedure.replace("HARD", "hard = true"), TWO)
    plan = load_plan(files[0], files[1])
    assert plan.run_list.whole_plots == 8
    at = [plan.run_list.setting(p)["bath_degC"] for p in plan.run_list.points][::2]
    assert all(a != b for a, b in itertools.pairwise(at)), "equal temperatures do not follow each other"
    for wrong, says in (("4,25,3", "4,10,3"), ("2,40,5", "2.5,40,5")):
        (tmp_path / "p.csv").write_text(text.replace(wrong, says))
        with pytest.raises(ConfigurationError, match=r"two settings|not a whole number"):
            load_plan(files[0], files[1])


@pytest.mark.parametrize(
    ("of", "to", "times"), [("V", "mV", 1e3), ("mV", "V", 1e-3), ("V", "V", 1), ("kN", "N", 1e3), ("ohm", "kohm", 1e-3)]
)
def test_units_differ_by_a_prefix_at_most(of, to, times):
    assert scale(of, to) == pytest.approx(times, rel=1e-15)
    assert scale(of, "degC") is None
    assert scale("min", "in") is None


# --- refused before anything moves -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("bench", 'force_kN = "operator"\n[limits]\nforce_kN = [0, 10]', ""), "does not say what sets force_kN"),
        (("bench", 'force_kN = "operator"', 'force_kN = "dvm"'), "dvm sets nothing"),
        (("bench", 'force_kN = "operator"', 'force = "operator"'), "must end in its unit"),
        (("bench", 'driver = "person"', 'driver = "person"\naddress = "/dev/x"'), "a person has no address"),
        (("bench", 'driver = "person"', 'driver = "person"\nsay = "do it"'), "with {value} in it"),
        (("bench", "force_kN = [0, 10]", "force_kN = [0, 4]"), "point 3 asks for force_kN = 5, outside 0 to 4"),
        (("bench", '"dvm"\n[factors]', '"dvm"\nunit = "kN"\n[factors]'), "channel input of dvm reads V, not kN"),
        (
            ("bench", '"dvm"\n[factors]', '"dvm"\nunit = "mV_per_V"\n[factors]'),
            "a ratio is read by a meter that gives it: name one as the reader, such as a scpi-meter with",
        ),
        (
            ("procedure", '"1 + force_kN"', '"1 + force_kN + force_kN^2 + force_kN^3 + force_kN^4"'),
            "it does not determine",
        ),
        (("procedure", '"1 + force_kN"', '"1 + load_kN"'), "load_kN is not a factor"),
        (("procedure", '"1 + force_kN"', '"1 + + "'), "model.formula"),
        (("procedure", "[0, 1, 2, 5]", "[0, 1, 1, 5]"), "levels has 1 twice"),
        (("procedure", "[factors.force_kN]", "[factors.force]"), "must end in its unit"),
        (("procedure", "[factors.force_kN]", "[factors.elapsed_s]"), "a column of this name already"),
        (
            ("procedure", "[model]", '[design]\ntype = "optimal"\npoints = 1\n[model]'),
            "1 points cannot determine 2 terms",
        ),
        (("procedure", "levels = [0, 1, 2, 5]\n", ""), 'design "grid" needs its levels'),
    ],
)
def test_what_cannot_be_carried_out_is_one_message_and_leaves_nothing(tmp_path, change, says):
    texts = {"procedure": PROCEDURE, "bench": BENCH}
    which, old, new = change
    assert old in texts[which]
    files = written(tmp_path, **{**texts, which: texts[which].replace(old, new, 1)})
    done = rig("run", files[0], "--bench", files[1], "--dry", "--out", tmp_path / "runs")
    assert done.returncode == 78, done.stderr
    assert says in " ".join(done.stderr.split())
    assert not list(tmp_path.glob("runs/*.sqlite"))


def test_two_factors_need_two_instruments(tmp_path):
    bench = (
        f'name = "t"\n{lab.DVM}{lab.PACE}[sensors.a]\nreader = "dvm"\n[factors]\na_psia = "supply"\nb_psia = "supply"\n'
    )
    procedure = 'kind = "general"\nname = "t"\n[model]\nformula = "1 + a_psia"\n'
    procedure += "".join(f"[factors.{name}_psia]\nlevels = [1, 2]\n" for name in "ab")
    files = written(tmp_path, procedure, bench)
    with pytest.raises(ConfigurationError, match="supply cannot set both a_psia and b_psia"):
        load_plan(files[0], files[1])
    with pytest.raises(ConfigurationError, match="supply sets psia, not kPa: call the factor a_psia"):
        load_plan(*written(tmp_path, procedure.replace("a_psia", "a_kPa"), bench.replace("a_psia", "a_kPa"))[:2])


# --- a person sets a factor --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    path, result = run_dry(tmp_path_factory.mktemp("weights"))
    assert result.outcome is Outcome.COMPLETE, result.message
    return path


def sound(path):
    with RunReader.open(path) as reader:
        assert judged(reader, 10).findings == ()


def test_a_run_of_weights_asks_for_each_and_its_table_has_them(weights):
    table = run_table(weights)
    force = table.columns["force_kN"]
    assert force.tolist() == [0, 1, 2, 5, 2, 1, 0] * 2
    assert table.columns["cell_V"] == pytest.approx(0.1 + 0.5 * force, abs=2e-4), (
        "the truth of the world, and the noise"
    )
    names = list(table.columns)
    assert names[:5] == ["replicate", "order", "elapsed_s", "force_kN", "force_side"]
    assert names[-1] == "cell_V", "outputs come last"
    since, gap = table.columns["force_since_s"], np.diff(table.columns["elapsed_s"])
    assert np.all((since > 5.0) & (since < 15.0) | (np.arange(14) == 7)), "dwell and reading; the last weight stands"
    assert since[7] == pytest.approx(since[6] + gap[6], abs=2e-3)
    assert table.columns["block"].tolist() == [1] * 14, "a setting is no change of the bench"
    asked = [r.event.setpoint for r in records(weights, "by-hand", "asked-to-set")]
    assert asked == [0, 1, 2, 5, 2, 1, 0, 1, 2, 5, 2, 1, 0], "weights that stand are not asked for"
    assert [r.event.setpoint for r in records(weights, "by-hand", "set")] == asked
    sound(weights)


def test_the_run_is_fitted_traced_and_inferred_by_the_declared_model(weights, tmp_path):
    fitted = rig("fit", weights, "--out", tmp_path / "cell.json", "--json")
    assert fitted.returncode == 0, fitted.stderr
    found = json.loads(fitted.stdout)["coefficients"]
    for name, true in (("1", 0.1), ("force_kN", 0.5)):
        assert abs(found[name]["estimate"] - true) < 4 * found[name]["stderr"]
    traced = rig("trace", weights, "--json")
    assert json.loads(traced.stdout)["sensors"]["cell_V"]["verdict"] == "nothing to add"
    (tmp_path / "used.csv").write_text("cell_V\n1.35\n9\n")
    inferred = rig("infer", tmp_path / "cell.json", tmp_path / "used.csv", "--out", tmp_path / "forces.csv")
    assert inferred.returncode == 0, inferred.stderr
    header, first, second = (tmp_path / "forces.csv").read_text().splitlines()
    assert float(first.split(",")[header.split(",").index("force_kN")]) == pytest.approx(2.5, abs=1e-3)
    assert "outside" in second
    exported = rig("export", weights, "--out", tmp_path / "t.csv")
    assert exported.returncode == 0, exported.stderr
    of_csv = rig("fit", tmp_path / "t.csv", "--response", "cell_V", "--formula", "1 + force_kN", "--json")
    again = json.loads(of_csv.stdout)["coefficients"]
    assert again["force_kN"]["estimate"] == pytest.approx(found["force_kN"]["estimate"], rel=1e-12)


LABS = {
    "weights": (PROCEDURE, BENCH, WORLD),
    "source": (lab.SOURCE_PROCEDURE, lab.SOURCE, lab.SOURCE_WORLD),
    "standard": (PROCEDURE, BENCH + REFERENCE, WORLD_WITH_STANDARD),
}


@pytest.mark.parametrize(
    ("which", "seed"), [("weights", 0), ("weights", 1), ("source", 2), ("source", 3), ("standard", 4)]
)
def test_killed_at_any_moment_it_resumes_asks_again_and_loses_nothing(tmp_path, which, seed):
    rng, paths, left = random.Random(seed), [], count()
    at = {rng.randrange(1, 150) for _ in range(3)}
    print(f"seed {seed}: killed at the reports {sorted(at)}")
    files = written(tmp_path, *LABS[which])
    plan = load_plan(files[0], files[1], dry=True, world=files[2])

    def killing(news):
        if next(left) in at:
            raise Killed

    try:
        start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=killing)
        outcome = Outcome.COMPLETE
    except Killed:
        outcome = None
    while outcome is None:
        try:
            outcome = resume_run(paths[0], signals=Signals(), on_progress=killing).outcome
        except Killed:
            continue
    assert outcome is Outcome.COMPLETE
    sound(paths[0])
    table, (factor,) = run_table(paths[0]), plan.run_list.factors
    order = np.argsort(table.columns["run_index"])
    set_to = table.columns[factor.set_name if which == "standard" else factor.name]
    assert set_to[order].tolist() == plan.run_list.column(factor.name)
    for record in few_points.accepted(paths[0]):
        side = plan.run_list.points[record.run_index].sides[0]
        assert not side or record.event.approach[factor.axis][0] == side


def test_after_a_kill_the_setting_before_is_asked_for_first(tmp_path):
    files = written(tmp_path)
    plan, paths = load_plan(files[0], files[1], dry=True, world=files[2]), []

    with pytest.raises(Killed):
        start_run(
            plan,
            tmp_path,
            signals=Signals(),
            announce=paths.append,
            on_progress=kill_where(lambda news: news.done == 5),
        )
    assert resume_run(paths[0], signals=Signals(), on_progress=lambda _: None).outcome is Outcome.COMPLETE
    asked = [(r.session, r.event.setpoint) for r in records(paths[0], "by-hand", "asked-to-set")]
    assert [value for session, value in asked if session == 2][:3] == [2, 1, 0], "down from 2, as planned"


class Says:
    """Somebody who answers while the run holds, and what they were told."""

    def __init__(self, folder, *values):
        self.folder, self.values, self.refused = folder, list(values), []
        self._ids, self._sent = count(), ""

    def __call__(self, news):
        (path,) = self.folder.glob("*.sqlite")
        live = read_json(live_path(path)) or {}
        if self._sent and live.get("acknowledged") == self._sent:
            self.refused.append(live["refused"])
            self._sent = ""
        if news.state == "holding" and live.get("asked") and not self._sent and self.values:
            self._sent = f"id-{next(self._ids)}"
            verb, value = self.values.pop(0)
            request = {"id": self._sent, "session": 1, "verb": verb, "value": value, "who": "A. Weigher"}
            request_path(path).write_text(json.dumps(request))


def test_nonsense_of_a_person_is_refused_and_a_stated_value_is_the_abscissa(tmp_path):
    says = Says(
        tmp_path,
        ("done", "much"),
        ("done", "12"),
        ("done", "1.5"),
        ("done", "nan"),
        ("release", None),
        ("done", "0.003"),
    )
    world = WORLD.replace("sets_s = 20", "sets_s = 20\ncomes = false")
    path, result = run_dry(
        tmp_path, world=world, procedure=f"{PROCEDURE}[recovery]\nhold_max_s = 40\n", on_progress=says
    )
    assert result.outcome is Outcome.INTERRUPTED
    assert "nobody said within" in result.message
    assert "put" not in result.message
    said = says.refused
    assert "'much' is not a number" in said[0]
    assert "outside the limits of force_kN, 0 to 10" in said[1]
    assert "is not 0 within 0.1" in said[2]
    assert "finite" in said[3]
    assert "does not say that it was done" in said[4]
    assert said[5] == ""
    table = run_table(path)
    assert table.columns["force_kN"].tolist() == [0.003]
    assert table.columns["force_set_kN"].tolist() == [0.0]
    (done,) = records(path, "by-hand", "set")
    assert (done.event.number, done.event.who) == (0.003, "A. Weigher")
    sound(path)


def test_values_are_judged_against_setpoint_and_limits():
    factor = parse_procedure(PROCEDURE, "p").expand().factor("force_kN")
    asked = ToSet(factor, 5.0, "set it", 0.1, (0.0, 10.0))
    assert asked.refuses(None) == asked.refuses("5.09") == ""
    assert "5_0" in asked.refuses("5_0")
    assert "inf" in asked.refuses("inf")


# --- a reference standard ----------------------------------------------------------------------------------------


def test_the_standard_is_the_abscissa_and_the_setpoint_stands_beside_it(tmp_path):
    path, result = run_dry(tmp_path, bench=BENCH + REFERENCE, world=WORLD_WITH_STANDARD)
    assert result.outcome is Outcome.COMPLETE, result.message
    table = run_table(path)
    assert table.columns["force_kN"] == pytest.approx(1.01 * table.columns["force_set_kN"], abs=1e-4)
    assert table.columns["force_set_kN"].tolist() == [0, 1, 2, 5, 2, 1, 0] * 2
    found = json.loads(rig("fit", path, "--json").stdout)["coefficients"]["force_kN"]
    assert abs(found["estimate"] - 0.5) < 4 * found["stderr"], "not 0.505, which the setpoints would say"
    sound(path)


def test_a_standard_that_disagrees_is_a_fault_and_then_a_mark(tmp_path):
    far = WORLD_WITH_STANDARD.replace("1.01*set", "1.2*set")
    path, result = run_dry(tmp_path, bench=BENCH + REFERENCE, world=far)
    assert result.outcome is Outcome.COMPLETE
    flags = {r.run_index: tuple(r.event.flags) for r in few_points.accepted(path)}
    far_off = {p.index for p in parse_procedure(PROCEDURE, "p").expand().points if 0.2 * p.setpoints[0] > 0.1}
    assert {index for index, found in flags.items() if found == ("reference",)} == far_off
    faults = [r.event for r in records(path, "fault")]
    assert "the reference of force reads 1.2" in faults[0].message
    assert "set to 1: more than 0.1 apart" in faults[0].message
    sound(path)
    strict = PROCEDURE + '[faults]\nreference = "abort"\n'
    _, result = run_dry(tmp_path / "strict", procedure=strict, bench=BENCH + REFERENCE, world=far)
    assert result.outcome is Outcome.FAULT
    assert "look at the standard's formula" in result.message


def test_a_formula_of_a_standard_is_checked(tmp_path):
    for formula, says in (("4 * volts", "its variable is `reading`, not volts"), ("4 *", "formula"), ("4", "has none")):
        files = written(tmp_path, bench=BENCH + REFERENCE.replace("4 * reading", formula))
        with pytest.raises(ConfigurationError, match=says):
            load_plan(files[0], files[1])


# --- instruments that set, and whole plots ------------------------------------------------------------------------

OF_TWO = """seed = 2
[sensors.cell]
formula = "100 + 500*line_psia + 10*bath_degC"
noise = 0.01
"""
HARD = """kind = "general"
name = "two"
[factors.line_psia]
levels = [1, 5]
band = 0.003
[factors.bath_degC]
levels = [10, 40]
hard = true
[soak]
dwell_s = 3600
[settle]
dwell_s = 10
[model]
formula = "1 + line_psia + bath_degC"
"""


def test_hard_factors_are_whole_plots_soaked_and_measured(tmp_path):
    path, result = run_dry(tmp_path, HARD, TWO, OF_TWO)
    assert result.outcome is Outcome.COMPLETE, result.message
    table = run_table(path)
    assert table.columns["whole_plot"].tolist() == [1, 1, 2, 2]
    assert abs(table.columns["bath_degC"] - table.columns["bath_set_degC"]).max() < 0.5
    true = 100 + 500 * table.columns["line_psia"] + 10 * table.columns["bath_degC"]
    assert table.columns["cell_mV"] == pytest.approx(true, abs=5), "the body follows the chamber to half a degree"
    assert len(records(path, "event", "whole-plot")) == 2
    sound(path)


def test_a_chamber_can_be_an_easy_factor(tmp_path):
    easy = HARD.replace("hard = true\n[soak]\ndwell_s = 3600", "band = 0.2").replace(
        "dwell_s = 10", "dwell_s = 60\ntimeout_s = 7200"
    )
    path, result = run_dry(tmp_path, easy, TWO, OF_TWO)
    assert result.outcome is Outcome.COMPLETE, result.message
    table = run_table(path)
    assert "whole_plot" not in table.columns
    assert abs(table.columns["bath_degC"] - table.columns["bath_set_degC"]).max() < 0.2
    sound(path)


def test_a_source_sets_is_read_back_and_is_off_at_the_end(tmp_path):
    path, result = run_dry(tmp_path, *LABS["source"])
    assert result.outcome is Outcome.COMPLETE, result.message
    table = run_table(path)
    volts = table.columns["input_V"]
    assert sorted(volts) == sorted([-5, 0, 2, 5] * 2), "a source's setpoint is the abscissa"
    assert table.columns["input_readback_V"] == pytest.approx(volts, abs=1e-3)
    assert table.columns["meter_V"] == pytest.approx(1e-5 + 1.00002 * volts, abs=5e-5)
    (safe,) = records(path, "event", "safe")
    assert safe.event.found["calibrator"]["safe"] is True
    assert not safe.event.unsafe
    sound(path)


def test_a_source_of_another_unit_is_refused_and_nothing_is_sent(tmp_path):
    procedure, bench = (text.replace("input_V", "input_mV") for text in (lab.SOURCE_PROCEDURE, lab.SOURCE))
    files = written(tmp_path, procedure, bench)
    done = rig("run", files[0], "--bench", files[1], "--dry", "--out", tmp_path / "runs")
    assert done.returncode == 78
    assert "calibrator sets V, not mV: call the factor input_V" in " ".join(done.stderr.split())
    assert not list(tmp_path.glob("runs/*.sqlite"))


def test_a_source_that_falls_silent_is_a_fault_after_its_retries_and_the_run_can_be_resumed(tmp_path):
    silent = '[[faults]]\nkind = "unplugged"\non = "calibrator"\nat_s = 30\nfor_s = 7200\n'
    path, result = run_dry(tmp_path, lab.SOURCE_PROCEDURE, lab.SOURCE, lab.SOURCE_WORLD + silent)
    assert result.outcome is Outcome.UNSAFE
    assert "calibrator" in result.message
    assert resume_run(path, signals=Signals(), on_progress=lambda _: None, dry_gap_s=8000.0).outcome is Outcome.COMPLETE
    sound(path)


@pytest.fixture(scope="module")
def thermometers(tmp_path_factory):
    path, result = run_dry(tmp_path_factory.mktemp("bath"), lab.BATH_PROCEDURE, lab.BATH, lab.BATH_WORLD)
    assert result.outcome is Outcome.COMPLETE, result.message
    return path


def test_a_bath_is_a_source_that_is_hard_to_change_and_a_standard_reads_it(thermometers):
    table = run_table(thermometers)
    set_to = table.columns["bath_set_degC"]
    assert sorted(set_to) == sorted([0, 25, 50, 75, 100] * 2)
    assert table.columns["bath_degC"] == pytest.approx(1.001 * set_to - 0.03, abs=0.01), "the truth, not the setpoint"
    assert len(records(thermometers, "event", "whole-plot")) == 10
    sound(thermometers)


def test_sensors_of_one_run_are_calibrated_and_used_together(thermometers, tmp_path):
    fitted = rig("fit", thermometers, "--json", "--out", tmp_path / "c.json")
    assert fitted.returncode == 0, fitted.stderr
    found = json.loads(fitted.stdout)["sensors"]
    assert list(found) == ["prt_1_V", "prt_2_mV"]
    slope = found["prt_1_V"]["coefficients"]["bath_degC"]
    assert abs(slope["estimate"] - 0.1 * 3.9083e-3) < 4 * slope["stderr"]
    assert any("every whole plot has one reading" in note for note in found["prt_1_V"]["notes"])
    rig("export", thermometers, "--out", tmp_path / "t.csv")
    done = rig("infer", tmp_path / "c.json", tmp_path / "t.csv", "--out", tmp_path / "degC.csv")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((tmp_path / "degC.csv").read_text().splitlines()))
    for row in rows:
        for sensor in ("prt_1", "prt_2"):
            true, sd = float(row["bath_degC"]), float(row[f"{sensor}_bath_degC_sd"])
            assert abs(float(row[f"{sensor}_bath_degC"]) - true) < 5 * sd
    (tmp_path / "one.csv").write_text("prt_2_mV\n119.4\n")
    done = rig("infer", tmp_path / "c.json", tmp_path / "one.csv", "--out", tmp_path / "one_degC.csv")
    assert done.returncode == 0, done.stderr
    assert "bath_degC_lo95" in (tmp_path / "one_degC.csv").read_text()
    (tmp_path / "none.csv").write_text("prt_3_mV\n119.4\n")
    done = rig("infer", tmp_path / "c.json", tmp_path / "none.csv", "--out", tmp_path / "no.csv")
    assert done.returncode == 2
    assert "prt_1_V, prt_2_mV" in done.stderr


# --- plans and worlds ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "why"),
    [
        ('formula = "a + b*exp(c*force_kN)"\nstart = { a = 0, b = 1, c = 0.1 }', "not linear in its coefficients, so"),
        ('formula = "1 + force_kN + lab_degC"', "the model: no precision is predicted: lab_degC of its model is only"),
    ],
)
def test_a_plan_without_predicted_precision_says_why_and_has_no_empty_table(tmp_path, model, why):
    procedure = PROCEDURE.replace('formula = "1 + force_kN"', model)
    bench = f"""{BENCH}
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
channels = {{ "101" = "rtd-4w-385" }}
[temperatures.lab_degC]
reader = "scanner"
channel = "101"
place = "lab"
"""
    files = written(tmp_path, procedure, bench)
    shown = rig("plan", files[0], "--bench", files[1])
    assert shown.returncode == 0, shown.stderr
    assert why in " ".join(shown.stdout.split())
    assert "Predicted precision" not in shown.stdout


def test_a_plan_of_unknown_scatter_has_no_predicted_precision_and_no_number_that_looks_like_one(tmp_path):
    """It had a table of standard deviations "of any sensor", for a scatter of 1 that nobody stated."""
    files = written(tmp_path, PROCEDURE)
    shown = rig("plan", files[0], "--bench", files[1])
    told = " ".join(shown.stdout.split())
    assert "Predicted precision" not in shown.stdout
    assert "any sensor: no precision is predicted: its scatter is not known. [expect] states it" in told
    assert "no total uncertainty is predicted: the bench has no register" in told
    rows = json.loads(rig("plan", files[0], "--bench", files[1], "--json").stdout)["precision"]
    assert {row["sd"] for row in rows} == {None}
    assert all(row["sd_over_scatter"] > 0.0 for row in rows)


def test_a_plan_says_hours_precision_and_what_is_confounded(tmp_path):
    expect = "[expect]\nsigma = { cell = 0.002 }\n"
    files = written(tmp_path, PROCEDURE + expect)
    told = json.loads(rig("plan", files[0], "--bench", files[1], "--json").stdout)
    x = np.array(parse_procedure(PROCEDURE, "p").expand().column("force_kN"))
    sd = 0.002 / np.sqrt(np.sum((x - x.mean()) ** 2))
    slope = next(row for row in told["precision"] if row["term"] == "force_kN")
    assert slope["sd"] == pytest.approx(sd, rel=1e-12), "sigma / sqrt(Sxx), of any textbook"
    assert slope["df"] == len(x) - 2
    assert told["seconds"]["total"] > 14 * 5
    once = PROCEDURE.replace("replications = 2", "replications = 1").replace("[0, 1, 2, 5]", "[0, 5, 1]")
    once = once.replace('"up-down"', '"as written"').replace('"1 + force_kN"', '"1 + force_kN + force_kN^2"')
    files = written(tmp_path, once)
    said = rig("plan", files[0], "--bench", files[1]).stdout
    for words in ("no degrees of freedom are left", "no point is repeated", "a drift look alike"):
        assert words in " ".join(said.split())


@pytest.mark.parametrize(
    ("world", "says"),
    [
        ('[sensors.cell]\nformula = "load_kN"', "load_kN is not known here"),
        ('[sensors.cell]\nformula = "__import__(1)"', "is not possible here"),
        ('[sensors.cell]\nformula = "1 +"', "is no arithmetic"),
        ("[effects.backlash]\npitch_arcsec = 3", "write `hidden`"),
        ('[lags.creep]\nof = "load_kN"', "is none of this bench: force_kN"),
        ("[sources.load_kN]", "sources.load_kN is not known"),
    ],
)
def test_a_world_that_makes_no_sense_is_refused(tmp_path, world, says):
    with pytest.raises(ConfigurationError, match=says):
        run_dry(tmp_path, world=world)


def test_two_instruments_have_two_addresses(tmp_path):
    second = BENCH + "[instruments.other]\n" + lab.DVM.split("\n", 2)[2] + '[sensors.b]\nreader = "other"\n'
    files = written(tmp_path, bench=second)
    with pytest.raises(ConfigurationError, match=r"dvm and instruments\.other have one address, /dev/rig/dvm: each"):
        load_plan(files[0], files[1])


def test_arithmetic_of_worlds():
    formula = Formula.parse("-2*x^2 + max(x, 1)/4 - sqrt(abs(-9)) + 3", "f", {"x"})
    assert formula.value({"x": 0.5}) == pytest.approx(-0.5 + 0.25)
    with pytest.raises(WorldError, match="has no value at x = -1"):
        Formula.parse("log(x)", "f", {"x"}).value({"x": -1.0})


def test_a_world_without_a_value_at_a_setting_is_an_error_of_its_file(tmp_path):
    with pytest.raises(ConfigurationError, match=r"world.toml: 'log\(force_kN - 1\)' has no value at force_kN = "):
        run_dry(tmp_path, world=WORLD.replace("0.1 + 0.5*force_kN", "log(force_kN - 1)"))


def test_a_standard_model_is_declared_by_its_name_and_fitted_to_its_factor(tmp_path):
    procedure = PROCEDURE.replace('formula = "1 + force_kN"', 'standard = "load-cell-cubic"')
    path, result = run_dry(tmp_path, procedure)
    assert result.outcome is Outcome.COMPLETE, result.message
    found = json.loads(rig("fit", path, "--json").stdout)
    assert found["model"]["name"] == "load-cell-cubic"
    traced = rig("trace", path)
    assert traced.returncode == 2
    assert "linear in its coefficients" in traced.stderr
    for change, says in (
        ('standard = "load-cell-quartic"', "there is no model 'load-cell-quartic'"),
        ('standard = "load-cell-cubic"\nformula = "1"', "give one of them"),
        ('standard = "load-cell-cubic"\nabscissa = "load_kN"', "is not a factor"),
    ):
        files = written(tmp_path / "wrong", PROCEDURE.replace('formula = "1 + force_kN"', change))
        with pytest.raises(ConfigurationError, match=says):
            load_plan(files[0], files[1])


def test_a_rehearsal_without_a_world_meets_no_fault_of_its_own(tmp_path):
    files = written(tmp_path, lab.BATH_PROCEDURE, lab.BATH)
    plan = load_plan(files[0], files[1], dry=True)
    paths = []
    result = start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE, result.message
    assert not records(paths[0], "fault")
    table = run_table(paths[0])
    assert table.columns["bath_degC"] == pytest.approx(table.columns["bath_set_degC"], abs=0.05), (
        "by the inverse formula"
    )


def test_a_sensor_that_cannot_be_traced_is_named(tmp_path):
    """It was left out of the trace without a word where another sensor had a linear model."""
    procedure = lab.BATH_PROCEDURE + '[model.prt_2]\nformula = "a + b*bath_degC"\nstart = { a = 0, b = 1 }\n'
    path, result = run_dry(tmp_path, procedure, lab.BATH, lab.BATH_WORLD)
    assert result.outcome is Outcome.COMPLETE, result.message
    told = json.loads(rig("trace", path, "--json").stdout)
    assert list(told["sensors"]) == ["prt_1_V"]
    assert told["not_traced"] == ["prt_2_mV"]
    assert "not traced: prt_2_mV" in rig("trace", path).stdout.replace("\n", " ")


def doubts(folder, procedure=PROCEDURE, bench=BENCH):
    files = written(folder, procedure, bench)
    return list(unit_doubts(load_plan(files[0], files[1])))


@pytest.mark.parametrize(
    ("unit", "says"),
    [
        ("NM", "NM is no unit that this program knows (force_NM): it is taken as a name; Nm is meant?"),
        ("Newtonmeter", "Newtonmeter is no unit that this program knows (force_Newtonmeter): it is taken as a name"),
        ("kN", None),
        ("kNm", None),
        ("m3_per_h", None),
        ("mm2", None),
        ("degF", None),
        ("rpm", None),
    ],
)
def test_a_unit_that_nobody_knows_is_said_once(tmp_path, unit, says):
    procedure, bench = (text.replace("force_kN", f"force_{unit}") for text in (PROCEDURE, BENCH))
    assert doubts(tmp_path, procedure, bench) == ([] if says is None else [says])


def test_megavolts_and_outputs_that_do_not_go_with_the_range_are_doubted(tmp_path):
    mega = BENCH.replace('reader = "dvm"\n', 'reader = "dvm"\nunit = "MV"\n')
    assert doubts(tmp_path, bench=mega) == ["MV (sensors.cell) is 1e+06 V; mV is a thousandth of a volt"]
    expects = PROCEDURE + '[expect]\nsigma = { cell = 1e-4 }\noutput = { cell = "0.5*force_kN" }\n'
    ranged = BENCH.replace("nplc = 1\n", "nplc = 1\nrange_V = 10\n")
    assert doubts(tmp_path, expects, ranged) == []
    (one,) = doubts(tmp_path, expects, ranged.replace('reader = "dvm"\n', 'reader = "dvm"\nunit = "mV"\n'))
    assert "cell: its expected output goes to 2.5 mV, 0.025 % of the range of dvm, 10 V: is it in mV" in one
    (one,) = doubts(tmp_path, expects.replace("0.5*", "50*"), ranged)
    assert "goes to 250 V, 2.5e+03 % of the range" in one


def test_a_thermometer_in_a_factor_of_another_unit_is_refused_with_the_unit():
    bench = TWO.replace("bath_degC", "bath_degc") + (
        '[temperatures.air_degC]\nreader = "dvm"\nchannel = "x"\nplace = "bath_degc"\n'
    )
    with pytest.raises(ConfigurationError, match=r"is a factor in degc; .* reads degC: call the factor bath_degC"):
        parse_bench(bench, "bench.toml")
