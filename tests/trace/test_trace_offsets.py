"""Is there a slope in a handful of numbers that may differ, or walk, by themselves? Against simulated numbers."""

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, simulate
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.attitude.trace.offsets import VARIANCES, slopes, wandering
from rig.procedures.attitude.trace.replications import slow_of

RUNS, SENSORS, N = 1500, 3, 6
TREND = np.arange(N) - 2.5


def numbers(rng, independent=0.0, walk=0.0, sensors=SENSORS):
    """(RUNS, S, n) scatter of readings; beside it offsets that differ, or means of a walk, in some."""
    v = rng.standard_normal((RUNS, SENSORS, N))
    v[:, :sensors] += independent * rng.standard_normal((RUNS, sensors, N))
    fine = np.cumsum(rng.standard_normal((RUNS, sensors, 20 * N)), axis=2) * walk / np.sqrt(20)
    v[:, :sensors] += fine.reshape(RUNS, sensors, N, 20).mean(axis=3)
    return v


def p_of(v, walk=0.0, **known):
    """(RUNS,) p of a trend in the first sensor, and its sign."""
    v = np.moveaxis(v - v.mean(axis=2, keepdims=True), 0, 2)
    x = np.broadcast_to(TREND[None, :, None], v.shape)
    tested = np.arange(SENSORS)[:, None] == np.zeros(RUNS)
    return slopes(x, v, tested, ~tested, np.full((SENSORS, RUNS), walk), **known)


@pytest.mark.parametrize(
    ("what", "most"),
    [
        ({}, 0.005),
        ({"independent": 10.0}, 0.012),
        ({"walk": 1.0}, 0.02),
        ({"walk": 10.0}, 0.05),
        ({"walk": 10.0, "sensors": 1}, 0.08),
    ],
    ids=["readings", "independent", "a small walk", "a large walk", "one sensor walks"],
)
def test_a_trend_by_chance(what, most):
    """P below 1 % come as often as the docstring of the module says: five times as often where one sensor walks."""
    p, _ = p_of(numbers(np.random.default_rng(0), **what))
    assert np.mean(p < 0.01) < most


def test_a_trend_is_found_and_its_sign():
    v = numbers(np.random.default_rng(1))
    v[:, 0] -= 14.0 * TREND / np.linalg.norm(TREND)
    p, sign = p_of(v)
    assert np.mean(p < 1e-3) > 0.8
    assert np.all(sign == -1.0)
    # within replications a walk was seen that wide: it may have done it
    assert np.mean(p_of(v, walk=16.0)[0] < 1e-3) < 0.05


def test_a_trend_is_clearer_where_nothing_else_wanders():
    """One sensor alone rarely wanders: beside two quiet ones its trend is found seven times in ten."""
    v = numbers(np.random.default_rng(2))
    v[:, 0] += 11.0 * TREND / np.linalg.norm(TREND)
    quiet = np.mean(p_of(v)[0] < 1e-3)
    v[:, 1:] += numbers(np.random.default_rng(3), walk=3.0)[:, 1:]
    walking = np.mean(p_of(v)[0] < 1e-3)
    assert quiet > 0.7
    assert walking < 0.1


def test_a_walk_that_shows_within_replications_is_no_trend():
    rng = np.random.default_rng(4)
    within = np.zeros((VARIANCES.size, SENSORS, RUNS))
    within[VARIANCES > 10.0, 0] = 6.0  # the first sensor's walk, 6 nats likelier than none
    v = numbers(rng, walk=6.0, sensors=1)
    unknown, known = (np.mean(p_of(v, **more)[0] < 0.01) for more in ({}, {"within": within}))
    assert known < 0.05 < unknown


def test_evidence_that_numbers_wander():
    rng = np.random.default_rng(5)
    quiet, walking = (wandering(numbers(rng, walk=walk)[:, 0]) for walk in (0.0, 5.0))
    assert np.mean(quiet > 0.0) < 0.2
    assert np.mean(walking > 2.0) > 0.9


def test_sensors_that_a_term_does_not_concern_have_that_of_the_same_term_on_them():
    """One pair of columns after the other, as it is defined."""
    data, _ = simulate(Bench(), D1(180, 7, 7, order="random"), 3)
    problem = make_problem(data, CATALOGUE)
    slow = slow_of(problem)
    of = {(c.effect.name, c.term.name, c.sensor): j for j, c in enumerate(problem.candidates)}
    compared = 0
    for q, j in enumerate(slow.columns.tolist()):
        one = problem.candidates[j]
        for i, sensor in enumerate(problem.sensors):
            same = of.get((one.effect.name, one.term.name, sensor))
            if slow.tested[:, q].sum() == 1 and not slow.tested[i, q] and same in slow.columns:
                at = int(np.flatnonzero(slow.columns == same)[0])
                if slow.tested[i, at]:
                    compared += 1
                    assert slow.others[i, q]
                    assert np.array_equal(slow.x[i, :, q], slow.x[i, :, at])
                    assert np.array_equal(slow.direction[i, :, q], slow.direction[i, :, at])
    assert compared > 10
