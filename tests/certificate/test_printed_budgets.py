"""Budgets that others printed: GUM, EA-4/02, Eurachem/CITAC.

Inputs and results are numbers of these documents. Where a printed result comes from rounded intermediate values, the
test says so, and docs/explanation/uncertainty.md too. Numbers of EA-4/02 are from memory where the comment says so:
the text was not at hand.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, log, sin, sqrt

import numpy as np
import pytest

from rig.fitter.budget import Correlation, Influence, TypeA, budgets, covariance
from rig.fitter.budget.coverage import coverage_factor
from rig.fitter.linear import least_squares
from rig.fitter.rounding import rounded, rounded_df, rounded_uncertainty

Model = Callable[[np.ndarray], list[float]]


def influences_of(
    model: Model, values: list[float], us: list[float], dfs: list[float] | None = None
) -> list[Influence]:
    """One influence for each input of a model, with sensitivities by central differences."""
    found = []
    for i, u in enumerate(us):
        step = np.zeros(len(values))
        step[i] = 1e-3 * u
        change = (np.array(model(np.array(values) + step)) - np.array(model(np.array(values) - step))) / 2e-3
        found.append(Influence(str(i), "printed", "B", change, inf if dfs is None else dfs[i]))
    return found


def linear(*us: float) -> list[Influence]:
    return [Influence(str(i), "printed", "B", np.array([u])) for i, u in enumerate(us)]


def rectangular(half: float) -> float:
    return half / sqrt(3.0)


def test_end_gauge_of_gum_h1():
    """H.1: u = 32 nm with effective degrees of freedom 16 (16.7), lines of 25, 9.7, 2.9 and 16.6 nm; U99 = 93 nm.

    93 is 2.92 times the rounded 32; from the unrounded 31.7 it would be 92. H.1.7's 34 nm is of second order: it is for
    a simulation (test_monte_carlo).
    """

    def length(x):
        standard, difference, random, systematic, d_alpha, alpha, theta, cyclic, d_theta = x
        total = theta + cyclic
        return [standard + difference + random + systematic - standard * (d_alpha * total + alpha * d_theta)]

    values = [50_000_623.0, 215.0, 0.0, 0.0, 0.0, 11.5e-6, -0.1, 0.0, 0.0]
    us = [25.0, 5.8, 3.9, 6.7, rectangular(1e-6), rectangular(2e-6), 0.2, 0.35, rectangular(0.05)]
    dfs = [18.0, 24.0, 5.0, 8.0, 50.0, inf, inf, inf, 2.0]
    (found,) = budgets(
        ["l"], ["nm"], np.array(length(np.array(values))), (), influences_of(length, values, us, dfs), probability=0.99
    )
    assert round(found.value) == 50_000_838
    assert round(found.standard_uncertainty) == 32
    assert found.df == pytest.approx(16.7, abs=0.1)
    assert rounded_df(found.df) == "16"
    lines = {one.name: one.standard_uncertainty for one in found.contributions}
    assert [round(lines[name], 1) for name in "048"] == [25.0, 2.9, 16.6]
    assert round(sqrt(lines["1"] ** 2 + lines["2"] ** 2 + lines["3"] ** 2), 1) == 9.7
    assert lines["5"] == lines["6"] == lines["7"] == 0.0
    assert round(2.92 * 32) == 93
    assert round(2.92 * found.standard_uncertainty) == 92


VOLTAGE = np.array([5.007, 4.994, 5.005, 4.990, 4.999])
CURRENT = np.array([19.663, 19.639, 19.640, 19.685, 19.678]) * 1e-3
PHASE = np.array([1.0456, 1.0438, 1.0468, 1.0428, 1.0433])


def impedance(x):
    v, i, phi = x
    return [v * cos(phi) / i, v * sin(phi) / i, v / i]


@pytest.mark.parametrize(
    ("correlated", "us", "correlations"),
    [
        (True, ["0.071", "0.296", "0.236"], [-0.588, -0.485, 0.993]),  # table H.3
        (False, ["0.195", "0.201", "0.204"], [0.056, 0.527, 0.878]),  # table H.5
    ],
)
def test_resistance_and_reactance_of_gum_h2(correlated, us, correlations):
    """From the means of the five observations, not rounded. For X, 0.295 is printed; it is 0.29558.

    0.295 is what the five single evaluations give (next test). From the rounded numbers of table H.2, u(R) is 0.070.
    """
    data = np.array([VOLTAGE, CURRENT, PHASE])
    r = np.corrcoef(data)
    assert np.round([r[0, 1], r[0, 2], r[1, 2]], 2).tolist() == [-0.36, 0.86, -0.65]
    inputs = influences_of(impedance, data.mean(1).tolist(), (data.std(1, ddof=1) / sqrt(5.0)).tolist(), [4.0] * 3)
    given = [Correlation("0", "1", r[0, 1]), Correlation("0", "2", r[0, 2]), Correlation("1", "2", r[1, 2])]
    given = given if correlated else []
    values = np.array(impedance(data.mean(1)))
    found = budgets(["R", "X", "Z"], ["ohm"] * 3, values, (), inputs, correlations=given)
    assert [f"{one.value:.3f}" for one in found] == ["127.732", "219.847", "254.260"]
    assert [f"{one.standard_uncertainty:.3f}" for one in found] == us
    assert not correlated or [one.df for one in found] == pytest.approx([4.0] * 3)
    total = covariance((), inputs, given, count=3)
    sd = np.sqrt(np.diag(total))
    assert np.round((total / np.outer(sd, sd))[[0, 0, 1], [1, 2, 2]], 3).tolist() == correlations


def test_five_single_evaluations_of_gum_h2():
    """H.2.4, table H.4: u is 0.071, 0.295 and 0.236, with correlations -0.588, -0.485 and 0.993."""
    five = np.array([impedance(one) for one in zip(VOLTAGE, CURRENT, PHASE, strict=True)])
    fit = TypeA(np.cov(five.T) / 5.0, 4.0)
    found = budgets(["R", "X", "Z"], ["ohm"] * 3, five.mean(0), fit, [])
    assert [f"{one.value:.3f}" for one in found] == ["127.732", "219.847", "254.260"]
    assert [f"{one.standard_uncertainty:.3f}" for one in found] == ["0.071", "0.295", "0.236"]
    r = np.corrcoef(five.T)
    assert np.round([r[0, 1], r[0, 2], r[1, 2]], 3).tolist() == [-0.588, -0.485, 0.993]


def test_rounded_inputs_of_gum_h2_give_what_gtc_prints():
    """multiple_ureal's docstring in GTC 1.5: ureal(127.732169928102, 0.0699787279883717, 4.0)."""
    inputs = influences_of(impedance, [4.999, 19.661e-3, 1.04446], [3.2e-3, 9.5e-6, 7.5e-4], [4.0] * 3)
    given = [Correlation("0", "1", -0.36), Correlation("0", "2", 0.86), Correlation("1", "2", -0.65)]
    values = np.array(impedance(np.array([4.999, 19.661e-3, 1.04446])))
    found = budgets(["R", "X", "Z"], ["ohm"] * 3, values, (), inputs, correlations=given)[0]
    assert found.value == pytest.approx(127.732169928102, rel=1e-14)
    assert found.standard_uncertainty == pytest.approx(0.0699787279883717, rel=1e-8)
    assert found.df == pytest.approx(4.0, rel=1e-9)


