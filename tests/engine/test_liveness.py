"""Whether a meter hangs or stands still: by what it has done before."""

from __future__ import annotations

import random

import pytest

from rig.engine.liveness import Liveness
from rig.engine.measuring import Channel, Observation
from rig.procedures.attitude.settings import PitchRollProcedure

POINTS = (
    PitchRollProcedure.model_validate(
        {"kind": "pitch-roll", "name": "night", "replications": 4, "design": {"type": "T6"}}
    )
    .expand()
    .points
)
THREE = dict.fromkeys(("x_V", "y_V", "z_V"), "scanner")


def observed(readings):
    return Observation({name: Channel(tuple(values)) for name, values in readings.items()}, {})


def lively(rng, at, count=3):
    return observed({name: [at + k + rng.gauss(0.0, 1e-4) for _ in range(count)] for k, name in enumerate(THREE)})


def still(at, count=3, of=THREE):
    return observed({name: [at + k] * count for k, name in enumerate(of)})


def test_a_meter_that_hangs_at_the_very_first_point_is_not_believed_however_often_it_is_asked():
    alive = Liveness(THREE, None, {})
    for _ in range(6):
        assert alive.hanging(POINTS[0], still(1.0), {}) == list(THREE)
    assert not alive.hanging(POINTS[0], lively(random.Random(1), 1.0), {})


def test_a_coarse_meter_is_doubted_at_one_point_and_believed_from_then_on():
    alive = Liveness(THREE, None, {})
    assert alive.hanging(POINTS[0], still(0.5), {})
    for k, point in enumerate(POINTS[1:]):
        assert not alive.hanging(point, still(1.0 + k), {})
    assert not alive.hanging(POINTS[0], still(0.25), {})


def test_a_meter_that_hangs_at_a_number_it_never_read_before_is_told_by_its_other_points():
    rng, alive = random.Random(2), Liveness(THREE, None, {})
    for point in POINTS[:10]:
        assert not alive.hanging(point, lively(rng, point.setpoints[0]), {})
    assert alive.hanging(POINTS[10], still(7.0), {}) == list(THREE)


def alone(rng, at):
    return observed({"meter_V": [at + rng.gauss(0.0, 1e-4) for _ in range(3)]})


def test_a_meter_that_returns_to_its_last_reading_of_another_setting_hangs_whatever_it_read_in_between():
    """An open input over a hanging meter: its wandering readings are rejected, then the old reading is back."""
    rng, alive = random.Random(3), Liveness({"meter_V": "dmm"}, None, {})
    before = alone(rng, 1.0)
    assert not alive.hanging(POINTS[0], before, {})
    for _ in range(2):
        assert not alive.hanging(POINTS[1], alone(rng, 0.0), {})
    back = observed({"meter_V": [before.outputs["meter_V"].readings[-1]] * 3})
    assert alive.hanging(POINTS[1], back, {}) == ["meter_V"]


def test_a_meter_that_returns_to_a_rejected_reading_of_this_point_hangs():
    rng, alive = random.Random(4), Liveness({"meter_V": "dmm"}, None, {})
    assert not alive.hanging(POINTS[0], alone(rng, 1.0), {})
    first = alone(rng, 0.0)
    assert not alive.hanging(POINTS[1], first, {})
    assert not alive.hanging(POINTS[1], alone(rng, 0.0), {})
    back = observed({"meter_V": [first.outputs["meter_V"].readings[0]] * 3})
    assert alive.hanging(POINTS[1], back, {}) == ["meter_V"]


@pytest.mark.parametrize(("coarse", "hangs"), [(False, True), (True, False)])
def test_a_meter_that_begins_to_hang_at_an_open_input_is_told_by_the_scatter_before_it(coarse, hangs):
    """Wandering readings of a point were rejected; then all are one that was never read before. Seed 45 of a night."""
    rng, alive = random.Random(6), Liveness({"meter_V": "dmm"}, None, {})
    for k in range(3):
        one = observed({"meter_V": [float(k)] * 3}) if coarse else alone(rng, float(k))
        alive.hanging(POINTS[k], one, {})
    at = next(p for p in POINTS if p.setpoints != POINTS[2].setpoints)
    assert not alive.hanging(at, observed({"meter_V": [rng.gauss(0.0, 0.05) for _ in range(4)]}), {})
    assert not alive.hanging(at, observed({"meter_V": [rng.gauss(0.0, 0.05) for _ in range(4)]}), {})
    assert bool(alive.hanging(at, observed({"meter_V": [-0.0322512787] * 4}), {})) == hangs


