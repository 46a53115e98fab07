"""Variance functions, theorems and figures of merit of NASA/TP-1999-209835, sections 3.3, 3.4, 4 and 5.3."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, special

from proving.paper.closed_forms import T4_VARIANCE, T6_VARIANCE, d1_no_roll_variance, d1_variance
from proving.truth.attitude import GRAVITY, Sensor, turn_pitch, turn_roll
from rig.fitter import RankError
from rig.procedures.attitude.merit import (
    DesignPoints,
    Usage,
    compare,
    curve,
    figure_of_merit,
    mean_variance,
    pad_visibility,
    variance,
    visibility,
    worst_variance,
)

SEED = 20260419
ROLL_64 = np.arange(64) * 360 / 64 - 180


def grid(pitch, roll, **kw):
    pitch, roll = np.meshgrid(np.asarray(pitch, float), np.asarray(roll, float), indexing="ij")
    return DesignPoints("grid", pitch.ravel(), roll.ravel(), **kw)


def line(pitch, **kw):
    return DesignPoints("line", np.asarray(pitch, float), np.zeros(len(pitch)), roll=False, **kw)


def scattered(seed, count, *, roll=True):
    pitch, r = np.random.default_rng(seed).uniform(-180, 180, (2, count))
    return DesignPoints("scattered", pitch, r, roll=roll)


T6 = DesignPoints("T6", np.array([-90.0, 0, 90, 180, 0, 0]), np.array([0.0, 0, 0, 0, -90, 90]))
T4 = line([-90.0, 0, 90, 180])

# --- Table 1 -----------------------------------------------------------------------------------------------------

FINE = np.arange(-10, 11)
FIG_3_TOP = [*FINE, *(s * a for s in (-1, 1) for a in (12, 14, 18, 22, 26, 30))]
FIG_3_BOTTOM = [*np.arange(-16, 17, 4), *(s * a for s in (-1, 1) for a in (18, *range(20, 31)))]
"""1 deg and 4 deg steps as section 5.3.2 has them. These are 31 angles; the print has N = 33, and a pair half-way
across the change of step makes them 33 and gives the printed digits."""


def uniform(to):
    return np.linspace(-to, to, 33)


@pytest.mark.parametrize(
    ("figure", "pitch", "used", "printed"),
    [
        ("2(a)", uniform(30), 30, 1.989),
        ("2(b)", uniform(45), 45, 1.993),
        ("2(b)", uniform(45), 30, 1.927),
        ("2(c)", uniform(90), 90, 2.008),
        ("2(c)", uniform(90), 30, 2.222),
        ("2(d)", uniform(180), 180, 1.993),
        ("2(d)", uniform(180), 30, 2.174),
        ("3 top", FIG_3_TOP, 30, 2.127),
        ("3 top", FIG_3_TOP, 10, 1.811),
        ("3 bottom", FIG_3_BOTTOM, 30, 1.937),
        ("3 bottom", FIG_3_BOTTOM, 10, 1.834),
        ("4", [*[-30] * 16, 0, *[30] * 16], 30, 1.941),
        ("4", [*[-30] * 16, 0, *[30] * 16], 10, 1.912),
    ],
)
def test_table_1(figure, pitch, used, printed):
    assert len(pitch) == 33
    assert round(figure_of_merit(grid(pitch, ROLL_64), Usage.within(used)), 3) == printed, figure


def test_table_1_with_the_roll_repeated_at_180():
    """Figure 5: 65 rolls; Theorem IV fails by little, and the mean over roll stays what it was."""
    design = grid(uniform(30), np.linspace(-180, 180, 65))
    assert round(figure_of_merit(design, Usage.within(30)), 3) == 1.989
    lines = curve(design, Usage.within(30), 1.0, roll_deg=np.linspace(-180, 180, 13)).normalised
    assert 0.005 < np.ptp(lines, axis=0).max() < 0.05


def test_tumble_designs_are_as_good_everywhere():
    """Eqs. (69), (71) and the sentences after them: 2 and the root of 3 after multiplying by the points."""
    rng = np.random.default_rng(SEED)
    at = rng.uniform(-180, 180, (2, 40))
    np.testing.assert_allclose(variance(T6, *at), T6_VARIANCE)
    np.testing.assert_allclose(variance(T4, *at), T4_VARIANCE)
    assert figure_of_merit(T6, Usage.within(37)) == pytest.approx(2.0)
    assert figure_of_merit(T4, Usage.within(37)) == pytest.approx(np.sqrt(3.0))


# --- closed forms against the general one ------------------------------------------------------------------------


@given(to=st.floats(5, 180), n=st.integers(4, 40), m=st.integers(3, 30), roll=st.floats(-180, 180))
def test_eq_66(to, n, m, roll):
    at = np.linspace(-180, 180, 25)
    design = grid(np.linspace(-to, to, n), np.arange(m) * 360 / m - 180)
    np.testing.assert_allclose(d1_variance(at, to, n, m), variance(design, at, roll), rtol=1e-7)


@given(to=st.floats(5, 180), n=st.integers(4, 80))
def test_eq_67_as_corrected(to, n):
    at = np.linspace(-180, 180, 25)
    np.testing.assert_allclose(d1_no_roll_variance(at, to, n), variance(line(np.linspace(-to, to, n)), at), rtol=1e-6)


def test_eq_67_in_figures():
    assert d1_no_roll_variance(0.0, 30.0, 33) == pytest.approx(0.06876, abs=5e-6)
    # section 5.3.1: N = 65 over the full circle nearly constant, about the tumble's
    full = curve(line(np.linspace(-180, 180, 65)), Usage.within(180), 1.0).normalised
    assert np.ptp(full) < 0.04
    assert full.mean() == pytest.approx(np.sqrt(3), abs=0.01)
    # and 17 % above the centre half of narrower ranges: of +-90 deg; of +-30 and +-45 deg it is 21 %
    for to, above in ((30, 1.21), (45, 1.21), (90, 1.17)):
        assert full.mean() / figure_of_merit(line(np.linspace(-to, to, 65)), Usage.within(to / 2)) == pytest.approx(
            above, abs=0.005
        )


@pytest.mark.parametrize(("to", "curved"), [(30, 1), (45, 1), (90, -1), (180, -1)])
def test_concave_upward_about_zero_where_eq_66_says(to, curved):
    zero, beside = d1_variance([0.0, 5.0], to, 33, 64)
    assert np.sign(beside - zero) == curved


@pytest.mark.parametrize(("to", "n", "m"), [(180, 3, 8), (180, 2, 8), (30, 9, 2), (30, 9, 1)])
def test_what_eq_66_cannot_be_asked(to, n, m):
    with pytest.raises(RankError, match="do not determine"):
        d1_variance(0.0, to, n, m)
    with pytest.raises(RankError):
        variance(grid(np.linspace(-to, to, n), np.arange(m) * 360 / m - 180), 0.0)


@pytest.mark.parametrize(("to", "n"), [(30, 2), (180, 3), (60, 1)])
def test_what_eq_67_cannot_be_asked(to, n):
    with pytest.raises(RankError, match="do not determine"):
        d1_no_roll_variance(0.0, to, n)


# --- the theorems ------------------------------------------------------------------------------------------------


def gradient(axis, S, Omega_deg, A_deg, pitch_deg, roll_deg):
    """(n, 4) df/dc of eq. (19), from rotations: exact derivatives of the sensitive axis by central differences."""
    turned = np.einsum("nij,njk,k->ni", turn_roll(np.radians(roll_deg)), turn_pitch(np.radians(pitch_deg)), GRAVITY)

    def along(Omega, A):
        return Sensor(axis, Omega_deg=Omega, A_deg=A).gravity_along(turned)

    h = 1e-2
    by_Omega = (along(Omega_deg + h, A_deg) - along(Omega_deg - h, A_deg)) / (2 * h)
    by_A = (along(Omega_deg, A_deg + h) - along(Omega_deg, A_deg - h)) / (2 * h)
    return np.column_stack([np.ones_like(pitch_deg), along(Omega_deg, A_deg), S * by_Omega, S * by_A])


@settings(max_examples=60)
@given(
    axis=st.sampled_from("xyz"),
    S=st.floats(0.01, 100),
    Omega=st.floats(0.2, 179),
    A=st.floats(-180, 180),
    seed=st.integers(0, 10**6),
    count=st.integers(8, 60),
)
def test_theorems_1_to_3(axis, S, Omega, A, seed, count):
    """Eq. (52) as printed, with the gradient by the paper's parameters of any sensor, mounted in any way."""
    design = scattered(seed, count)
    at = np.random.default_rng(seed + 1).uniform(-180, 180, (2, 20))
    fisher = gradient(axis, S, Omega, A, design.pitch_deg, design.roll_deg)
    wanted = gradient(axis, S, Omega, A, *at)
    scale = np.linalg.norm(fisher, axis=0)
    q, r = np.linalg.qr(fisher / scale)
    printed = np.sum(np.linalg.solve(r.T, (wanted / scale).T) ** 2, axis=0)
    assert np.abs(q.T @ q - np.eye(4)).max() < 1e-9
    np.testing.assert_allclose(variance(design, *at), printed, rtol=2e-5)