READING = np.array([21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511])
CORRECTION = -np.array([171, 169, 166, 159, 164, 165, 156, 157, 159, 161, 160]) * 1e-3


def thermometer() -> tuple[np.ndarray, TypeA]:
    """Intercept, slope, and correction at 30 degC, with their covariance."""
    columns = np.stack([np.ones(11), READING - 20.0], axis=1)
    fit = least_squares(columns, CORRECTION, ["y1", "y2"])
    use = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 10.0]])
    return use @ fit.coefficients, TypeA(use @ fit.covariance @ use.T, float(fit.df))


def test_calibration_of_a_thermometer_of_gum_h3():
    """H.3: -0.1712(29), 0.00218(67), r = -0.930; correction at 30 degC: -0.1494(41), 9 degrees of freedom."""
    values, fit = thermometer()
    found = budgets(["y1", "y2", "b(30)"], ["degC", "1", "degC"], values, fit, [])
    assert [f"{one.value:.5f}" for one in found] == ["-0.17120", "0.00218", "-0.14938"]
    assert [str(rounded_uncertainty(one.standard_uncertainty)) for one in found] == ["0.0029", "0.00067", "0.0041"]
    assert [one.df for one in found] == [9.0] * 3
    c = covariance(fit, [], count=3)
    assert round(c[0, 1] / sqrt(c[0, 0] * c[1, 1]), 3) == -0.930


