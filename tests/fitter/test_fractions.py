"""Fractions of a measured run: the paper's points, least squares of others, and what the paper saw in its own data."""

from __future__ import annotations

import json
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import rig

from proving.statistics.fractions import PADS, table_of
from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate
from rig.procedures.attitude.fraction_advice import advised, sentence
from rig.procedures.attitude.fractions import MeasuredGrid, fit_part
from rig.procedures.attitude.fractions_compared import compare_fractions, family, nearest, tumble_of
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.errors import DataError
from rig.procedures.tables.table import Table
from rig.tables import write_csv

DOCUMENT = Path(__file__).parents[2] / "docs" / "how_to" / "designs.md"
CLEAN = Bench()


@pytest.fixture(scope="module")
def night():
    return simulate(PADS, D1(180, 37, 13), seed=7)[0]


@pytest.fixture(scope="module")
def narrow():
    return simulate(PADS, D1(30, 13, 25), seed=8)[0]


def kept(data, pitch_steps, roll_steps):
    """Rows of section 9's fractions, in the paper's words: coarser steps, then alternate rows and columns decimated."""
    (pitch_step, pitch_start), (roll_step, roll_start) = pitch_steps, roll_steps
    row, column = (data.pitch_deg - pitch_start) / pitch_step, (data.roll_deg - roll_start) / roll_step
    on_grid = (np.abs(row - np.round(row)) < 1e-6) & (np.abs(column - np.round(column)) < 1e-6)
    return on_grid & ((np.round(row) % 2 == 0) | (np.round(column) % 2 == 0))


# --- which points --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pitch_max", "rows", "columns", "points", "coarse"),
    [(30, 13, 25, 53, (5, 13)), (180, 37, 13, 73, (13, 7)), (90, 19, 13, 139, (19, 13))],
)
def test_the_papers_fractions_are_among_the_family_and_are_found_by_their_number(
    pitch_max, rows, columns, points, coarse
):
    """53 points of section 9.2.2, 73 of section 9.3.4, 139 of figure 21."""
    measured = MeasuredGrid.of(simulate(CLEAN, D1(pitch_max, rows, columns, replications=1), seed=1)[0])
    found = nearest(measured, points)
    assert (found.points, found.shape) == (points, coarse)
    assert found.name in [part.name for part in family(measured)]


def test_points_of_a_fraction_are_where_the_paper_puts_them(night, narrow):
    measured = MeasuredGrid.of(narrow)
    rows = measured.rows_of(nearest(measured, 53).cells)
    np.testing.assert_array_equal(rows, kept(narrow, (15, -30), (30, -180)))
    measured = MeasuredGrid.of(night)
    np.testing.assert_array_equal(measured.rows_of(nearest(measured, 73).cells), kept(night, (30, -180), (60, -180)))


def test_the_family_thins_out_and_keeps_the_corners(night):
    measured = MeasuredGrid.of(night)
    parts = family(measured)
    sizes = [part.points for part in parts]
    assert all(few < many / 1.29 for many, few in zip([481, *sizes], sizes, strict=False))
    for part in parts:
        rows = measured.rows_of(part.cells)
        corners = {(a, r) for a in (-180.0, 180.0) for r in (-180.0, 180.0)}
        assert corners <= set(zip(night.pitch_deg[rows], night.roll_deg[rows], strict=True))
        assert np.count_nonzero(rows) == 6 * part.points


def test_the_document_lists_the_family(night):
    listed = re.findall(r"^(\d+ x \d+ \(\d, \d\)) +(\d+) +\d", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE)
    family_of_night = [(part.name, str(part.points)) for part in family(MeasuredGrid.of(night))]
    assert listed[: len(family_of_night)] == family_of_night


def test_readbacks_with_noise_are_the_same_grid(night):
    noise = np.random.default_rng(1).uniform(-0.004, 0.004, (2, len(night)))
    shaken = replace(night, pitch_deg=night.pitch_deg + noise[0], roll_deg=night.roll_deg + noise[1])
    measured = MeasuredGrid.of(shaken)
    assert measured.points == 481
    np.testing.assert_array_equal(measured.row, MeasuredGrid.of(night).row)
    np.testing.assert_allclose(measured.pitch_deg, np.linspace(-180, 180, 37), atol=0.002)


def test_up_and_back_without_roll_both_visits_count():
    """Figure 22: 37 angles up and back; a fraction keeps both visits to what it keeps."""
    plan = Plan(np.linspace(-36, 36, 37), np.array([0.0]), replications=2, up_and_down=True)
    data = simulate(replace(CLEAN, sensors=(Sensor("x"),)), plan, seed=2)[0]
    measured = MeasuredGrid.of(data)
    assert measured.points == 74
    assert [part.points for part in family(measured)] == [38, 26, 20, 14, 10]
    assert fit_part(data, "x_V", measured.rows_of(nearest(measured, 26).cells)).fit.model == "attitude-no-roll"


