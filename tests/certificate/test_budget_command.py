"""`rig budget`: from a dry run and its register to uncertainties, and what is refused."""

from __future__ import annotations

import json
from datetime import date

import numpy as np
import pytest
from command import rig
from general_lab import BENCH, run_dry

from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError
from rig.fitter.budget import Budgeted, Contribution
from rig.procedures.tables.table import Table
from rig.runs.controller import resume_run
from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.verbs.budget.held import outside_of
from rig.verbs.budget.page import _result as result_of
from rig.verbs.budget.page import shares
from rig.verbs.budget.result import _budget as budget_lines
from rig.verbs.budget.result import budget, not_in

REGISTER = """
name = "stand"
[equipment.W-1]
[equipment.W-1.certificate]
number = "F-1"
date = 2020-01-01
laboratory = "force"
[[equipment.W-1.says]]
quantity = "force_kN"
behaves = "gain"
unit = "%"
expanded = 0.01
k = 2
probability = 0.9545
[equipment.DVM-1]
[equipment.DVM-1.certificate]
number = "E-1"
date = 2020-01-01
laboratory = "voltage"
[[equipment.DVM-1.says]]
quantity = "V"
unit = "mV"
correction = 20
standard = 0.1
range = [-10, 10]
[[equipment.DVM-1.says]]
quantity = "degC"
unit = "K"
standard = 0.1
"""


def stand(folder, **options):
    bench = BENCH.replace('driver = "person"', 'driver = "person"\nasset = "W-1"')
    bench = bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"')
    (folder / "equipment.toml").write_text(REGISTER)
    return run_dry(folder, bench=bench, **options)[0]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return stand(tmp_path_factory.mktemp("stand"))


def contribution(result, name):
    return next(one for one in result["contributions"] if one["name"] == name)