@given(
    pitch=st.lists(st.floats(-180, 180), min_size=4, max_size=12, unique=True),
    m=st.integers(3, 24),
    turned=st.floats(-180, 180),
    at=st.floats(-180, 180),
)
def test_theorem_4(pitch, m, turned, at):
    """Rolls uniform over the circle, wherever they begin: the same variance at every roll, for any pitch angles."""
    design = grid(pitch, np.arange(m) * 360 / m + turned)
    try:
        over_roll = variance(design, at, np.linspace(-180, 180, 17))
    except RankError:
        return
    np.testing.assert_allclose(over_roll, over_roll[0], rtol=1e-6)


@given(seed=st.integers(0, 10**6), n=st.integers(1, 9))
def test_order_and_replication_change_nothing_but_the_count(seed, n):
    """Section 4.1: preserved under reordering and replication."""
    one = scattered(seed, 20)
    shuffled = np.random.default_rng(seed).permutation(np.tile(np.arange(20), n))
    copied = DesignPoints("copied", one.pitch_deg[shuffled], one.roll_deg[shuffled])
    often = DesignPoints("often", one.pitch_deg, one.roll_deg, replications=n)
    usage = Usage((-20, 70), (-30, 90))
    assert copied.observations == often.observations == 20 * n
    for f in (copied, often):
        assert figure_of_merit(f, usage) == pytest.approx(figure_of_merit(one, usage), rel=1e-9)
        np.testing.assert_allclose(variance(f, [3.0, 40.0], 7.0), variance(one, [3.0, 40.0], 7.0) / n)


