"""Decisions on conformity: printed examples, other programs' numbers, words at every place of the number line."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import special

from rig.fitter.decision import (
    GuardBand,
    ProbabilityLimit,
    SharedRisk,
    SimpleAcceptance,
    Tolerance,
    conformity_probability,
    decide,
    gamma_prior,
    global_risks,
    guard_band_for,
    guard_factor,
    normal_prior,
)
from rig.fitter.errors import FitError

UNIT = Tolerance(-1.0, 1.0)


@pytest.mark.parametrize(
    ("value", "u", "tolerance", "printed", "digits"),
    [
        (-5.47, 0.05, Tolerance(upper=-5.40), 0.92, 2),  # breakdown voltage of a Zener diode, in V
        (509.7, 8.6, Tolerance(lower=490.0), 0.99, 2),  # burst strength of a container, in kPa
        (13.6, 1.8, Tolerance(12.5, 16.3), 0.66, 2),  # viscosity of a motor oil, in mm2/s
    ],
)
def test_conformance_probabilities_of_the_examples_of_jcgm_106(value, u, tolerance, printed, digits):
    """JCGM 106:2012, 7.3 and 7.4. Numbers from memory of the printed text, which was not at hand."""
    assert round(conformity_probability(value, u, tolerance), digits) == printed


def test_distances_from_a_limit_are_those_of_table_1_of_jcgm_106():
    """z at which a value conforms to one limit with probability p; the numbers are those of the normal distribution."""
    table = {0.80: 0.84, 0.90: 1.28, 0.95: 1.64, 0.99: 2.33, 0.999: 3.09}
    for p, z in table.items():
        assert conformity_probability(-z, 1.0, Tolerance(upper=0.0)) == pytest.approx(p, abs=0.002)
        assert round(guard_factor(1.0 - p, 1.0), 2) == z


def test_speed_control_of_jcgm_106():
    """Clause 8.3.3: with u = 2 % of the speed, 100 km/h are exceeded with 99.9 % from 107 km/h on."""
    limit = 100.0 / (1.0 - 0.02 * guard_factor(0.001, 1.0))
    assert round(limit) == 107
    assert (
        decide(
            limit + 0.01, 0.02 * limit, Tolerance(upper=100.0), ProbabilityLimit(0.999), expanded_uncertainty=4.0
        ).word
        == "fail"
    )
    assert (
        decide(
            limit - 0.01, 0.02 * limit, Tolerance(upper=100.0), ProbabilityLimit(0.999), expanded_uncertainty=4.0
        ).word
        == "noFail"
    )


def test_ball_bearings_of_jcgm_106():
    """Clause 9.5.4, a gamma prior; to the digits that suncal 1.6 gives (doc/API Examples, by hand)."""
    bearings, limit = gamma_prior(4.0, 0.25), Tolerance(upper=2.0)
    found = global_risks(bearings, 0.25, limit, limit)
    assert 1.0 - found.conforming == pytest.approx(0.04238011199168401, abs=1e-12)
    assert found.consumer == pytest.approx(0.008019111884303471, abs=1e-10)
    guard = guard_band_for(0.001, bearings, 0.25, limit)
    assert 2.0 - guard == pytest.approx(1.6718287715440068, abs=1e-8)
    assert round(2.0 - guard, 1) == 1.7


def test_consumers_risks_of_normal_items_are_those_of_rp_19():
    """Table of NCSLI's draft RP-19, as suncal's own test has it: 4 to 1, six shares of conforming items."""
    unconditional = [4.83860326, 3.92234109, 2.85583037, 1.59995312, 0.87100925, 0.19991684]
    of_accepted = [8.26008199, 5.72322042, 3.63227145, 1.79880430, 0.92389664, 0.20243866]
    for share, consumer, conditional in zip([0.6, 0.7, 0.8, 0.9, 0.95, 0.99], unconditional, of_accepted, strict=True):
        sd = 1.0 / float(special.ndtri(0.5 * (1.0 + share)))
        found = global_risks(normal_prior(0.0, sd), sd / 4.0, UNIT, UNIT)
        assert found.conforming == pytest.approx(share, abs=1e-10)
        assert 100.0 * found.consumer == pytest.approx(consumer, abs=2e-6)
        assert 100.0 * found.consumer_of_accepted == pytest.approx(conditional, abs=2e-6)


def test_risks_of_deaver():
    """Deaver (1993), as suncal's own test has it: sd 4 and 1, limits of 8."""
    found = global_risks(normal_prior(0.0, 4.0), 1.0, Tolerance(-8.0, 8.0), Tolerance(-8.0, 8.0))
    assert (round(found.consumer, 3), round(found.producer, 3)) == (0.008, 0.015)


