"""Points of a further run chosen by T-optimality, against brute force and against points that were not chosen."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from proving.truth import attitude
from rig.fitter.confirm import Later, Points, questions_of, separation
from rig.fitter.confirm.compare import NOTHING, Comparison, possible
from rig.fitter.confirm.question import Hypothesis
from rig.fitter.confirm.reduced import Reduced
from rig.procedures.attitude.confirming import short_path
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.designs import listed
from rig.procedures.attitude.orders import walk
from rig.procedures.attitude.settings import DesignSettings
from rig.procedures.attitude.together import AttitudeTogether
from rig.procedures.attitude.trace import trace

DAY_S = 86400.0
PADS, HEAD = "isolation-pad-deflection", "head-once-per-turn"


@pytest.fixture(scope="module")
def opened():
    """A sag of the pads without roll, confounded with an eccentric head, and its trace."""
    bench = attitude.Bench(sensors=(attitude.Sensor("x"),), compliance={("y", "x"): 8e-4})
    first, _ = attitude.simulate(bench, attitude.Plan(np.linspace(-180, 180, 13), np.zeros(1), replications=4), 3)
    found = trace(first)
    (question,) = questions_of(found)
    assert {m.effect for m in question.members} == {PADS, HEAD}
    return first, found, question


def planned(points_deg) -> AttitudeData:
    points = np.array(points_deg)
    n = len(points)
    return AttitudeData(
        replicate=np.ones(n, np.int64),
        order=np.arange(n),
        elapsed_s=30.0 * np.arange(1.0, n + 1.0),
        pitch_deg=points[:, 0],
        roll_deg=points[:, 1],
        sensor_temperature_degC=np.full(n, 23.0),
        outputs={"x_V": np.zeros(n)},
        pitch_side=np.ones(n, np.int64),
        roll_side=np.ones(n, np.int64),
    )


def candidates(opened, points_deg) -> Points:
    first, found, question = opened
    both = AttitudeTogether.of(found, first, [Later(planned(points_deg), DAY_S)])
    return Points.of([both], [question], np.arange(len(points_deg)), len(points_deg))


def test_the_distance_is_that_of_the_rivals_best_refit(opened) -> None:
    """Computed once more from whole columns by least squares: both runs, the declared model of each mounting apart."""
    first, found, question = opened
    at = [(p, r) for p in (-150.0, -60.0, 30.0, 120.0) for r in (0.0, 90.0, 180.0)]
    both = AttitudeTogether.of(found, first, [Later(planned(at), DAY_S)])
    told = candidates(opened, at)
    pads, head = (next(m for m in question.members if m.effect == name) for name in (PADS, HEAD))
    only = both.only(~both.fresh)
    size = np.linalg.lstsq(only.columns_of(pads.terms), only.outputs, rcond=None)[0]
    true, rival = both.columns_of(pads.terms) @ size, both.columns_of(head.terms)
    rest = true - rival @ np.linalg.lstsq(rival, true, rcond=None)[0]
    squares = {
        (rival.pairs[k], bool(k)): square
        for rival in told.rivals
        for k, square in enumerate(rival.squares(np.ones(len(at), np.bool_)))
    }
    assert any(value == pytest.approx(float(rest @ rest), rel=1e-3) for value in squares.values())


def test_a_triangular_factor_in_place_of_the_first_run_changes_no_statistic(opened) -> None:
    first, found, question = opened
    at = [(p, r) for p in (-150.0, -60.0, 30.0, 120.0) for r in (0.0, 90.0, 180.0)]
    later = replace(planned(at), outputs={"x_V": np.random.default_rng(5).normal(0.0, 1e-3, len(at))})
    both = AttitudeTogether.of(found, first, [Later(later, DAY_S)])
    short = Reduced.of(both, [question])
    assert short.fresh.size < both.fresh.size / 2
    whole, told = (Comparison(one, question).apart(one.outputs[:, None]) for one in (both, short))
    np.testing.assert_allclose(told.costs, whole.costs, rtol=1e-9)
    np.testing.assert_allclose(told.shown, whole.shown, rtol=1e-6)


def test_chosen_points_are_near_the_best_of_all_choices(opened) -> None:
    at = [(p, r) for p in (-135.0, -45.0, 45.0, 135.0) for r in (0.0, 90.0, 180.0)]
    points = candidates(opened, at)
    choice = points.choose([8], 0.0)[0].better
    best = 0.0
    for units in itertools.combinations(range(len(at)), 8):
        chosen = np.zeros(len(at), np.bool_)
        chosen[list(units)] = True
        best = max(best, float(points.sigmas(chosen).min()))
    assert len(choice.units) == 8
    assert choice.sigmas >= 0.9 * best


def test_chosen_points_separate_more_than_points_drawn_at_random(opened) -> None:
    at = [(p, r) for p in np.linspace(-180, 180, 19) for r in (0.0, 60.0, 120.0, 180.0)]
    points = candidates(opened, at)
    choice = points.choose([12], 0.0)[0].better
    rng = np.random.default_rng(1)
    drawn = []
    for _ in range(50):
        chosen = np.zeros(len(at), np.bool_)
        chosen[rng.choice(len(at), 12, replace=False)] = True
        drawn.append(float(points.sigmas(chosen).min()))
    assert choice.sigmas > max(drawn)
    assert choice.sigmas > 1.3 * np.median(drawn)


def test_a_pair_that_no_point_separates_has_no_influence(opened) -> None:
    """Without roll pads and head stay alike; the points are then chosen to show the effect."""
    points = candidates(opened, [(p, 0.0) for p in np.linspace(-180, 180, 25)])
    names = {frozenset(pair) for pair in points.pairs}
    assert frozenset({PADS, HEAD}) not in names
    assert names
    choice = points.choose([10], 0.0)[0].better
    assert choice.sigmas > 0.0


def test_nothing_is_planned_between_causes_that_the_runs_so_far_exclude(opened) -> None:
    """A question near the noise had 26 causes, 22 of them excluded barely: a decision took 100 s."""
    first, found, question = opened
    excluded = [one for one in found.explanations[question.effect] if one.sigmas > 4.0][:2]
    far = [Hypothesis(one.effect, one.terms, one.sigmas, near=True) for one in excluded]
    question = replace(question, members=(*question.members, *far))
    points = [(p, r) for p in np.linspace(-180, 180, 13) for r in (0.0, 90.0)]
    both = AttitudeTogether.of(found, first, [Later(planned(points), DAY_S)])
    rivals = Points.of([both], [question], np.arange(len(points)), len(points)).rivals
    told = separation(both, [question])[0].chances.keys()
    alike, apart = {PADS, HEAD}, {one.effect for one in far}
    assert len(apart) == 2
    for pairs in ({pair for rival in rivals for pair in rival.pairs}, told):
        assert {frozenset(pair) for pair in pairs} == {
            frozenset({one, other}) for one in alike for other in {*alike, *apart, NOTHING} - {one}
        }
    beside = replace(question, members=(*question.members, question.members[0].beside(far[0])))
    assert possible(np.array([0.0, 4.0, 16.0, 20.0, 16.0]), beside, both.df) == [0, 1, 4]


def test_a_design_of_listed_points() -> None:
    points = [(30.0, 90.0), (-30.0, 0.0), (0.0, 90.0)]
    design = DesignSettings(type="points", points_deg=points).build()
    assert sorted(design.points_deg()) == sorted(points)
    with pytest.raises(ValueError, match="listed twice"):
        listed([(0.0, 0.0), (0.0, 0.0)])
    with pytest.raises(ValueError, match="needs points_deg"):
        DesignSettings(type="points")
    with pytest.raises(ValueError, match="does not use pitch_deg"):
        DesignSettings(type="points", points_deg=points, pitch_deg=[0.0])


def test_listed_points_are_visited_in_their_order_and_back() -> None:
    """Each axis is approached in the direction of its motion, so that it has no way back."""
    points = [(30.0, 90.0), (-30.0, 90.0), (-30.0, 0.0), (0.0, 90.0)]
    design = listed(points)
    there = list(walk(design, backwards=False, up_and_down=False))
    back = list(walk(design, backwards=True, up_and_down=False))
    assert [(design.pitch_deg[v.row], design.roll_deg[v.column]) for v in there] == points
    assert [(v.row, v.column) for v in back] == [(v.row, v.column) for v in reversed(there)]
    assert [(v.pitch_side, v.roll_side) for v in there] == [(1, 1), (-1, 1), (-1, -1), (1, 1)]
    assert [(v.pitch_side, v.roll_side) for v in back] == [(-1, -1), (-1, -1), (-1, 1), (1, 1)]


def test_a_path_has_little_motion() -> None:
    at = np.array([(p, r) for p in (-60.0, 0.0, 60.0) for r in (0.0, 180.0)])
    path = short_path(at)
    assert sorted(map(tuple, path)) == sorted(map(tuple, at))
    assert np.max(np.abs(np.diff(path, axis=0)), axis=1).tolist() == [60.0, 60.0, 180.0, 60.0, 60.0]
