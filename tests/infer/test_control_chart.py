"""`rig chart`: several dry runs of one bench whose x sensor loses sensitivity, as a user has them."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import escape
from pathlib import Path

import command
import pytest
from dry import LAB, SHORT, dry
from few_sensors import with_sensors

from rig.by_kind import fit_table
from rig.cli.commands import app
from rig.errors import UsageError
from rig.procedures.present.blocks import Line
from rig.tables import write_csv
from rig.tables.table_of_run import run_table
from rig.verbs.budget.result import budget
from rig.verbs.chart.charted import chart_calibrations
from rig.verbs.chart.page import chart_page
from rig.verbs.chart.result import ControlChart
from rig.verbs.chart.together import read_together
from rig.verbs.page import render

PROCEDURE = SHORT.replace("replications = 2", "replications = 4")
PPM_PER_YEAR = -20.0
FIRST = datetime(2024, 1, 15, 18, tzinfo=UTC)
TODAY = datetime(2026, 1, 1, tzinfo=UTC)


def make_run(folder, number, *, bench=LAB / "bench.toml", text=PROCEDURE, ppm=None):
    """A dry run half a year after the one before, of a sensor that is so much less sensitive."""
    began = FIRST + timedelta(days=182 * number)
    ppm = PPM_PER_YEAR * 182 / 365.25 * number if ppm is None else ppm
    world = folder / f"world-{number}.toml"
    world.write_text(
        f"seed = {number + 111}\nepoch = {began:%Y-%m-%dT%H:%M:%S}Z\n"
        f"[sensors.x]\nsensitivity_V_per_g = {5.02 * (1 + 1e-6 * ppm):.9f}\nconing_deg = 0.2\nnoise_V = 25e-6\n"
    )
    return str(dry(folder, bench=bench, world=world, text=text))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("history")
    return [make_run(folder, number) for number in range(5)]


@pytest.fixture(scope="module")
def charted(runs):
    return chart_calibrations(read_together(runs)[0], TODAY, sensors=["x_V"], tolerance=1e-3, usage_deg=30)


@pytest.fixture(scope="module")
def tables(runs, tmp_path_factory):
    """The runs as tables that know nothing of where they are from, with their dates."""
    folder, named = tmp_path_factory.mktemp("tables"), []
    for number, run in enumerate(runs):
        columns = {k: v for k, v in run_table(folder / run).columns.items() if k != "simulated"}
        write_csv(columns, folder / f"{number}.csv")
        named.append(f"{folder / f'{number}.csv'}@{FIRST + timedelta(days=182 * number):%Y-%m-%d}")
    return named


def rig(*arguments, cwd=None):
    return command.rig("chart", *arguments, cwd=cwd, env={"COLUMNS": "80"})


def test_the_drift_is_found_and_named(charted):
    found = charted.to_json()["sensors"]["x_V"]
    trend = found["quantities"]["S_V"]["trend"]
    rate, half = (1e6 * trend[key] / 5.02 for key in ("per_year", "half_width_95"))
    assert abs(rate - PPM_PER_YEAR) < half < 6
    assert re.match(
        r"x_V: sensitivity falls by [\d.]+ \+- [\d.]+ ppm/year \(\+- one standard error, p ", found["sentences"][0]
    )
    assert all(q["trend"]["p_adjusted"] > 0.01 for name, q in found["quantities"].items() if name != "S_V")
    assert [row["date"] for row in found["calibrations"]][:2] == ["2024-01-15", "2024-07-15"]


def test_it_says_repeatability_only(charted):
    shown = ControlChart(charted)
    assert shown.to_json()["uncertainty"] == "repeatability only"
    told = [one.text for one in shown.blocks() if isinstance(one, Line)]
    assert any("standard errors, limits and due dates: repeatability only" in text for text in told)


def test_the_due_date_follows_tolerance_and_today(charted):
    sensor = charted.sensors["x_V"]
    due = sensor.due(1e-3)
    assert due["status"] == "due"
    last = sensor.last.date()
    gone = (datetime.fromisoformat(due["date"]).date() - last).days
    # 20 ppm a year at half of 1 g: 5.7e-4 deg a year, so without any doubt it would take 1.7 years
    assert 60 < gone < 1.7 * 365
    assert due["days"] == (last + timedelta(days=gone) - TODAY.date()).days
    later = [sensor.due(t).get("date", "") for t in (3e-4, 6e-4, 1e-3, 1.5e-3, 1.0)]
    assert later == sorted(later)
    assert sensor.due(1e-5)["status"] == "never within"
    assert sensor.due(1.0)["at_least"]
    overdue = chart_calibrations(
        charted.given,
        datetime(2030, 1, 1, tzinfo=UTC),
        tolerance=1e-3,
        usage_deg=30,
    )
    assert overdue.sensors["x_V"].due(1e-3)["status"] == "overdue"
    assert "already due" in overdue.to_json()["sensors"]["x_V"]["sentences"][-1]


def test_the_end_of_the_forecast_is_no_due_date(charted):
    """A sensor that stays within its tolerance as far as the forecast reaches is not overdue after that."""
    later = chart_calibrations(charted.given, datetime(2030, 1, 1, tzinfo=UTC), tolerance=1.0, usage_deg=30)
    sensor = later.sensors["x_V"]
    due = sensor.due(1.0)
    assert (due["status"], due["at_least"]) == ("not known", True)
    said = sensor.to_json()["sentences"][-1]
    assert f"is not known: it was expected within until {due['date']}" in said
    assert "already due" not in said
    page = re.sub(r"\s+", " ", re.sub("<[^>]+>", " ", render(chart_page(later))))
    assert "(past)" not in page


def test_calibrations_of_a_few_days_have_no_rate_per_year_and_no_due_date(charted):
    first = charted.given[0].when
    close = [replace(one, when=first + timedelta(days=day)) for day, one in enumerate(charted.given)]
    short = chart_calibrations(close, TODAY, tolerance=1e-3, usage_deg=30)
    result = short.to_json()["sensors"]["x_V"]
    assert result["due"]["status"] == "too short"
    words = " ".join(result["sentences"])
    assert "no due date: 5 calibrations within 4 days say nothing of the months to come" in words
    assert " within 4 days (+- one standard error" in words
    assert "/year" not in words
    page = re.sub(r"\s+", " ", re.sub("<[^>]+>", " ", render(chart_page(short))))
    assert "(95 % probability" not in page


def test_the_tolerance_that_nobody_gave_is_the_interval_of_one_reading(charted):
    """t times the noise of a reading: 25 uV a second over 4 readings, in degrees of a 5.02 V/g sensor."""
    sensor = chart_calibrations(charted.given, TODAY).sensors["x_V"]
    sigma = charted.given[-1].sensors["x_V"].sigma_V / 5.02 * 57.3
    assert 1.9 * sigma < sensor.tolerance < 2.3 * sigma
    assert not sensor.told


def test_its_drift_goes_into_the_budget_of_the_last_calibration(charted, runs, tmp_path):
    lines = ControlChart(charted).as_drift()
    rows = charted.sensors["x_V"].drift()
    bound = charted.sensors["x_V"].chart.bound
    worst = max(values[-1] for values in bound.bounds.values()), max(values[0] for values in bound.bounds.values())
    assert rows[0] == (0.0, 0.0)
    assert rows[-1][1] == pytest.approx(math.sqrt(worst[0] ** 2 - worst[1] ** 2), rel=1e-2)
    # 20 ppm a year of the sensitivity are 5.7e-4 deg at +-30 deg of pitch
    assert rows[-1][1] > math.degrees(20e-6 * math.sin(math.radians(30))) * rows[-1][0] / 365.25
    register = tmp_path / "equipment.toml"
    known = (LAB / "equipment.toml").read_text()
    register.write_text(re.sub(r"(\[sensors\.[xyz]\]\n)", lambda head: f"{head[1]}{lines}", known))
    told = budget(runs[-1], equipment=register, at=[{"pitch_deg": 0.0}], after_days=rows[-1][0]).to_json()
    angle = next(one for one in told["results"] if one["name"].startswith("inferred pitch"))
    drift = next(one for one in angle["contributions"] if one["name"].startswith("x drift in"))
    assert drift["standard_uncertainty"] == pytest.approx(rows[-1][1] / 1.96, rel=1e-3)


def test_two_calibrations_are_compared_and_no_more(runs):
    found = chart_calibrations(read_together([runs[0], runs[4]])[0], TODAY, sensors=["x_V"]).to_json()["sensors"]["x_V"]
    assert found["quantities"]["S_V"]["trend"] is None
    assert found["quantities"]["S_V"]["homogeneity"]["p"] < 0.01
    assert found["due"]["status"] == "too few"
    assert "a due date needs three calibrations; there are 2" in found["sentences"][-1]


def test_a_step_is_dated_and_put_beside_a_change_of_instruments(runs, tmp_path):
    before, _ = with_sensors(LAB, tmp_path, "x")
    bench = tmp_path / "other.toml"
    bench.write_text(before.read_text().replace("DVM-0102", "DVM-0999"))
    first = [make_run(tmp_path, number, ppm=0.0, bench=before, text=SHORT) for number in range(4)]
    after = [make_run(tmp_path, number, ppm=200.0, bench=bench, text=SHORT) for number in range(4, 7)]
    charted = chart_calibrations(read_together([*first, *after])[0], TODAY, sensors=["x_V"])
    sentences = " ".join(charted.to_json()["sensors"]["x_V"]["sentences"])
    stepped = re.search(r"sensitivity stepped by \+(\S+) \+- (\S+) ppm between 2025-07-14 and 2026-01-12", sentences)
    assert stepped, sentences
    assert abs(float(stepped[1]) - 200) < 4 * float(stepped[2])
    note = "between 2025-07-14 and 2026-01-12 the scanner changed from"
    assert any(n.startswith(note) and "DVM-0999" in n for n in charted.notes)
    assert charted.notes[0] == "charted parameters are for each calibration's own mean sensor temperature"
    assert len(charted.notes) == 2


def test_tables_with_dates_give_the_same(charted, tables):
    found = chart_calibrations(read_together(tables)[0], TODAY, sensors=["x_V"], tolerance=1e-3, usage_deg=30)
    mine, theirs = (c.to_json()["sensors"]["x_V"]["quantities"]["S_V"] for c in (found, charted))
    assert mine["values"] == pytest.approx(theirs["values"], rel=1e-12)
    assert mine["trend"]["per_year"] == pytest.approx(theirs["trend"]["per_year"], rel=1e-3)
    assert not found.simulated


def test_calibration_files_stand_for_their_runs(runs, charted, tmp_path):
    files = []
    for number, run in enumerate(runs):
        files.append(run)
        if number % 2 == 0:  # any mixture will do
            files[-1] = str(tmp_path / f"{number}.json")
            (tmp_path / f"{number}.json").write_text(json.dumps(fit_table(run_table(Path(run))).to_json()))
    found = chart_calibrations(read_together(files)[0], TODAY, sensors=["x_V"], tolerance=1e-3, usage_deg=30)
    mine, theirs = (c.to_json()["sensors"]["x_V"] for c in (found, charted))
    for name in ("b_V", "S_V"):
        assert mine["quantities"][name]["stderr"] == pytest.approx(theirs["quantities"][name]["stderr"], rel=1e-3)
    assert mine["quantities"]["S_V"]["values"] == pytest.approx(theirs["quantities"]["S_V"]["values"], rel=1e-9)
    assert found.simulated
    with pytest.raises(UsageError, match="are the same run"):
        read_together([files[0], runs[0], runs[1]])


def test_what_does_not_belong_together_is_refused(runs, tables, tmp_path):
    for given, message in (
        (runs[:1], "at least two"),
        ([runs[0], tables[1]], "is simulated and"),
        ([runs[0], runs[0]], "are the same run"),
        ([tables[0], tables[0].partition("@")[0]], "has no date of measurement: write"),
        ([tables[0], tables[1].partition("@")[0] + "@soon"], "'soon' is not a date"),
        ([runs[0] + "@2024-01-01", runs[1]], "contains its date of measurement"),
        ([tables[0], tables[1].partition("@")[0] + "@2024-01-15"], "of the same time"),
        ([tables[0], tables[0].partition("@")[0] + "@2025-01-01"], "have the same data: x_V has"),
        ([str(tmp_path / "no.sqlite"), runs[0]], "there is no file"),
    ):
        with pytest.raises(UsageError, match=re.escape(message)):
            read_together(given)
    with pytest.raises(UsageError, match="has no sensor w_V; it has x_V"):
        chart_calibrations(read_together(runs[:2])[0], TODAY, sensors=["w_V"])
    flat = make_run(tmp_path, 9, text=PROCEDURE.replace("roll_deg = [-120, 0, 120]", "roll_deg = [0]"))
    with pytest.raises(UsageError, match=r"attitude-x in .* and attitude-no-roll in"):
        chart_calibrations(read_together([runs[0], flat])[0], TODAY)


def test_what_cannot_be_compared_is_left_out_and_named(runs, tables, tmp_path, capsys):
    """Of several calibrations, those that fit the most others are charted; the rest is named with its reason."""
    flat = make_run(tmp_path, 9, text=PROCEDURE.replace("roll_deg = [-120, 0, 120]", "roll_deg = [0]"))
    few = make_run(tmp_path, 8, text=PROCEDURE.replace("[-90, -45, 0, 45, 90]", "[0]"))
    asked = ["chart", *runs[:2], flat, few, tables[2], "--sensor", "x_V", "--json", "--today", "2026-01-01"]
    assert app(asked, standalone_mode=False) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["file"] for one in found["data"]["calibrations"]] == runs[:2]
    reasons = {one["file"]: one["reason"] for one in found["left_out"]}
    assert set(reasons) == {flat, few, tables[2].partition("@")[0]}
    assert "attitude-no-roll in" in reasons[flat]
    assert "do not determine" in reasons[few]
    assert "is simulated and" in reasons[tables[2].partition("@")[0]]
    assert all(f"{file} is left out: {reason}" in found["notes"] for file, reason in reasons.items())


def test_notes_say_what_is_doubtful(runs, tmp_path):
    once = [make_run(tmp_path, n, text=SHORT.replace("replications = 2", "replications = 1")) for n in (0, 1)]
    charted = chart_calibrations(read_together(once)[0], TODAY, sensors=["x_V"], usage_deg=120)
    assert any("no calibration has two replications" in note for note in charted.notes)
    assert any("more than was calibrated last" in note for note in charted.notes)


def test_command_prints_what_the_document_shows(runs, tmp_path):
    report = tmp_path / "chart.html"
    options = ("--sensor", "x_V", "--tolerance", "1e-3", "--usage", 30, "--today", "2026-02-01")
    shown = rig(*runs, *options, "--report", report)
    assert shown.returncode == 0, shown.stderr
    assert "SIMULATED: no real instrument" in report.read_text()
    document = (Path(__file__).parents[2] / "docs" / "how_to" / "control_charts.md").read_text()
    example = document.split("```text\n")[1].split("```")[0]
    assert _lines(shown.stdout) == _lines(example)


def _lines(text):
    return [line.rstrip() for line in text.splitlines() if line.strip()]


def test_command_prints_json(runs, capsys):
    assert app(["chart", *runs, "--json", "--today", "2026-01-01"], standalone_mode=False) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["sensors"]) == {"x_V", "y_V", "z_V"}
    assert found["data"]["simulated"] is True


def test_command_refuses_what_it_cannot_do(runs):
    with pytest.raises(UsageError, match="is not overwritten"):
        app(["chart", *runs, "--report", runs[0]], standalone_mode=False)
    with pytest.raises(UsageError, match="--today: 'soon' is not a date"):
        app(["chart", *runs, "--today", "soon"], standalone_mode=False)


def test_report_holds_charts_tests_and_where_everything_is_from(charted):
    html = render(chart_page(charted))
    assert html.count("data:image/png;base64,") == 2
    assert all(one.provenance["run_id"] in html for one in charted.given)
    assert escape(charted.to_json()["sensors"]["x_V"]["sentences"][0]) in html
    assert "the earlier of both" in html.lower()


@pytest.mark.parametrize("date", ["0001-01-01", "9999-12-31", "2026-13-01", "0001-01-01T00:00+14:00"])
def test_a_date_that_is_none_is_one_message(tmp_path, date):
    (tmp_path / "a.csv").write_text("x\n1\n")
    done = rig("a.csv@" + date, "a.csv@2026-01-01", cwd=tmp_path)
    assert done.returncode == 2
    assert "is not a date" in done.stderr


def test_the_report_is_not_written_over_a_table_named_with_its_date(tmp_path):
    (tmp_path / "a.csv").write_text("x\n1\n")
    done = rig("a.csv@2026-01-01", "a.csv@2026-02-01", "--report", "a.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert (tmp_path / "a.csv").read_text() == "x\n1\n"
