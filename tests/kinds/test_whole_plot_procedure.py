"""The whole-plot procedure expands to the paper's design, and refuses what cannot be run."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from pydantic import ValidationError

from rig.procedures.pressure.planned import precision
from rig.procedures.pressure.settings import WholePlotDesign, WholePlotProcedure


def procedure(**settings):
    return WholePlotProcedure.model_validate({"kind": "whole-plot", "name": "test", "seed": 3, **settings})


def by_whole_plot(run_list):
    return [list(points) for _, points in itertools.groupby(run_list.points, key=lambda p: p.whole_plot)]


def test_the_papers_design_is_the_default():
    """McCollum, Commo and Parker, section II.B: 20 whole plots, nine pairs of temperatures, 220 points."""
    run_list = procedure().expand()
    plots = by_whole_plot(run_list)
    assert (len(run_list), len(plots)) == (220, 20)
    for points in plots:
        pressures = Counter(p.setpoints[0] for p in points)
        once, twice = (0.12, 0.5, 0.79, 1.0, 4.0), (0.01, 2.5, 5.0)
        assert pressures == dict.fromkeys(once, 1) | dict.fromkeys(twice, 2)
        assert len({p.setpoints[1:] for p in points}) == 1
    pairs = Counter(points[0].setpoints[1:] for points in plots)
    assert len(pairs) == 9
    assert pairs[-90.0, 0.0] == 6
    assert pairs[-130.0, 0.0] == pairs[-50.0, 0.0] == 2
    assert pairs[-90.0, 40.0] == pairs[-90.0, -40.0] == 1
    assert sorted(pairs.values()) == [1, 1, 2, 2, 2, 2, 2, 2, 6]
    distance = {round(np.hypot((s + 90) / 40, t / 40), 6) for s, t in pairs if (s, t) != (-90.0, 0.0)}
    assert distance == {1.0}, "spherical"


def test_cubes_of_a_temperature_are_aliases_of_mixed_terms_on_that_design():
    """Exactly, beside the second-order terms: with the axial points scaled to 1, x^3 = x - x y^2 and likewise for y."""
    x, y = (np.array([p.setpoints[i] for p in procedure().expand().points]) for i in (1, 2))
    x, y = (x + 90) / 40, y / 40
    np.testing.assert_allclose(x**3, x - x * y**2, atol=1e-6)
    np.testing.assert_allclose(y**3, y - x**2 * y, atol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_no_two_whole_plots_with_the_same_temperatures_follow_one_another(seed):
    run_list = procedure(seed=seed, replications=2).expand()
    temperatures = [points[0].setpoints[1:] for points in by_whole_plot(run_list)]
    assert all(a != b for a, b in itertools.pairwise(temperatures))
    assert Counter(temperatures[:20]) == Counter(temperatures[20:])
    assert [p.replication for p in run_list.points] == [1] * 220 + [2] * 220


def test_every_pressure_comes_first_about_as_often():
    """Fully randomised: over many seeds each of the eleven places holds 5 psia twice in eleven times."""
    places = np.zeros(11)
    for seed in range(100):
        for points in by_whole_plot(procedure(seed=seed).expand()):
            places += [p.setpoints[0] == 5.0 for p in points]
    expected, spread = 2000 * 2 / 11, np.sqrt(2000 * 2 / 11 * 9 / 11)
    assert np.all(np.abs(places - expected) < 4 * spread)


def test_sides_of_approach_follow_from_the_order_and_the_first_of_a_whole_plot_may_come_from_anywhere():
    """But not from where it is to go: two whole plots would share one setting, and its error."""
    last = None
    for points in by_whole_plot(procedure(replications=3).expand()):
        assert points[0].sides[0] == (-1 if points[0].setpoints[0] == last else 0)
        last = points[-1].setpoints[0]
        for before, now in itertools.pairwise(points):
            assert now.sides[0] == (1 if now.setpoints[0] > before.setpoints[0] else -1)


def test_the_same_seed_gives_the_same_list_and_another_another():
    assert procedure().expand().sha256() == procedure().expand().sha256()
    assert procedure().expand().sha256() != procedure(seed=4).expand().sha256()


@pytest.mark.parametrize(
    ("design", "message"),
    [
        ({"type": "list"}, "needs temperatures_degC"),
        ({"temperatures_degC": [[1, 2]]}, "does not use temperatures_degC"),
        ({"type": "list", "temperatures_degC": []}, "no whole plots"),
        ({"factorial": 0, "axial_sensor": 0, "axial_sse": 0, "centre": 0}, "no whole plots"),
        ({"pressures_psia": [1, 1, 2]}, "has a pressure twice"),
        ({"repeated_psia": [3]}, "3 psia, which is not in pressures_psia"),
        ({"pressures_psia": [-1, 2], "repeated_psia": []}, "greater than or equal to 0"),
    ],
)
def test_designs_that_cannot_be_are_refused(design, message):
    with pytest.raises(ValidationError, match=message):
        procedure(design=design)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"soak": {"renew_degC": 1.0}}, "must be twice what is tolerated"),
        ({"approach": {"overtravel_psia": 0.003}}, "a pressure would not be left"),
        ({"replications": 1000}, "more than 100000"),
        ({"acceptance": {"reading_error_pct": 2, "at_psia": 0.3}}, "is no pressure of the design"),
    ],
)
def test_settings_that_would_end_a_night_are_refused(settings, message):
    with pytest.raises(ValidationError, match=message):
        procedure(**settings)


@pytest.mark.parametrize("half_range", [0, 0.0, 1e-9])
def test_a_temperature_without_a_range_is_named(half_range):
    """The message is about the half range, and about nothing else that could be changed instead."""
    with pytest.raises(ValidationError) as refused:
        WholePlotDesign(sse_temperature={"centre_degC": 0, "half_range_degC": half_range})
    (error,) = refused.value.errors()
    assert error["loc"] == ("sse_temperature", "half_range_degC")
    assert "both extremes would be the centre" in error["msg"]


def test_precision_of_the_papers_design():
    """Fourteen degrees of freedom between whole plots and 196 below; terms of the two strata in the ratio of errors."""
    expect = {"sigma_wholeplot_mV": 0.0126, "sigma_subplot_mV": 0.004}
    found = precision(procedure(expect=expect), procedure().expand())
    rows = {row["term"]: row for row in found.rows}
    assert [rows[t]["stratum"] for t in ("1", "T_sensor", "T_SSE^2", "T_sensor:T_SSE")] == ["whole plot"] * 4
    assert [rows[t]["stratum"] for t in ("P", "P^2", "P:T_sensor", "P:T_SSE")] == ["subplot"] * 4
    for row in rows.values():
        if row["term"] != "1":  # at the middle pressure, where no readings are, the constant takes a little of both
            assert row["df"] == pytest.approx(14 if row["stratum"] == "whole plot" else 196, abs=0.1)
    # T_sensor alone at the middle pressure: sum of squares of the coded column is 8 * 1/2 + 4 * 1 whole plots
    between = np.sqrt(0.0126**2 + 0.004**2 / 11)
    assert rows["T_sensor"]["sd_mV"] == pytest.approx(between / np.sqrt(8), rel=0.02)
    assert "0.12 psia in use" in " ".join(found.further)