def test_a_common_error_of_the_reference_thermometer_is_gtc_s():
    """H.3.6 with 0.005 degC: GTC's documentation merges it to u 0.00576893138292676 with 145.37964721007157 df."""
    values, fit = thermometer()
    common = Influence("reference", "certificate", "B", np.array([0.005, 0.0, 0.005]))
    intercept, slope, _ = budgets(["y1", "y2", "b(30)"], ["degC", "1", "degC"], values, fit, [common])
    assert intercept.value == pytest.approx(-0.17120379013135004, rel=1e-12)
    assert intercept.standard_uncertainty == pytest.approx(0.00576893138292676, rel=1e-11)
    assert intercept.df == pytest.approx(145.37964721007157, rel=1e-10)
    assert (slope.standard_uncertainty, slope.df) == (pytest.approx(0.0006679387732278323, rel=1e-10), 9.0)


def test_activity_of_radon_of_gum_h4():
    """H.4: 0.4300(83) Bq/g from the correlated means (H.4.3.1), 0.4304(84) from the ratios (H.4.3.2).

    0.4300 comes from the ratio of the means, rounded to 3.167; not rounded, the value is 0.42995.
    """
    t_s = np.array([243.74, 984.53, 1723.87, 2463.17, 3217.56, 3956.83])
    c_s = np.array([15380, 14978, 14394, 13254, 12516, 11058])
    c_b = np.array([4054, 3922, 4200, 3830, 3956, 3980])
    t_x = np.array([367.37, 1107.66, 1846.99, 2586.28, 3340.68, 4079.94])
    c_x = np.array([41432, 38706, 35860, 32238, 29640, 26356])
    decay = log(2.0) / 5505.8
    sample = (c_x - c_b) / 60.0 * np.exp(decay * t_x)
    standard = (c_s - c_b) / 60.0 * np.exp(decay * t_s)
    sds = [sample.std(ddof=1) / sqrt(6.0), standard.std(ddof=1) / sqrt(6.0)]
    means = [sample.mean(), standard.mean()]
    assert [f"{one:.2f}" for one in (*means, *sds)] == ["652.60", "206.09", "6.42", "3.79"]  # table H.8
    r = float(np.corrcoef(sample, standard)[0, 1])
    assert round(r, 3) == 0.646

    def activity(x):
        a_s, m_s, m_x, r_x, r_s = x
        return [a_s * m_s / m_x * r_x / r_s]

    values, us = [0.1368, 5.0192, 5.0571, *means], [0.0018, 0.005, 0.0010, *sds]
    inputs = influences_of(activity, values, us, [inf, inf, inf, 5.0, 5.0])
    (found,) = budgets(["A"], ["Bq/g"], np.array(activity(values)), (), inputs, correlations=[Correlation("3", "4", r)])
    assert (f"{found.value:.5f}", f"{found.standard_uncertainty:.4f}") == ("0.42995", "0.0083")
    assert (f"{means[0] / means[1]:.3f}", f"{activity([*values[:3], 3.167, 1.0])[0]:.4f}") == ("3.167", "0.4300")
    ratio = sample / standard

    def by_ratio(x):
        return [x[0] * x[1] / x[2] * x[3]]

    values = [0.1368, 5.0192, 5.0571, float(ratio.mean())]
    us = [0.0018, 0.005, 0.0010, float(ratio.std(ddof=1) / sqrt(6.0))]
    (found,) = budgets(["A"], ["Bq/g"], np.array(by_ratio(values)), (), influences_of(by_ratio, values, us))
    assert (f"{found.value:.4f}", f"{found.standard_uncertainty:.4f}") == ("0.4304", "0.0084")