@pytest.mark.parametrize(
    ("before", "begun", "doubted"),
    [
        ([1.0, 1.1, 1.2], 0, True),  # a session begins: what its predecessor read last was perhaps never written
        ([1.0, 1.0, 1.1], 0, False),  # coarse
        ([], 0, False),  # never read
        ([], 2, True),  # never read, and an answer was lost
    ],
)
def test_equal_readings_after_readings_that_were_not_kept_are_doubted_once(before, begun, doubted):
    alive = Liveness({"meter_V": "dmm"}, POINTS[0], {"meter_V": before} if before else {})
    for _ in range(begun):
        alive.begin()
    at = next(p for p in POINTS if p.setpoints != POINTS[0].setpoints)
    again = observed({"meter_V": [5.0] * 3})
    for _ in range(2):
        assert bool(alive.hanging(at, again, {})) == doubted
    assert not alive.hanging(POINTS[0], observed({"meter_V": [4.0] * 3}), {}), "it moved: it is coarse at worst"
    assert not alive.hanging(at, again, {})


def test_a_measurement_without_a_result_lets_a_lively_meter_be_doubted_at_once():
    rng, alive = random.Random(5), Liveness({"meter_V": "dmm"}, None, {})
    for _ in range(2):
        alive.begin()
        assert not alive.hanging(POINTS[0], alone(rng, 1.0), {})
    at = next(p for p in POINTS if p.setpoints != POINTS[0].setpoints)
    alive.begin()
    alive.begin()
    assert alive.hanging(at, observed({"meter_V": [0.5] * 3}), {}) == ["meter_V"]


@pytest.mark.parametrize("seed", range(5))
def test_a_meter_that_stands_still_now_and_then_is_left_alone(seed):
    """All three readings on a channel the same at one point in three, each channel for itself."""
    rng, alive = random.Random(seed), Liveness(THREE, None, {})
    told = 0
    for k in range(200):
        at = {name: k + j for j, name in enumerate(THREE)}
        readings = {n: [v + 0.1 * rng.random()] * 3 for n, v in at.items()}
        for values in readings.values():
            if rng.random() > 1 / 3:
                values[1] += 1e-4
        told += bool(alive.hanging(POINTS[k % len(POINTS)], observed(readings), {}))
    assert told <= 2


def test_one_reading_a_point_says_nothing():
    alive = Liveness(THREE, None, {})
    assert not any(alive.hanging(point, still(0.1 * k, count=1), {}) for k, point in enumerate(POINTS))


def with_standard(values):
    """An output that is alive, and the readings of a reference standard of the pitch."""
    rng = random.Random(sum(values))
    read = Observation({"x_V": Channel(tuple(rng.gauss(0.0, 1e-4) for _ in values))}, {})
    read.references["pitch_deg"] = Channel(tuple(values))
    return read


@pytest.mark.parametrize(
    ("before", "moved", "hangs"),
    [
        ((1.0, 1.1, 1.2, 1.3), True, True),
        ((1.0, 1.1, 1.2, 1.3), False, True),  # it never gave the same reading twice
        ((1.2, 1.3, 1.3, 1.3), True, True),
        ((1.2, 1.3, 1.3, 1.3), False, False),  # coarse, and its factor stays
    ],
)
def test_a_reference_standard_that_hangs_is_not_believed(before, moved, hangs):
    readers = {"x_V": "scanner", "pitch_deg": "standard"}
    alive = Liveness(readers, None, {}, {"pitch_deg": 0})
    first = POINTS[0]
    after = next(p for p in POINTS if (p.setpoints[0] != first.setpoints[0]) == moved and p.index)
    assert not alive.hanging(first, with_standard(before), {})
    assert alive.hanging(after, with_standard((1.3,) * 4), {}) == (["pitch_deg"] if hangs else [])
