"""What a trace keeps never raises the error that it states, before against after on the same rows."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from strangers_tables import table

from proving.strangers.runs import scored
from rig.fitter.trace.keep import left_in, never_above, taken_out
from rig.fitter.trace.not_kept import in_place_of
from rig.procedures.pressure.trace.estimate import rises


class _Judge:
    """Effects by name, each of one sensor or of all, all significant."""

    def __init__(self, *effects):
        self.candidates = [SimpleNamespace(effect=SimpleNamespace(name=n), sensor=s) for n, s in effects]

    def unit(self, j):
        return (j,)

    def p_adjusted(self, chosen, j):
        return 0.001


def test_of_two_effects_that_raise_the_error_together_the_worse_one_goes_and_something_stays_there():
    judge = _Judge(("good", None), ("bad", None))
    error = {(): (1.0, 10.0), (0,): (0.8, 6.0), (1,): (1.1, 9.0), (0, 1): (1.2, 5.0)}
    stay, left = never_above(judge, (0, 1), lambda chosen: tuple(np.array([v]) for v in error[chosen]), (None,))
    assert stay == (0,)
    (gone,) = left
    assert gone.effect == "bad"
    assert gone.share == pytest.approx(1 - 5 / 6)
    assert "the error of all strata is larger with it" in gone.sentence
    (rest,) = in_place_of(left)
    assert rest.cause == "in the rows where bad would act, but with it the error rises"
    assert rest.share == gone.share
    assert [one.cause for one in in_place_of(left, "x_V")] == [rest.cause]


def test_effects_that_lower_the_error_all_stay():
    judge = _Judge(("one", None), ("two", None))
    stay, left = never_above(judge, (0, 1), lambda chosen: (np.array([1.0 - 0.1 * len(chosen)]),) * 2, (None,))
    assert (stay, left) == ((0, 1), ())


def test_what_raises_the_error_of_one_sensor_is_left_in_its_output_only():
    """Of all sensors; the second one has its own effect besides, which helps."""
    judge = _Judge(("line", None), ("own", "b"))

    def stated(inside):
        a = 1.0 if 0 in inside[0] else 1.1
        b = 0.7 if 0 not in inside[1] else 0.9
        return np.array([a, b])

    inside = left_in(judge, (0, 1), ("a", "b"), np.ones(2), stated)
    assert inside == (frozenset({0}), frozenset())
    np.testing.assert_array_equal(taken_out((0, 1), inside, 2), [[0, 1], [1, 1]])


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("record_cold_and_helium_after_stop", ""),
        (
            "worn_screw_and_damp_backing",
            "--response encoder_kct --formula 1_+_scale_mm --replicate series --time elapsed_h --direction sense",
        ),
    ],
)
def test_the_error_of_a_strangers_run_is_not_above_that_before(name, options):
    """Two of three runs of the fourth set where it was, by 7 % and by 0.4 %: no smaller table shows it."""
    run = scored(table(name, options), (), left_out=False)
    assert run["class"] not in {"crash", "refused"}
    assert not run["rose"], run["line"]


def test_a_transducers_error_rises_if_that_of_all_strata_together_does():
    def of(subplot: float, wholeplot: float) -> Any:
        return SimpleNamespace(fits=[SimpleNamespace(sigma_subplot=subplot, sigma_wholeplot=wholeplot)])

    assert rises(of(3.0, 4.0), of(2.9, 4.2), 0)
    assert not rises(of(3.0, 4.0), of(2.0, 4.5), 0)