def test_a_tumble_takes_the_six_points_of_eq_56(night):
    measured = MeasuredGrid.of(night)
    part = tumble_of(measured, roll=True)
    rows = measured.rows_of(part.cells)
    visited = set(zip(night.pitch_deg[rows], night.roll_deg[rows], strict=True))
    assert visited == {(0, -90), (0, 0), (0, 90), (90, 0), (-90, 0), (180, 0)}


def test_minus_180_stands_for_180_where_that_was_not_visited():
    plan = Plan(np.linspace(-180, 150, 12), np.linspace(-180, 150, 12), replications=1)
    data = simulate(CLEAN, plan, seed=3)[0]
    rows = (measured := MeasuredGrid.of(data)).rows_of(tumble_of(measured, roll=True).cells)
    assert (-180.0, 0.0) in set(zip(data.pitch_deg[rows], data.roll_deg[rows], strict=True))


# --- what they give ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sensor", ["x_V", "y_V", "z_V"])
def test_a_part_is_the_least_squares_of_its_rows(night, sensor):
    """Coefficients, sigma_E, residuals of the whole run and coverage by another solver and the definitions."""
    rows = kept(night, (30, -180), (60, -180))
    a, r = np.radians(night.pitch_deg), np.radians(night.roll_deg)
    h = np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)])
    y = night.outputs[sensor]
    c, rss, *_ = np.linalg.lstsq(h[rows], y[rows], rcond=None)
    part = fit_part(night, sensor, rows)
    np.testing.assert_allclose(part.fit.linear.coefficients, c, rtol=1e-9, atol=1e-12)
    assert part.fit.replication.sigma_E == pytest.approx(math.sqrt(rss[0] / (438 - 4)), rel=1e-9)
    left = y - h @ c
    assert part.residual_V == pytest.approx(math.sqrt(left @ left / (2886 - 4)), rel=1e-9)
    spread = 1.0 + np.einsum("ni,ij,nj->n", h, np.linalg.inv(h[rows].T @ h[rows]), h)
    t = 1.965444  # Student's two-tailed 95 % limit on 434 degrees of freedom
    inside = np.abs(left) <= t * part.fit.replication.sigma_E * np.sqrt(spread)
    assert part.coverage95 == pytest.approx(np.mean(inside), abs=1e-3)
    assert fit_part(night, sensor).residual_V < part.residual_V


def test_the_widest_interval_of_a_tumble_is_known_in_closed_form(night):
    """Six points leave a variance of 2/3 everywhere, eq. (69), a sixth of it with six replications."""
    measured = MeasuredGrid.of(night)
    part = fit_part(night, "y_V", measured.rows_of(tumble_of(measured, roll=True).cells))
    t = 2.0369333  # Student's two-tailed 95 % limit on 32 degrees of freedom
    assert part.interval95_V == pytest.approx(t * part.fit.replication.sigma_E * math.sqrt(2 / 3 / 6), rel=1e-6)


def test_parts_of_a_run_over_temperature_are_compared_at_one_reference():
    """A part measured 0.2 degC warmer has another reference; its coefficients are no other for that."""
    warm = replace(CLEAN, sensors=(Sensor("x", b_per_degC=2e-4, S_per_degC=1e-4),), degC_daily=2.0)
    data = simulate(warm, D1(90, 19), seed=4)[0]
    rows = data.replicate != data.replicates[0]
    whole, part = fit_part(data, "x_V", temperature=True), fit_part(data, "x_V", rows, temperature=True)
    assert abs(part.fit.temperature.reference_degC - whole.fit.temperature.reference_degC) > 0.2
    as_they_are = (part.fit.linear.coefficients - whole.fit.linear.coefficients) / part.fit.linear.stderr
    assert np.abs(as_they_are).max() > 20
    assert np.abs(part.shift(whole.fit)).max() < 3


def test_fractions_do_for_pads_what_the_whole_run_does_and_a_tumble_does_not(night):
    """Sections 9.3.3 and 9.3.4: the whole run's residuals 4.10 against 4.09; but 10.4 where a tumble says 4.33."""
    found = compare_fractions(table_of(night), "73")
    full, part = found["full"]["sensors"]["x_V"], found["fractions"][0]["sensors"]["x_V"]
    assert full["sigma_E_deg"] == pytest.approx(4e-4, rel=0.25)
    assert full["T_bias"] > 5 * full["F_bias_95"]
    assert part["T_bias"] > 5 * part["F_bias_95"]
    assert 1.0 < part["residual_deg"] / full["residual_deg"] < 1.01
    assert 2.3 < part["interval_ratio"] < 2.9  # root of 481 / 73, but for the uneven weight of a decimated grid
    assert "lack of fit still found on x_V" in found["advice"]["sentence"]
    tumble = compare_fractions(table_of(night), "tumble")["fractions"][0]["sensors"]["x_V"]
    assert tumble["residual_deg"] > 2 * tumble["sigma_E_deg"]
    assert tumble["coverage95"] < 0.7