@given(seed=st.integers(0, 10**6), count=st.integers(6, 40), roll=st.booleans())
def test_the_mean_over_the_points_themselves_is_the_number_of_parameters(seed, count, roll):
    design = scattered(seed, count, roll=roll)
    leverage = variance(design, design.pitch_deg, design.roll_deg)
    assert leverage.sum() == pytest.approx(design.parameters, rel=1e-8)
    assert leverage.max() <= 1 + 1e-9


# --- mean, worst -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("roll", [True, False])
@pytest.mark.parametrize("span", [((-30, 30), (-180, 180)), ((10, 95), (-20, 60)), ((-90, 200), (5, 6))])
def test_the_mean_is_the_integral(roll, span):
    design = scattered(SEED, 15, roll=roll)
    (a0, a1), (r0, r1) = span
    integral, _ = integrate.dblquad(
        lambda r, a: float(variance(design, a, r)), a0, a1, r0, r1, epsabs=1e-4, epsrel=1e-5
    )
    assert mean_variance(design, Usage((a0, a1), (r0, r1))) == pytest.approx(integral / (a1 - a0) / (r1 - r0), rel=1e-5)


def test_the_mean_over_one_attitude_is_the_value_there():
    design = scattered(SEED, 9)
    assert mean_variance(design, Usage((12, 12), (34, 34))) == pytest.approx(float(variance(design, 12, 34)))


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), roll=st.booleans())
def test_nothing_is_worse_than_the_worst(seed, roll):
    rng = np.random.default_rng(seed)
    design = scattered(seed, 10, roll=roll)
    usage = Usage((-40, 65), (-100, 100))
    worst, pitch, r = worst_variance(design, usage)
    assert float(variance(design, pitch, r)) == pytest.approx(worst)
    assert -40 <= pitch <= 65
    tried = variance(design, rng.uniform(-40, 65, 20_000), rng.uniform(-100, 100, 20_000))
    assert tried.max() <= worst * (1 + 1e-6)
    assert mean_variance(design, usage) < worst