def test_a_run_has_budgets_by_the_register_that_it_keeps(run):
    done = rig("budget", run, "--at", "force_kN=4", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    results = {one["name"]: one for one in told["results"]}
    force = results["cell inferred force at force 4 kN"]
    weights = contribution(force, "W-1 gain of force_kN")
    assert weights["standard_uncertainty"] == pytest.approx(4 * 0.5e-4, rel=1e-3)
    assert weights["source"] == "W-1, certificate F-1"
    assert contribution(force, "DVM-1 offset of V")["standard_uncertainty"] == pytest.approx(1e-4 / 0.5, rel=1e-3)
    assert sum(one["share"] for one in force["contributions"]) == pytest.approx(1.0)
    assert force["expanded_uncertainty"] == force["coverage_factor"] * force["standard_uncertainty"]
    # the world's cell reads 0.1 V + 0.5 V/kN; the certificate's correction is added to every reading
    assert results["cell coefficient 1"]["value"] == pytest.approx(0.12, abs=1e-4)
    assert "corrected by the certificates: cell_V" in told["notes"]
    assert any("nothing here is in degC; DVM-1 gives cell_V" in note for note in told["notes"])


def test_people_see_shares_the_largest_first(run):
    done = rig("budget", run, "--at", "force_kN=4")
    assert "SIMULATED" in done.stdout
    assert "coverage probability of 95 %" in done.stdout
    assert "errors of the meter that reads the sensors in use are not in" in done.stderr


def test_degrees_of_freedom_are_one_number_wherever_they_stand():
    """One influence of 12.6 degrees of freedom stood as df 13, beside 12 effective ones: rounded here, cut there."""
    alone = Budgeted(
        "y", "V", 1.0, 1.0, 12.6, 0.95, 2.167, 2.167, (Contribution("scatter", "run", "A", 1.0, 12.6, 1.0),)
    )
    told = [str(getattr(one, "text", "")) + str(getattr(one, "rows", "")) for one in budget_lines(alone)]
    assert "effective degrees of freedom 12" in told[0]
    assert "'12'" in told[1]
    assert (result_of(alone)["df"], result_of(alone)["lines"][0]["df"]) == ("12", "12")


def test_a_budget_says_where_its_coverage_factors_are_from_and_no_sentence_twice(run, tmp_path):
    nothing = tmp_path / "equipment.toml"
    nothing.write_text('name = "stand"\n[equipment.W-1]\n[equipment.DVM-1]\n')
    for more in ((), ("--equipment", nothing)):
        done = rig("budget", run, "--full", *more)
        assert len(set(done.stderr.splitlines())) == len(done.stderr.splitlines())
        assert "k is of Student's t at the effective degrees of freedom" in " ".join(done.stdout.split())
    (lacking,) = not_in(budget(run, equipment=nothing))
    assert " ".join((done.stdout + done.stderr).split()).count(lacking) == 1  # it stood above and below the table


def test_the_same_meter_in_use_cancels_its_offset(run):
    other, same = (budget(run, at=[{"force_kN": 4.0}], same_meter=same).to_json() for same in (False, True))
    sizes = [contribution(told["results"][-1], "DVM-1 offset of V")["standard_uncertainty"] for told in (other, same)]
    assert sizes[0] > 1e-4
    assert sizes[1] == pytest.approx(0.0, abs=1e-10)


def test_the_report_has_a_bar_chart_of_every_result(run, tmp_path):
    page = tmp_path / "budget.html"
    assert rig("budget", run, "--at", "force_kN=4", "--report", page).returncode == 0
    text = page.read_text()
    assert text.count('<img alt="shares of the influences') == 4
    assert "SIMULATED" in text


def test_names_of_bars_are_not_cut_off():
    lines = [Contribution(name, "x", "B", 1.0, np.inf, 0.5) for name in ("a", "levelling about the pitch axis, a")]
    drawn = shares(Budgeted("y", "V", 1.0, 1.4, np.inf, 0.95, 1.96, 2.7, tuple(lines), by_shape=False))
    drawn.canvas.draw()
    left = [label.get_window_extent().x0 for label in drawn.axes[0].get_yticklabels()]
    assert 0.0 < min(left) < 20.0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("range = [-10, 10]", "range = [-1, 1]"), "says.0.range: the certificate covers -1 to 1, and cell_V"),
        (("date = 2020-01-01\nlaboratory = \"force\"", "date = 2020-01-01\ndue = 2021-01-01\nlaboratory = \"force\""),
         "W-1.certificate.due = 2021-01-01, and the run ended on"),
        (("[equipment.W-1]\n", "[equipment.W-2]\n[equipment.W-1]\nserial=3\n"), "should be a text in quotes"),
    ],
)  # fmt: skip
def test_another_register_is_used_or_refused(run, tmp_path, change, says):
    path = tmp_path / "other.toml"
    assert change[0] in REGISTER
    path.write_text(REGISTER.replace(*change))
    done = rig("budget", run, "--equipment", path)
    assert done.returncode == 78
    assert str(path) in done.stderr.replace("\n", "")
    assert says in done.stderr