def test_ten_kilogram_weight_of_ea_4_02_s2():
    """S2, as GUM Workbench's example S02 has it: u = 0.0291465131827805 g; 59.6, 8.8, 23.7, 3.9 and 3.9 %."""
    inputs = linear(45e-3 / 2.0, rectangular(15e-3), 25e-3 / sqrt(3.0), rectangular(10e-3), rectangular(10e-3))
    (found,) = budgets(["m"], ["g"], np.array([10_000.025]), (), inputs)
    assert f"{found.standard_uncertainty * 1e3:.1f}" == "29.3"  # and U = 59 mg, as EA-4/02 prints them
    assert rounded(found.value, 2.0 * found.standard_uncertainty).text == "10000.025 ± 0.059"
    inputs[2] = Influence("2", "pooled sd as GUM Workbench prints it", "A", np.array([0.0142]))
    (found,) = budgets(["m"], ["g"], np.array([10_000.025]), (), inputs)
    assert found.standard_uncertainty == pytest.approx(0.0291465131827805, abs=2e-5)
    assert sorted((round(100.0 * one.share, 1) for one in found.contributions), reverse=True) == [
        59.6,
        23.7,
        8.8,
        3.9,
        3.9,
    ]
    assert rounded(found.value, 2.0 * found.standard_uncertainty).text == "10000.025 ± 0.058"


def test_standard_resistor_of_ea_4_02_s3():
    """S3: 10 000.178 ohm, u = 8.33 mohm, U = 17 mohm; u = 0.00832800405259282 by GUM Workbench's example S03."""

    def resistance(x):
        standard, drift, bath_s, ratio_c, ratio, bath_x = x
        return [(standard + drift + bath_s) * ratio_c * ratio - bath_x]

    values = [10_000.053, 0.020, 0.0, 1.0, 1.0000105, 0.0]
    us = [2.5e-3, rectangular(10e-3), rectangular(2.75e-3), 1e-6 / sqrt(6.0), 0.158e-6 / sqrt(5.0), rectangular(5.5e-3)]
    value = np.array(resistance(values))
    (found,) = budgets(["R"], ["ohm"], value, (), influences_of(resistance, values, us))
    assert f"{found.standard_uncertainty * 1e3:.2f}" == "8.33"
    assert found.standard_uncertainty == pytest.approx(0.00832800405259282, rel=2e-5)
    assert rounded(found.value, 2.0 * found.standard_uncertainty).text == "10000.178 ± 0.017"
    lines = {one.name: round(one.standard_uncertainty * 1e3, 1) for one in found.contributions}
    assert [lines[name] for name in "012345"] == [2.5, 5.8, 1.6, 4.1, 0.7, 3.2]


def test_gauge_block_of_ea_4_02_s4():
    """S4, from memory: lines of 15.0, 17.3, 5.37, 18.5, 16.6, 11.8 and 3.87 nm, u = 36.4 nm, U = 73 nm."""
    product = 50e6 * (2e-6 / sqrt(6.0)) * rectangular(0.5)  # of two quantities that are zero
    lines = [
        15.0,
        rectangular(30.0),
        12.0 / sqrt(5.0),
        rectangular(32.0),
        575.0 * rectangular(0.05),
        product,
        rectangular(6.7),
    ]
    assert [f"{one:.3g}" for one in lines] == ["15", "17.3", "5.37", "18.5", "16.6", "11.8", "3.87"]
    (found,) = budgets(["l"], ["nm"], np.array([49_999_080.0]), (), linear(*lines))
    assert f"{found.standard_uncertainty:.1f}" == "36.4"
    assert round(2.0 * found.standard_uncertainty) == 73


