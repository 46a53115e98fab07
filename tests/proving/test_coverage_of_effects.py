"""Results where nobody declared an effect, beside what the world gives at rest: a share of the campaign.

In full: `python -m proving coverage_effects general`; figures in proving/notes/coverage_effects.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from proving.statistics.coverage_effects import IN_WHOLE_PLOTS, OF_ATTITUDE, _attitude, _general, _whole_plot, shares
from proving.truth.stands import EFFECTS

FARTHEST = 1.6
"""Three standard uncertainties: of some two hundred errors here hardly any is farther by chance."""


def _holds(found) -> None:
    """By the remedy that a certificate names, `--traced`, and without it, where a line counts the effect."""
    for word in ("traced", "declared"):
        assert len(found[word]) >= 3
        assert np.abs(found[word]).max() < FARTHEST


@pytest.mark.parametrize("name", EFFECTS)
def test_results_of_stands_hold_at_rest(name):
    """A drifting sensitivity was 20 expanded uncertainties off: its mean was taken off as an offset."""
    _holds(_general(0, name))


@pytest.mark.parametrize(
    ("meter", "name", "seed"),
    [
        # the setting of the lag is a function of two columns, which the model has under another name
        ("pH electrode", "creep", 0),
        ("hot-wire anemometer", "sensitivity drift", 0),
        ("turbine flow meter", "direction", 0),
    ],
)
def test_results_of_meters_of_no_example_hold_at_rest(meter, name, seed):
    """Budgets ended in a fault where the effect found changed what a model is made of."""
    _holds(_general(seed, name, meter))


def test_the_error_of_a_creeps_time_constant_is_in_its_results():
    """It was taken as known: 86 % of such results held, and of these 16 only 11."""
    errors = np.abs([_general(seed, "creep")["traced"] for seed in (1, 3, 5, 6)])
    print("errors over U:", errors.round(2).tolist())
    assert np.count_nonzero(errors < 1.0) >= 14


def test_the_inversion_of_a_square_root_stays_in_its_domain():
    """At zero it went a rounding below it, and the budget ended in a fault; that of the declared model is refused."""
    found = _general(9, "square")
    assert len(found["traced"]) == 4
    assert np.abs(found["traced"]).max() < FARTHEST
    assert found["declared"] == []


@pytest.mark.parametrize("name", IN_WHOLE_PLOTS)
def test_results_in_whole_plots_hold_at_rest(name):
    _holds(_whole_plot(0, name))


@pytest.mark.parametrize("name", OF_ATTITUDE)
def test_results_of_attitude_sensors_hold_at_rest(name):
    _holds(_attitude(0, name))


def test_an_effect_of_time_in_whole_plots_moves_results(monkeypatch):
    """It had no line, since it stayed in the scatter."""
    seen = []
    module = __import__("proving.statistics.coverage_effects", fromlist=["with_undeclared"])
    ask = module.with_undeclared

    def kept(*args, **options):
        seen.append(ask(*args, **options))
        return seen[-1]

    monkeypatch.setattr(module, "with_undeclared", kept)
    _whole_plot(0, "gain drifts")
    assert any("output" in name for name in seen[0].undeclared)


def test_shares_are_of_errors_and_of_statements():
    one = {f"{word}{more}": value for word in ("traced", "declared") for more, value in (("", [0.5, -2.0]),)}
    one |= {f"{word}, stated": [(0.9, True), (0.97, False)] for word in ("traced", "declared")}
    found = shares([one])
    assert found["traced"]["held"] == 50.0
    assert found["traced"]["conform at 0.8 to 0.95"] == [0.9, 1.0, 1]
    assert found["traced"]["conform at 0.95 to 1"] == [0.97, 0.0, 1]


def test_a_carry_over_knows_what_stood_before_the_first_row():
    """The first row was taken to come from its own force, not from none; a lag was named instead: 79 % of
    such results held, and of these 16 only 7.
    """
    errors = np.abs([_general(seed, "carry-over")["traced"] for seed in (1000, 1002, 1003, 1009)])
    print("errors over U:", errors.round(2).tolist())
    assert np.count_nonzero(errors < 1.0) >= 14