def test_at_thirty_degrees_too(narrow):
    """Section 9.2.2: 3.89 against 3.87; the fraction finds the lack of fit, with intervals some 2.5 times as wide."""
    found = compare_fractions(table_of(narrow), "53")
    full, part = found["full"]["sensors"]["x_V"], found["fractions"][0]["sensors"]["x_V"]
    assert full["T_bias"] > full["F_bias_95"]
    assert part["T_bias"] > part["F_bias_95"]
    assert 1.0 < part["residual_deg"] / full["residual_deg"] < 1.03
    assert found["advice"]["sentence"].startswith("53 of 325 points (16 % of the time) would have cost: calibration")


def test_right_angles_alone_do_not_show_pads(night):
    """5 x 13 over the whole circle visits sin 2a = 0 only."""
    found = compare_fractions(table_of(night), "fraction")
    parts = {part["name"]: part["sensors"]["x_V"] for part in found["fractions"]}
    blind = parts["5 x 13 (2, 2)"]
    assert blind["T_bias"] < blind["F_bias_95"]
    assert blind["coverage95"] < 0.7
    advice = found["advice"]
    assert advice["name"] not in ("5 x 13 (2, 2)", "5 x 7 (2, 2)")
    assert "smallest" in advice["why"]
    listed = [part for part in found["fractions"] if part["name"] == advice["name"]]
    assert found["full"]["hours"] * listed[0]["share"] == pytest.approx(listed[0]["hours"])


@pytest.mark.parametrize("which", ["73", "97", "tumble"])
def test_the_procedure_that_is_advised_commands_these_points(night, which):
    found = compare_fractions(table_of(night), which)
    design = tomllib.loads(found["advice"]["procedure"])
    built = PitchRollProcedure(kind="pitch-roll", name="part", design=design).design.build()
    part = found["fractions"][0]
    assert len(built) == part["points"]
    assert list(built.pitch_deg) == part["pitch_deg"]
    assert list(built.roll_deg) == part["roll_deg"]


def test_uneven_angles_are_listed():
    plan = Plan(np.array([-60.0, -40, -10, 0, 10, 40, 60]), np.linspace(-180, 180, 7), replications=1)
    found = compare_fractions(table_of(simulate(CLEAN, plan, seed=5)[0]), "fraction")
    design = tomllib.loads(found["advice"]["procedure"])
    assert design["pitch_deg"] == [-60, -40, -10, 0, 10, 40, 60]
    assert PitchRollProcedure(kind="pitch-roll", name="part", design=design).design.build()
    assert "lack of fit" not in found["advice"]["sentence"], "one replication cannot tell"


# --- words ---------------------------------------------------------------------------------------------------------


def side(points, *, T_bias=0.5, T_b=0.5, T_S=0.5, residual=1.0, ratio=1.0, inside=0.95, shift=0.0):
    sensor = {"T_bias": T_bias, "F_bias_95": 1.2, "T_b": T_b, "T_S": T_S, "F_bS_95": 2.2}
    sensor |= {"residual_deg": residual, "interval_ratio": ratio, "coverage95": inside}
    sensor |= {"shift": {"1": 0.2, "sin(pitch)": shift}}
    sensor |= {"p_bias": 1e-9 if T_bias > 2 else 0.03, "p_b": 1e-9 if T_b > 3 else 0.03, "p_S": 0.5}
    return {"name": str(points), "points": points, "share": points / 481, "sensors": {"x_V": sensor}}


def test_what_was_found_kept_and_lost_is_said():
    full = side(481, T_bias=24, T_b=15)
    assert sentence(full, side(73, T_bias=27, T_S=9.7, residual=1.0024, ratio=2.54)) == (
        "73 of 481 points (15 % of the time) would have cost: calibration interval 2.5 times as wide; residuals of the "
        "whole run up to 0.2 % larger; lack of fit still found; offset drift no longer found; sensitivity drift found "
        "by these alone"
    )
    assert "hold only 66 % of the readings" in sentence(full, side(6, inside=0.66))
    assert "a coefficient of x_V off by 4.2 of its standard errors" in sentence(full, side(73, shift=-4.2))
    assert "no calibration interval at all" in sentence(full, side(4, ratio=None, inside=None))