def test_water_meter_of_ea_4_02_s12():
    """S12, in percent: 0.060 with 2 degrees of freedom, and 0.068; u = 0.091, k = 2.28 for 95.45 %, U = 0.2.

    As the tests of another program print them (test_shapes). k is of 10 degrees of freedom, cut from 10.4.
    """
    inputs = [Influence("a", "printed", "A", np.array([0.060]), 2.0), Influence("b", "printed", "B", np.array([0.068]))]
    (found,) = budgets(["e"], ["%"], np.zeros(1), (), inputs, probability=0.9545)
    assert f"{found.standard_uncertainty:.3f}" == "0.091"
    assert rounded_df(found.df) == "10"
    assert f"{float(coverage_factor(0.9545, 10.0)):.2f}" == "2.28"
    assert float(f"{found.expanded_uncertainty:.1g}") == 0.2


def test_furnace_of_ea_4_02_s5():
    """S5, the furnace: u = 0.641 degC; 0.640870516811861 by GUM Workbench's example S05_1."""
    c, c_0 = 0.077, 0.189
    inputs = linear(
        0.10, 0.15, c * 1.0, c * rectangular(0.5), c * rectangular(2.0), c / c_0 * rectangular(0.1),
        rectangular(0.3), rectangular(1.0),
    )  # fmt: skip
    (found,) = budgets(["t"], ["degC"], np.array([1000.5]), (), inputs)
    assert f"{found.standard_uncertainty:.3f}" == "0.641"
    assert found.standard_uncertainty == pytest.approx(0.640870516811861, rel=1e-4)


def test_power_sensor_of_ea_4_02_s6():
    """S6: 0.933024133333333, u = 0.0161763656260788, 286 degrees of freedom by GUM Workbench's example S06."""
    ratio = np.array([0.9772, 0.9671, 0.9836])
    mismatch = [2.0 * g * s / sqrt(2.0) for g, s in ((0.02, 0.02), (0.07, 0.12), (0.07, 0.10), (0.02, 0.02))]
    meter = [sqrt(2.0) * 0.0001, sqrt(2.0) * 0.001]

    def factor(x):
        K, drift, M_Sr, M_Xc, M_Sc, M_Xr, p_Cr, p_Cc, p = x
        return [(K + drift) * M_Sr * M_Xc / (M_Sc * M_Xr) * p_Cr * p_Cc * p]

    values = [0.957, -0.001, *(1.0,) * 6, float(ratio.mean())]
    us = [0.0055, rectangular(0.002), *mismatch, *meter, float(ratio.std(ddof=1)) / sqrt(3.0)]
    inputs = influences_of(factor, values, us, [50.0, *(inf,) * 7, 2.0])
    (found,) = budgets(["K"], ["1"], np.array(factor(values)), (), inputs)
    assert found.value == pytest.approx(0.933024133333333, rel=1e-14)
    assert found.standard_uncertainty == pytest.approx(0.0161763656260788, rel=1e-4)
    assert int(found.df) == 286
    assert rounded(found.value, 2.0 * found.standard_uncertainty).text == "0.933 ± 0.032"


def test_attenuator_of_ea_4_02_s7():
    """S7: 30.04325 dB, u = 0.0224185377162145 dB, 108 degrees of freedom by GUM Workbench's example S07."""
    read = np.array([30.033, 30.058, 30.018, 30.052])
    scatter = Influence("read", "S7", "A", np.array([float(read.std(ddof=1)) / 2.0]), 3.0)
    limits = [rectangular(half) for half in (0.002, 0.003, 0.0005, 0.0005)]
    inputs = [scatter, *linear(0.0025, 0.0200, 0.0020, 0.0020, *limits)]
    (found,) = budgets(["L"], ["dB"], np.array([float(read.mean()) + 0.003]), (), inputs)
    assert found.value == pytest.approx(30.04325, rel=1e-14)
    assert found.standard_uncertainty == pytest.approx(0.0224185377162145, rel=5e-4)
    assert int(found.df) == 108
    assert rounded(found.value, 2.0 * found.standard_uncertainty).text == "30.043 ± 0.045"