# --- by simulation -----------------------------------------------------------------------------------------------


def test_simulated_calibrations_scatter_as_forecast():
    """4,000 calibrations of a sensor turned by rotations: rms error of its calibrated output, mean and worst."""
    rng = np.random.default_rng(SEED)
    design = grid(np.linspace(-30, 30, 5), np.arange(7) * 360 / 7, replications=2)
    at = rng.uniform(-30, 30, 400), rng.uniform(-180, 180, 400)
    sigma = 2e-4
    (row,) = compare([design], Usage.within(30), sigma)

    def rows(p, r):
        a, b = np.radians(p), np.radians(r)
        return np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(b), np.cos(a) * np.cos(b)])

    h = np.tile(rows(design.pitch_deg, design.roll_deg), (2, 1))
    errors = rows(*at) @ np.linalg.lstsq(h, rng.normal(0, sigma, (len(h), 4000)), rcond=None)[0]
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(row.mean_sd_deg, rel=0.02)
    worst = (
        rows(np.array([row.worst_pitch_deg]), np.zeros(1))
        @ np.linalg.lstsq(h, rng.normal(0, sigma, (len(h), 4000)), rcond=None)[0]
    )
    assert worst.std() == pytest.approx(row.worst_sd_deg, rel=0.03)


def simulated_power(design, effect, amplitude, rng, runs=600):
    """Share of runs in which T_bias passes its limit; sums of squares worked out here."""
    n, k, parameters = design.replications, design.points, design.parameters
    a, b = np.radians(design.pitch_deg), np.radians(design.roll_deg)
    h = [np.ones(k), np.sin(a), np.cos(a) * np.sin(b), np.cos(a) * np.cos(b)]
    if not design.roll:
        h = [h[0], h[1], np.cos(a)]
    q = np.linalg.qr(np.column_stack(h))[0]
    y = amplitude * effect[None, None, :] + rng.normal(size=(runs, n, k))
    mean = y.mean(axis=1)
    pure = ((y - mean[:, None, :]) ** 2).sum(axis=(1, 2)) / (k * (n - 1))
    lack = n * ((mean - mean @ q @ q.T) ** 2).sum(axis=1) / (k - parameters)
    return np.mean(lack / pure > special.fdtri(k - parameters, k * (n - 1), 0.95))


@pytest.mark.parametrize(
    ("design", "rms", "visible"),
    [
        (grid(np.linspace(-30, 30, 13), np.linspace(-180, 180, 25), replications=6), 0.414, True),
        (line(np.linspace(-36, 36, 73), replications=6), 0.036, False),  # row 22: T_bias 0.41
        (line(np.linspace(-180, 180, 145), replications=6), 0.705, True),  # row 24: T_bias 11
        (T6, 0.0, False),
        (T4, 0.0, False),
    ],
)
def test_isolation_pads_are_seen_where_the_paper_saw_them(design, rms, visible):
    """Its pads moved the output by about 4e-4 deg, its sensors read to 1.6e-4 deg."""
    seen = pad_visibility(design)
    assert seen.rms == pytest.approx(rms, abs=2e-3)
    assert (seen.smallest * 1.6e-4 < 4e-4) == visible
    if np.isfinite(seen.smallest):
        a = np.radians(design.pitch_deg)
        effect = np.sin(2 * a) * np.cos(np.radians(design.roll_deg))
        power = simulated_power(design, effect, seen.smallest, np.random.default_rng(SEED))
        assert power == pytest.approx(0.9, abs=0.035)


def test_a_column_of_the_model_is_never_seen():
    design = scattered(SEED, 30)
    own = 3.0 * np.sin(np.radians(design.pitch_deg)) - 1.0
    assert visibility(design, own) == visibility(T6, np.zeros(6))
    assert visibility(design, own).smallest == np.inf


# --- side by side ------------------------------------------------------------------------------------------------