def test_global_risks_are_shares_of_simulated_items():
    rng, n = np.random.default_rng(106), 400_000
    items = rng.normal(0.3, 0.7, n)
    measured = items + 0.4 * rng.standard_t(5.0, n)
    tolerance, acceptance = Tolerance(-1.0, 1.0), Tolerance(-0.8, 0.8)
    found = global_risks(normal_prior(0.3, 0.7), 0.4, tolerance, acceptance, df=5.0)
    conform, accept = np.abs(items) <= 1.0, np.abs(measured) <= 0.8
    for share, told in [
        (np.mean(accept & ~conform), found.consumer),
        (np.mean(~accept & conform), found.producer),
        (np.mean(accept), found.accepted),
    ]:
        assert told == pytest.approx(share, abs=4.0 * sqrt(share / n))
    assert global_risks(normal_prior(0.3, 0.7), 0.4, tolerance, None).producer == pytest.approx(
        found.conforming, rel=1e-9
    )


def test_guard_bands_of_ilac_g8():
    """Table 1 of ILAC-G8:09/2019, with k = 2: guard band in U, and the specific risk at the acceptance limit."""
    for r, risk in [(3.0, 1e-6), (1.5, 0.0016), (1.0, 0.025), (0.83, 0.05), (0.0, 0.5)]:
        found = decide(1.0 - 2.0 * r, 1.0, Tolerance(upper=1.0), GuardBand(r), expanded_uncertainty=2.0)
        assert found.word == "pass"
        assert found.specific_risk <= risk < 2.0 * found.specific_risk + 1e-5
    rejected = decide(3.0 + 1e-9, 1.0, Tolerance(upper=1.0), GuardBand(-1.0, binary=True), expanded_uncertainty=2.0)
    assert rejected.word == "fail"
    assert rejected.specific_risk <= 0.025
    assert round(guard_factor(0.05), 2) == 0.82
    assert guard_factor(0.025, 2.0, df=5.0) == pytest.approx(2.570581835636314 / 2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        (SimpleAcceptance(), ["fail", "fail", "pass", "pass", "pass", "fail"]),
        (SharedRisk(0.25), ["fail", "fail", "pass", "pass", "pass", "fail"]),
        (SharedRisk(0.1), ["noFail", "noFail", "noPass", "noPass", "noPass", "noFail"]),
        (GuardBand(), ["fail", "conditionalFail", "conditionalPass", "pass", "conditionalPass", "conditionalFail"]),
        (GuardBand(1.0, binary=True), ["fail", "fail", "fail", "pass", "fail", "fail"]),
        (GuardBand(-1.0, binary=True), ["fail", "pass", "pass", "pass", "pass", "pass"]),
        (ProbabilityLimit(0.95), ["fail", "noFail", "noPass", "pass", "noPass", "noFail"]),
    ],
)
def test_words_along_the_number_line(rule, words):
    values = [-1.3, -1.1, -0.9, 0.0, 0.9, 1.1]
    found = [decide(y, 0.1, UNIT, rule, expanded_uncertainty=0.2) for y in values]
    assert [one.word for one in found] == words