def test_hardness_of_gum_h6():
    """H.6, as a translation (GOST R 54500.3) has it: 64.0 HRC, u = 0.55 HRC of 0.5, 0.20 and 0.11."""
    (found,) = budgets(["h"], ["HRC"], np.array([64.0]), (), linear(0.5, 0.45 / sqrt(5.0), 0.11))
    assert f"{found.standard_uncertainty:.2f}" == "0.55"
    assert f"{0.002 * found.standard_uncertainty:.4f}" == "0.0011", "mm of depth"
    assert f"{found.contributions[1].standard_uncertainty:.2f}" == "0.20"


def test_calibration_standard_of_eurachem_a1():
    """QUAM A1 as GTC's documentation has it: 1002.7 mg/L, u = 0.835199, and five lines."""

    def concentration(x):
        return [1000.0 * x[0] * x[1] / (x[2] + x[3] + x[4])]

    values = [100.28, 0.9999, 100.0, 0.0, 0.0]
    us = [0.05, rectangular(0.0001), 0.1 / sqrt(6.0), 0.02, rectangular(0.084)]
    inputs = influences_of(concentration, values, us)
    (found,) = budgets(["c"], ["mg/L"], np.array(concentration(values)), (), inputs)
    assert f"{found.value:G}" == "1002.7"
    assert f"{found.standard_uncertainty:G}" == "0.835199"
    lines = [f"{one.standard_uncertainty:G}" for one in found.contributions]
    assert lines == ["0.49995", "0.486284", "0.40935", "0.20054", "0.0578967"]


def test_titration_of_eurachem_a3():
    """QUAM A3 as GTC's documentation has it: 0.10139(18) mol/L, and 0.10132(31) with a bias of both end points.

    In the second, repeatability is a third of a variance.
    """

    def concentration(x):
        mass, purity, carbon, hydrogen, oxygen, potassium, v_2, v_1, v_acid, r, excess_1, excess_2 = x
        molar = 8.0 * carbon + 5.0 * hydrogen + 4.0 * oxygen + potassium
        return [r * 1000.0 * mass * purity * (v_2 - excess_2) / (molar * (v_1 - excess_1) * v_acid)]

    def volume(tolerance: float, size: float) -> float:
        return sqrt(tolerance**2 / 6.0 + (size * 2.1e-4 * 4.0) ** 2 / 3.0)

    values = [0.3888, 1.0, 12.0107, 1.00794, 15.9994, 39.0983, 14.89, 18.64, 15.0, 1.0, 0.0, 0.0]
    mass = sqrt(2.0) * rectangular(0.15e-3)
    elements = [rectangular(half) for half in (0.0008, 0.00007, 0.0003, 0.0001)]
    volumes = [volume(0.03, 15.0), volume(0.03, 19.0), volume(0.02, 15.0)]
    us = [mass, rectangular(0.0005), *elements, *volumes, 0.001, 1e-12, 1e-12]
    (found,) = budgets(["c"], ["mol/L"], np.array(concentration(values)), (), influences_of(concentration, values, us))
    assert (f"{found.value:.5f}", f"{found.standard_uncertainty:.7f}") == ("0.10139", "0.0001843")
    lines = {one.name: f"{one.standard_uncertainty:G}" for one in found.contributions}
    assert [lines[name] for name in ("9", "6", "7", "8", "0", "1")] == [
        "0.000101387",
        "9.69953E-05",
        "8.33653E-05",
        "7.39151E-05",
        "3.19376E-05",
        "2.9268E-05",
    ]
    values[-2:], us[-2:] = [0.05, 0.05], [0.03, 0.03]
    us[9] = 0.001 / sqrt(3.0)
    (found,) = budgets(["c"], ["mol/L"], np.array(concentration(values)), (), influences_of(concentration, values, us))
    assert (f"{found.value:.5f}", f"{found.standard_uncertainty:.7f}") == ("0.10132", "0.0003096")