def test_the_smallest_that_does_is_advised():
    full = side(481, T_bias=24, T_b=15)
    good, undrifting = side(139, T_bias=20, T_b=9), side(73, T_bias=20)
    worse, blind = side(60, T_bias=20, T_b=9, residual=1.1), side(53)
    assert advised(full, [good, undrifting, worse, blind])[0] is good
    best, why = advised(full, [undrifting, worse, blind])
    assert best is undrifting
    assert "every lack of fit" in why
    best, why = advised(full, [worse, blind])
    assert best is worse
    assert "none finds" in why
    # beyond its limit, but not by more than nine tests are together by chance: nothing a fraction has to find
    assert advised(side(481, T_bias=1.3, T_b=2.3), [good, blind])[0] is blind


# --- what cannot be done -------------------------------------------------------------------------------------------


def test_points_without_a_grid_are_refused(night):
    rng = np.random.default_rng(6)
    scattered = replace(night, pitch_deg=rng.uniform(-90, 90, len(night)), roll_deg=rng.uniform(-180, 180, len(night)))
    with pytest.raises(DataError, match=r"no full grid: \d+ pitch and \d+ roll angles are \d+ pairs, of which 2886"):
        compare_fractions(table_of(scattered), "fraction")


def test_a_run_cut_short_and_a_fraction_are_refused(night):
    with pytest.raises(DataError, match="13 roll angles are 260 pairs, of which 250 were measured"):
        compare_fractions(table_of(night.take(np.arange(250))), "fraction")
    with pytest.raises(DataError, match="13 pitch and 7 roll angles are 91 pairs, of which 73 were measured"):
        compare_fractions(table_of(night.take(np.flatnonzero(kept(night, (30, -180), (60, -180))))), "fraction")


def test_visits_that_some_replications_lack_are_counted(night):
    data = night.take(np.flatnonzero(np.arange(len(night)) != 1000))
    assert compare_fractions(table_of(data), "73")["full"]["missing"] == 1


@pytest.mark.parametrize(
    ("which", "message"),
    [
        ("481", "the run itself has 481"),
        ("many", "a number of points, fraction or tumble, not 'many'"),
        ("0", "a number of points, fraction or tumble, not '0'"),
    ],
)
def test_what_was_asked_cannot_be(night, which, message):
    with pytest.raises(DataError, match=message):
        compare_fractions(table_of(night), which)


def test_too_small_a_grid_and_angles_without_a_tumble(narrow):
    small = simulate(CLEAN, D1(30, 4, 6, replications=1), seed=1)[0]
    with pytest.raises(DataError, match="4 pitch by 6 roll angles are too few for a fraction"):
        compare_fractions(table_of(small), "fraction")
    with pytest.raises(DataError, match="not visited: pitch -90, pitch 90, pitch 180 deg"):
        compare_fractions(table_of(narrow), "tumble")


def test_other_tables_are_refused():
    with pytest.raises(DataError, match="column replicate is missing; a pitch-roll table has"):
        compare_fractions(Table("plots.csv", {"whole_plot": np.ones(3)}, True, {}), "fraction")


# --- on the command line -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def csv(tmp_path_factory, narrow):
    path = tmp_path_factory.mktemp("fractions") / "night.csv"
    write_csv(table_of(narrow).columns, path)
    return path


def test_a_family_is_shown(csv):
    done = rig("fit", csv, "--points", "fraction")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert sum(line.startswith("5 x 13 (2, 2) ") for line in lines) == 6, "two tables for each of three sensors"
    tables = [line for line in lines if line.startswith(("13 x", "7 x", "5 x", "design")) and " is the " not in line]
    assert max(map(len, tables)) <= 80
    assert "fraction = { pitch_every = 2, roll_every = 2 }" in done.stdout


def test_one_fraction_is_shown_with_its_parameters(csv):
    done = rig("fit", csv, "--points", "50", "--temperature")
    assert done.returncode == 0, done.stderr
    assert "fitted with the declared model with temperature" in done.stdout
    assert "is the fraction nearest to 50 points" in done.stdout
    assert done.stdout.count("S / (V/g)") == 3
    found = json.loads(rig("fit", csv, "--points", "50", "--json").stdout)
    assert found["fractions"][0]["sensors"]["x_V"]["points"] == 6 * found["fractions"][0]["points"]


@pytest.mark.parametrize("option", [("--out", "a.json"), ("--traced",)])
def test_nothing_is_kept_of_a_fraction(csv, option):
    done = rig("fit", csv, "--points", "53", *option)
    assert done.returncode == 2
    assert f"leave {option[0]} away" in done.stderr