def test_designs_side_by_side():
    roll = np.linspace(-180, 180, 25)
    wide, narrow = (grid(np.linspace(-to, to, 13), roll, replications=6) for to in (45, 30))
    upright = line(np.linspace(-30, 30, 61), replications=6)
    flat = grid([0.0], roll)
    rows = compare([wide, narrow, upright, T6, flat], Usage.within(30), 2e-4)
    assert [r.observations for r in rows] == [1950, 1950, 366, 6, 25]
    assert rows[0].mean_sd_deg < rows[1].mean_sd_deg < rows[2].mean_sd_deg < rows[3].mean_sd_deg
    assert rows[0].worst_sd_deg < rows[1].worst_sd_deg
    assert (rows[3].df, rows[3].roll) == (2, True)
    assert rows[3].worst_sd_deg == pytest.approx(2e-4 * np.sqrt(2 / 3))
    assert rows[3].worst_interval95_deg == pytest.approx(4.303 * rows[3].worst_sd_deg, rel=1e-3)
    assert "sin(pitch)" in rows[4].undetermined
    assert np.isnan(rows[4].mean_sd_deg)
    assert [r.extrapolated for r in compare([wide, narrow, T6], Usage.within(40), 2e-4)] == [False, True, False]
    nearly, round_ = grid(np.linspace(-135, 135, 7), roll), grid(np.arange(0, 360, 10), roll)
    assert [r.extrapolated for r in compare([nearly, round_, T6, T4], Usage.within(150), 2e-4)] == [True] + [False] * 3
    for r in rows[:4]:
        assert r.figure_of_merit == pytest.approx(np.sqrt(r.observations) * r.mean_sd_deg / 2e-4)


def test_a_curve_is_the_variance_function():
    c = curve(T4, Usage((-10, 30)), 3e-4, count=5)
    np.testing.assert_allclose(c.pitch_deg, [-10, 0, 10, 20, 30])
    np.testing.assert_allclose(c.sd_deg, 3e-4 * np.sqrt(0.75) * np.ones((1, 5)))
    np.testing.assert_allclose(c.normalised, np.sqrt(3) * np.ones((1, 5)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DesignPoints("d", np.zeros(0), np.zeros(0)), "at least one point"),
        (lambda: DesignPoints("d", np.zeros(3), np.zeros(2)), "roll_deg: expected 3"),
        (lambda: DesignPoints("d", np.array([np.nan]), np.zeros(1)), "pitch_deg: row 0 holds nan"),
        (lambda: DesignPoints("d", np.zeros(3), np.zeros(3), replications=0), "at least once"),
        (lambda: Usage((30, -30)), "usage range of pitch from 30 to -30"),
        (lambda: Usage((-30, 30), (0, 361)), "usage range of roll"),
        (lambda: Usage.within(float("nan")), "usage range of pitch"),
    ],
)
def test_what_is_no_design_or_usage(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# --- the document ------------------------------------------------------------------------------------------------

DOCUMENT = Path(__file__).parents[2] / "docs" / "how_to" / "designs.md"
NOTES = Path(__file__).parents[2] / "proving" / "notes" / "designs.md"
PITCH = {"3 top": FIG_3_TOP, "3 bottom": FIG_3_BOTTOM, "4": [*[-30] * 16, 0, *[30] * 16]}


def test_table_1_of_the_document():
    rows = [line.split("|")[1:-1] for line in NOTES.read_text().splitlines() if re.match(r"\| [2-5]", line)]
    rows = [[cell.strip() for cell in row] for row in rows if len(row) == 5]
    assert len(rows) == 14
    for figure, calibrated, used, printed, computed in rows:
        to = re.search(r"\d+", calibrated)
        pitch = PITCH[figure] if figure in PITCH else uniform(int(to[0]))
        design = grid(pitch, np.linspace(-180, 180, 65) if figure == "5" else ROLL_64)
        found = figure_of_merit(design, Usage.within(int(used.removeprefix("+-"))))
        assert f"{found:.4f}" == computed, figure
        assert f"{found:.3f}" == printed, figure


def test_the_shares_of_the_document():
    said = re.search(
        r"within \+-36 deg of pitch ([\d.]+) .*? \+-90 deg ([\d.]+), .*?\s+circle ([\d.]+)", DOCUMENT.read_text(), re.S
    )
    for to, share in zip((36, 90, 180), said.groups(), strict=True):
        assert f"{pad_visibility(line(np.linspace(-to, to, 73))).rms:.2f}" == share


def test_the_example_of_the_document(capsys):
    code, printed = re.search(r"```python\n(.*?)```\n\nprints\n\n```\n(.*?)```", DOCUMENT.read_text(), re.S).groups()
    exec(compile(code, "designs.md", "exec"), {})
    assert capsys.readouterr().out == printed
