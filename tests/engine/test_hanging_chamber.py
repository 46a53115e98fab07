"""A chamber whose readback hangs is no proof that it stood; one that is coarse is not doubted for standing still."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ideal_pressure_bench import PROCEDURE

from rig.engine.whole_plots import WholePlots, renewal
from rig.errors import BenchFault

RUN_LIST = PROCEDURE.expand()
CHAMBERS = dict(zip((f.name for f in RUN_LIST.hard), ("cold_box", "hot_box"), strict=True))
POINT = RUN_LIST.points[0]
GAP_S = PROCEDURE.recovery.continue_gap_s
LONGER = f"min, longer than continue_gap_s = {GAP_S:g} s"
RESTARTED = "the controller's machine was restarted, so it is not known how long the bench was left alone"


def rules(steps, coarse=False):
    """After points of one whole plot, at which the cold box read so much more than its setpoint."""
    bench = SimpleNamespace(
        soaks=lambda factor: (CHAMBERS[factor], None),
        instruments={},
        by_hand=lambda factor: None,
        coarse=lambda chamber: coarse,
        config=SimpleNamespace(factors={}, thermometers=lambda factor: ()),
    )
    found = WholePlots(bench, RUN_LIST, PROCEDURE.conduct.whole_plots)
    for off in steps:
        found.note(1, states(found, off))
    return found


def states(found, off, **more):
    targets = found.targets(POINT)
    return {
        name: {"running": True, "setpoint_degC": target, "temperature_degC": target + off * (name == "cold_box")}
        | (more if name == "cold_box" else {})
        for name, target in targets.items()
    }


FINE = [0.01, 0.013, 0.008, 0.011, 0.009, 0.012, 0.007, 0.0125]


def test_what_always_changed_and_stands_for_a_minute_hangs():
    found = rules(FINE)
    assert found.lost_now(POINT, states(found, 0.0125, unchanged_s=59.0), {}) == ""
    why = found.lost_now(POINT, states(found, 0.0125, unchanged_s=61.0), {})
    assert why.startswith("cold_box hangs: it has read ")
    assert why.endswith(" degC for 61 s")


@pytest.mark.parametrize("steps", [[*FINE[:5], FINE[4], *FINE[5:]], [0.0] * 9, FINE[:6]])
def test_a_coarse_one_or_one_of_which_little_is_known_is_believed(steps):
    found = rules(steps)
    assert found.lost_now(POINT, states(found, 0.0, unchanged_s=600.0), {}) == ""


def test_neighbours_in_different_whole_plots_say_nothing():
    found = rules([])
    for identity, off in enumerate(FINE * 3):
        found.note(identity, states(found, off))
    assert found.lost_now(POINT, states(found, 0.0, unchanged_s=600.0), {}) == ""


def test_the_second_reading_of_a_hang_does_not_pass_for_the_chambers_habit():
    found = rules([*FINE, FINE[-1]])
    assert "hangs" in found.lost_now(POINT, states(found, FINE[-1], unchanged_s=103.0), {})
    assert found.doubted_s == 103.0


@pytest.mark.parametrize(
    ("stood_s", "believed"),
    [({}, True), ({"stood_s": 40.0}, True), ({"stood_s": 60.0}, False), ({"stood_s": 75.0}, False)],
)
def test_one_that_moved_again_soon_is_coarser_than_it_seemed(stood_s, believed):
    found = rules([*FINE, FINE[-1]])
    found.note(1, states(found, 0.010, **stood_s))
    assert (found.lost_now(POINT, states(found, 0.010, unchanged_s=600.0), {}) == "") is believed


def test_one_that_moved_again_after_it_hung_is_no_coarser_than_it_was():
    found = rules([*FINE, FINE[-1]])
    found.note(1, states(found, 0.010, stood_s=75.0))
    found.note(1, states(found, 0.011))
    assert "hangs" in found.lost_now(POINT, states(found, 0.011, unchanged_s=61.0), {})


def test_nothing_is_in_doubt_where_nothing_is_lost():
    """A pressure may have its whole plot measured again by a policy, while its chambers are where they should be."""
    found = rules(FINE)
    assert found.doubted_s == 0.0
    assert found.lost_now(POINT, states(found, 0.0125, unchanged_s=59.0), {}) == ""
    assert found.doubted_s == 0.0


def test_what_was_read_while_it_stood_is_in_doubt_however_the_loss_is_found():
    found = rules(FINE)
    assert "is at" in found.lost_now(POINT, states(found, 1.5, stood_ago_s=50.0), {})
    assert found.doubted_s == 50.0
    assert found.lost_now(POINT, states(found, 0.01), {}) == ""
    assert found.doubted_s == 0.0
    as_found = {"chambers": states(found, 1.5, stood_ago_s=20.0)}
    assert "is at" in found.lost_meanwhile(POINT, 1.0, certain=True, watched=False, restarted=[], as_found=as_found)
    assert found.doubted_s == 20.0
    assert found.lost_meanwhile(POINT, 1e9, certain=True, watched=False, restarted=[], as_found=as_found)
    assert found.doubted_s == 0.0


def test_a_coarse_chamber_casts_no_doubt_on_what_was_read_while_it_stood():
    found = rules([*FINE[:5], FINE[4], *FINE[5:]])
    assert "is at" in found.lost_now(POINT, states(found, 1.5, stood_ago_s=50.0), {})
    assert found.doubted_s == 0.0


def test_a_loss_without_a_chamber_that_stood_doubts_nothing():
    found = rules(FINE)
    assert "is at" in found.lost_now(POINT, states(found, 1.5), {})
    assert found.doubted_s == 0.0


@pytest.mark.parametrize(
    ("idle_s", "certain", "restarted", "why"),
    [
        (
            1.0,
            False,
            [],
            RESTARTED,
        ),
        (GAP_S, True, [], ""),
        (
            GAP_S + 90.0,
            True,
            [],
            f"left alone for {GAP_S / 60 + 1.5:.0f} {LONGER}",
        ),
        (1.0, True, ["cold_box", "hot_box"], "cold_box and hot_box had no power meanwhile"),
    ],
)
def test_why_a_whole_plot_may_not_go_on(idle_s, certain, restarted, why):
    found = rules([])
    as_found = {"chambers": states(found, 0.0)}
    assert (
        found.lost_meanwhile(POINT, idle_s, certain=certain, watched=False, restarted=restarted, as_found=as_found)
        == why
    )


@pytest.mark.parametrize(("target", "left"), [(-90.0, -85.0), (22.9, 27.9), (23.0, 18.0), (60.0, 55.0)])
def test_a_temperature_that_stands_is_left_towards_ambient(target, left):
    assert renewal(target, 5.0) == pytest.approx(left)


def with_thermometers():
    bench = SimpleNamespace(
        soaks=lambda factor: (CHAMBERS[factor], None),
        instruments={},
        by_hand=lambda factor: None,
        coarse=lambda chamber: False,
        config=SimpleNamespace(factors={}, thermometers=lambda factor: (factor,)),
    )
    return WholePlots(bench, RUN_LIST, PROCEDURE.conduct.whole_plots)


@pytest.mark.parametrize(("off", "lost"), [(0.0, False), (0.99, False), (1.01, True), (-1.01, True)])
def test_a_thermometer_at_the_sensors_that_has_left_its_band_loses_the_whole_plot(off, lost):
    found, factor = with_thermometers(), RUN_LIST.hard[0].name
    target = found.targets(POINT)[CHAMBERS[factor]]
    tolerance = PROCEDURE.soak.sensor_tolerance_degC
    seen = {factor: SimpleNamespace(mean=target + off * tolerance)}
    why = found.lost_now(POINT, states(found, 0.0), seen)
    assert bool(why) is lost
    assert why == (f"{factor} is {target + off * tolerance:.2f} degC, not {target:g} degC" if lost else "")
    assert rules([]).lost_now(POINT, states(found, 0.0), seen) == ""  # none is recorded there


def test_a_soak_is_judged_by_the_procedure_in_the_units_of_its_clock():
    found, soak = with_thermometers(), PROCEDURE.soak
    criteria = found.criteria(POINT)
    assert criteria.keys() == {*CHAMBERS, *CHAMBERS.values()}
    for factor, chamber in CHAMBERS.items():
        assert criteria[chamber].band == soak.tolerance_degC
        assert criteria[factor].band == soak.sensor_tolerance_degC
        for name in (factor, chamber):
            assert criteria[name].target == found.targets(POINT)[chamber]
            assert criteria[name].drift_per_s == pytest.approx(soak.drift_degC_per_h / 3600.0)


@pytest.mark.parametrize(("share", "left"), [(0.49, False), (0.51, True)])
def test_temperatures_half_of_renew_degc_away_have_been_left(share, left):
    found = rules([])
    assert found.left(POINT, states(found, share * PROCEDURE.soak.renew_degC)) is left


def test_a_thermometer_that_is_open_three_times_in_a_row_ends_a_soak_and_not_before():
    found, open_, good = with_thermometers(), 9.9e37, 20.0
    values = dict.fromkeys(CHAMBERS, good)
    broken = values | {RUN_LIST.hard[0].name: open_}
    for polls in (broken, broken, values, broken, broken):
        found.check_thermometers(polls)
    with pytest.raises(BenchFault, match="3 times in a row"):
        found.check_thermometers(broken)


SETTLING = [-0.5 * 0.5**k for k in range(9)]


def rounded(steps, resolution):
    return [round(one / resolution) * resolution for one in steps]


@pytest.mark.parametrize("resolution", [0.001, 0.005])
def test_one_that_has_settled_stands(resolution):
    """It changed at every point until its display could not show a change any more."""
    steps = [off for k, off in enumerate(rounded(SETTLING, resolution)) if k < 7]
    assert len(set(steps)) == len(steps)
    found = rules([*steps, steps[-1]])
    assert found.lost_now(POINT, states(found, steps[-1], unchanged_s=3600.0), {}) == ""
    assert found.doubted_s == 0.0


def test_one_that_stands_on_its_way_to_its_setpoint_hangs():
    steps = [-0.5 + 0.03 * k + 0.001 * (k % 3) for k in range(8)]
    found = rules(steps)
    assert "hangs" in found.lost_now(POINT, states(found, steps[-1], unchanged_s=61.0), {})


def test_one_that_stands_farther_from_its_setpoint_than_ever_hangs():
    """Its last readings before came nearer and nearer, as of one that settles."""
    found = rules([-0.05, -0.03, -0.018, -0.011, -0.007, -0.005, -0.004, 0.2, 0.2])
    assert "hangs" in found.lost_now(POINT, states(found, 0.2, unchanged_s=61.0), {})


def test_one_that_flickers_by_its_last_digit_may_stand():
    found = rules([0.0, 0.01, 0.0, 0.01, 0.0, 0.01, 0.0, 0.01])
    assert found.lost_now(POINT, states(found, 0.01, unchanged_s=600.0), {}) == ""


def test_what_the_bench_calls_coarse_never_hangs():
    found = rules(FINE, coarse=True)
    assert found.lost_now(POINT, states(found, 0.0125, unchanged_s=600.0), {}) == ""