def test_what_cannot_be_budgeted_is_said(run, tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("force_kN,cell_V\n1,2\n")
    assert "is no run file" in rig("budget", table).stderr
    assert "the run has no force_N; its factors are force_kN" in rig("budget", run, "--at", "force_N=4").stderr
    assert "is not a quantity and its value" in rig("budget", run, "--at", "force_kN").stderr


def test_a_register_that_contradicts_the_bench_of_the_run_is_refused(run, tmp_path):
    path = tmp_path / "other.toml"
    path.write_text(REGISTER.replace("W-1", "W-9"))
    with pytest.raises(ConfigurationError, match=r"equipment\.W-1 is missing, and bench\.toml names it"):
        budget(run, equipment=path)


def test_an_instrument_that_was_exchanged_during_the_run_has_no_register(tmp_path, monkeypatch):
    signals = Signals()

    def stop(news):
        signals.interrupt = "SIGTERM" if news.done == 2 else ""

    path = stand(tmp_path, signals=signals, on_progress=stop)
    monkeypatch.setattr(Keysight34401ATwin, "identity", "KEYSIGHT,34401A,MY4,10-5-2")
    accept = frozenset({"dvm"})
    assert resume_run(path, signals=Signals(), accept=accept, on_progress=lambda _: None).outcome is Outcome.COMPLETE
    told = r"DVM-1 is one instrument, .*dvm was exchanged \(HEWLETT-PACKARD 34401A 0, then KEYSIGHT 34401A MY4\)"
    with pytest.raises(ConfigurationError, match=told):
        budget(path)


@pytest.mark.parametrize(
    ("pitch", "at", "outside"),
    [
        (np.arange(-60.0, 61.0, 20.0), [{"pitch_deg": 60.9}, {"pitch_deg": -300.0}, {"roll_deg": 9.0}], 0),
        (np.arange(-60.0, 61.0, 20.0), [{"pitch_deg": 62.0}, {"pitch_deg": 62.0}, {"pitch_deg": -90.0}], 2),
        (np.arange(-180.0, 151.0, 30.0), [{"pitch_deg": 175.0}], 0),
        (np.arange(-180.0, 121.0, 30.0), [{"pitch_deg": 175.0}], 1),
    ],
)
def test_points_beyond_the_run_are_told(pitch, at, outside):
    assert len(list(outside_of(Table("run", {"pitch_deg": pitch}, simulated=False, provenance={}), at))) == outside


def test_drift_of_a_standard_is_by_its_history_and_its_age(run, tmp_path):
    path = tmp_path / "history.toml"
    rows = "drift = [[0, 0], [10000, 1.96]]\n"
    path.write_text(REGISTER.replace("probability = 0.9545\n", f"probability = 0.9545\n{rows}"))
    told = budget(run, equipment=path, at=[{"force_kN": 4.0}]).to_json()
    days = (date.fromisoformat(told["data"]["last_observation_utc"][:10]) - date(2020, 1, 1)).days
    name = f"W-1 gain of force_kN, drift since 2020-01-01 ({days} days, by its history)"
    # 1.96 % in 10,000 days, with 95 %: a standard uncertainty of 1e-6 of the force a day
    found = contribution(told["results"][-1], name)["standard_uncertainty"]
    assert found == pytest.approx(4e-6 * days, rel=1e-3)
    path.write_text(path.read_text().replace("10000", "100"))
    with pytest.raises(ConfigurationError, match=rf"says\.0\.drift: its rows end 100 days .* and {days} are asked for"):
        budget(run, equipment=path)


def test_drift_of_a_sensor_in_use_is_by_its_own_history(run, tmp_path):
    done = rig("budget", run, "--after-days", "50")
    assert done.returncode == 2
    assert "the register has no sensors.cell.drift: chart three or more calibrations" in done.stderr
    path = tmp_path / "history.toml"
    path.write_text(f"{REGISTER}[sensors.cell]\ndrift = [[0, 0], [100, 3.92]]\ndrift_unit = 'mV'\n")
    told = budget(run, equipment=path, at=[{"force_kN": 4.0}], after_days=50).to_json()
    by_name = {one["name"]: one for one in told["results"]}
    drift = "cell drift in 50 days, by its history"
    # half of 3.92 mV is 1.96 mV, and 1 mV for one standard uncertainty: 2 N of a cell with 0.5 V/kN
    found = contribution(by_name["cell inferred force at force 4 kN"], drift)["standard_uncertainty"]
    assert found == pytest.approx(1e-3 / 0.5, rel=1e-3)
    assert contribution(by_name["cell output at force 4 kN"], drift)["standard_uncertainty"] == 0.0
    assert any("are for a use 50 days after the run" in note for note in told["notes"])
    path.write_text(path.read_text().replace("'mV'", "'kN'"))
    with pytest.raises(ConfigurationError, match=r"drift_unit = 'kN' does not convert to 'V'"):
        budget(run, equipment=path, after_days=50)