def test_a_guard_band_wider_than_the_tolerance_lets_nothing_pass():
    found = decide(0.0, 0.6, UNIT, GuardBand(), expanded_uncertainty=1.2)
    assert (found.word, found.acceptance) == ("conditionalPass", None)


@given(
    st.floats(-5, 5),
    st.floats(0.01, 3),
    st.floats(-3, 3),
    st.floats(0.05, 3),
    st.one_of(st.just(inf), st.floats(2, 100)),
)
def test_probabilities_of_the_three_parts_of_the_line_add_up(value, u, middle, half, df):
    inside = conformity_probability(value, u, Tolerance.around(middle, half), df=df)
    below = conformity_probability(value, u, Tolerance(upper=middle - half), df=df)
    above = conformity_probability(value, u, Tolerance(lower=middle + half), df=df)
    assert inside + below + above == pytest.approx(1.0, abs=1e-9)
    assert min(inside, below, above) >= 0.0


@settings(max_examples=40)
@given(st.floats(-3, 3), st.floats(0.05, 2), st.floats(-2, 2), st.floats(0.05, 2))
def test_a_normal_prior_and_a_normal_measurement_have_a_normal_posterior(value, u, mean, sd):
    """JCGM 106, 7.2.3 and annex B: precisions add."""
    assume((value - mean) ** 2 < 30.0**2 * (u**2 + sd**2))
    variance = 1.0 / (1.0 / u**2 + 1.0 / sd**2)
    centre = variance * (value / u**2 + mean / sd**2)
    closed = conformity_probability(centre, sqrt(variance), UNIT)
    assert conformity_probability(value, u, UNIT, prior=normal_prior(mean, sd)) == pytest.approx(closed, abs=1e-9)


def test_a_flat_prior_changes_nothing():
    wide = normal_prior(0.0, 1e3)
    for df in (4.0, inf):
        alone = conformity_probability(0.8, 0.2, UNIT, df=df)
        assert conformity_probability(0.8, 0.2, UNIT, df=df, prior=wide) == pytest.approx(alone, abs=1e-4)


def test_small_risks_keep_their_digits():
    assert conformity_probability(30.0, 1.0, UNIT) == pytest.approx(float(special.ndtr(-29.0)), rel=1e-9)
    assert conformity_probability(-30.0, 1.0, UNIT) == pytest.approx(float(special.ndtr(-29.0)), rel=1e-9)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: Tolerance(1.0, 1.0), "lower limit must be below"),
        (Tolerance, "one of lower and upper is needed"),
        (lambda: Tolerance(float("nan"), 1.0), "lower limit must be below"),
        (lambda: conformity_probability(0.0, 0.0, UNIT), "a decision needs one that is more than 0"),
        (lambda: conformity_probability(1e6, 0.1, UNIT, prior=gamma_prior(4.0, 0.25)), "contradict each other"),
        (lambda: decide(0.0, 0.1, UNIT, GuardBand(-1.0), expanded_uncertainty=0.2), "conditional statements"),
        (lambda: decide(0.0, 0.1, UNIT, ProbabilityLimit(0.4), expanded_uncertainty=0.2), "more than 0.5"),
        (lambda: decide(0.0, 0.1, Tolerance(upper=1.0), SharedRisk(), expanded_uncertainty=0.2), "say with `of`"),
        (lambda: decide(0.0, 0.1, UNIT, SimpleAcceptance(), expanded_uncertainty=0.0), "expanded uncertainty of 0"),
        (lambda: guard_band_for(0.9, normal_prior(0, 1), 0.1, UNIT), "no guard band"),
        (lambda: guard_factor(0.0), "between 0 and 1"),
        (lambda: normal_prior(0.0, 0.0), "more than 0"),
    ],
)
def test_what_is_refused(act, words):
    with pytest.raises(FitError, match=words):
        act()
