"""Least squares against certified values.

Data and certified values: NIST Statistical Reference Datasets, linear least squares (US Government work, public
domain). Longley and Filip are rated of higher difficulty; Filip has a condition number of about 1e15 as it stands.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fitter.linear import RankError, Triangle, least_squares, orthonormal
from fitter.quantiles import f_limit, f_tail, t_limit, t_tail

# fmt: off
NORRIS = np.array([  # y, x
    (0.1, 0.2), (338.8, 337.4), (118.1, 118.2), (888.0, 884.6), (9.2, 10.1), (228.1, 226.5), (668.5, 666.3),
    (998.5, 996.3), (449.1, 448.6), (778.9, 777.0), (559.2, 558.2), (0.3, 0.4), (0.1, 0.6), (778.1, 775.5),
    (668.8, 666.9), (339.3, 338.0), (448.9, 447.5), (10.8, 11.6), (557.7, 556.0), (228.3, 228.1), (998.0, 995.8),
    (888.8, 887.6), (119.6, 120.2), (0.3, 0.3), (0.6, 0.3), (557.6, 556.8), (339.3, 339.1), (888.0, 887.2),
    (998.5, 999.0), (778.9, 779.0), (10.2, 11.1), (117.6, 118.3), (228.9, 229.2), (668.4, 669.1), (449.2, 448.9),
    (0.2, 0.5),
])
LONGLEY = np.array([  # y, x1 ... x6
    (60323, 83, 234289, 2356, 1590, 107608, 1947), (61122, 88.5, 259426, 2325, 1456, 108632, 1948),
    (60171, 88.2, 258054, 3682, 1616, 109773, 1949), (61187, 89.5, 284599, 3351, 1650, 110929, 1950),
    (63221, 96.2, 328975, 2099, 3099, 112075, 1951), (63639, 98.1, 346999, 1932, 3594, 113270, 1952),
    (64989, 99, 365385, 1870, 3547, 115094, 1953), (63761, 100, 363112, 3578, 3350, 116219, 1954),
    (66019, 101.2, 397469, 2904, 3048, 117388, 1955), (67857, 104.6, 419180, 2822, 2857, 118734, 1956),
    (68169, 108.4, 442769, 2936, 2798, 120445, 1957), (66513, 110.8, 444546, 4681, 2637, 121950, 1958),
    (68655, 112.6, 482704, 3813, 2552, 123366, 1959), (69564, 114.2, 502601, 3931, 2514, 125368, 1960),
    (69331, 115.7, 518173, 4806, 2572, 127852, 1961), (70551, 116.9, 554894, 4007, 2827, 130081, 1962),
])
FILIP = np.array([  # y, x
    (0.8116, -6.860120914), (0.9072, -4.324130045), (0.9052, -4.358625055), (0.9039, -4.358426747),
    (0.8053, -6.955852379), (0.8377, -6.661145254), (0.8667, -6.355462942), (0.8809, -6.118102026),
    (0.7975, -7.115148017), (0.8162, -6.815308569), (0.8515, -6.519993057), (0.8766, -6.204119983),
    (0.8885, -5.853871964), (0.8859, -6.109523091), (0.8959, -5.79832982), (0.8913, -5.482672118),
    (0.8959, -5.171791386), (0.8971, -4.851705903), (0.9021, -4.517126416), (0.909, -4.143573228),
    (0.9139, -3.709075441), (0.9199, -3.499489089), (0.8692, -6.300769497), (0.8872, -5.953504836),
    (0.89, -5.642065153), (0.891, -5.031376979), (0.8977, -4.680685696), (0.9035, -4.329846955),
    (0.9078, -3.928486195), (0.7675, -8.56735134), (0.7705, -8.363211311), (0.7713, -8.107682739),
    (0.7736, -7.823908741), (0.7775, -7.522878745), (0.7841, -7.218819279), (0.7971, -6.920818754),
    (0.8329, -6.628932138), (0.8641, -6.323946875), (0.8804, -5.991399828), (0.7668, -8.781464495),
    (0.7633, -8.663140179), (0.7678, -8.473531488), (0.7697, -8.247337057), (0.77, -7.971428747),
    (0.7749, -7.676129393), (0.7796, -7.352812702), (0.7897, -7.072065318), (0.8131, -6.774174009),
    (0.8498, -6.478861916), (0.8741, -6.159517513), (0.8061, -6.835647144), (0.846, -6.53165267),
    (0.8751, -6.224098421), (0.8856, -5.910094889), (0.8919, -5.598599459), (0.8934, -5.290645224),
    (0.894, -4.974284616), (0.8957, -4.64454848), (0.9047, -4.290560426), (0.9129, -3.885055584),
    (0.9209, -3.408378962), (0.9219, -3.13200249), (0.7739, -8.726767166), (0.7681, -8.66695597),
    (0.7665, -8.511026475), (0.7703, -8.165388579), (0.7702, -7.886056648), (0.7761, -7.588043762),
    (0.7809, -7.283412422), (0.7961, -6.995678626), (0.8253, -6.691862621), (0.8602, -6.392544977),
    (0.8809, -6.067374056), (0.8301, -6.684029655), (0.8664, -6.378719832), (0.8834, -6.065855188),
    (0.8898, -5.752272167), (0.8964, -5.132414673), (0.8963, -4.811352704), (0.9074, -4.098269308),
    (0.9119, -3.66174277), (0.9228, -3.2644011),
])
# fmt: on


def powers(x, degree):
    return np.vander(x, degree + 1, increasing=True)


WAMPLER_X = np.arange(21.0)

CERTIFIED = {
    "norris": (
        powers(NORRIS[:, 1], 1),
        NORRIS[:, 0],
        [-0.262323073774029, 1.00211681802045],
        [0.232818234301152, 0.429796848199937e-03],
        0.884796396144373,
        1e-12,
    ),
    "longley": (
        np.column_stack([np.ones(16), LONGLEY[:, 1:]]),
        LONGLEY[:, 0],
        [-3482258.63459582, 15.0618722713733, -0.0358191792925910, -2.02022980381683, -1.03322686717359,
         -0.0511041056535807, 1829.15146461355],
        [890420.383607373, 84.9149257747669, 0.0334910077722432, 0.488399681651699, 0.214274163161675,
         0.226073200069370, 455.478499142212],
        304.854073561965,
        1e-9,
    ),
    "filip": (
        powers(FILIP[:, 1], 10),
        FILIP[:, 0],
        [-1467.48961422980, -2772.17959193342, -2316.37108160893, -1127.97394098372, -354.478233703349,
         -75.1242017393757, -10.8753180355343, -1.06221498588947, -0.0670191154593408, -0.00246781078275479,
         -0.402962525080404e-04],
        [298.084530995537, 559.779865474950, 466.477572127796, 227.204274477751, 71.6478660875927, 15.2897178747400,
         2.23691159816033, 0.221624321934227, 0.0142363763154724, 0.535617408889821e-03, 0.896632837373868e-05],
        0.334801051324544e-02,
        2e-6,
    ),
    "wampler1": (powers(WAMPLER_X, 5), powers(WAMPLER_X, 5).sum(axis=1), [1.0] * 6, [0.0] * 6, 0.0, 1e-8),
}  # fmt: skip


@pytest.mark.parametrize("name", CERTIFIED)
def test_certified_values(name):
    columns, y, coefficients, stderr, sigma, tolerance = CERTIFIED[name]
    fit = least_squares(columns, y, [f"B{i}" for i in range(columns.shape[1])])
    np.testing.assert_allclose(fit.coefficients, coefficients, rtol=tolerance)
    np.testing.assert_allclose(fit.stderr, stderr, rtol=tolerance, atol=1e-6 if sigma == 0 else 0)
    assert fit.sigma == pytest.approx(sigma, rel=tolerance, abs=1e-6)
    assert fit.df == len(y) - columns.shape[1]


def test_rows_may_come_in_blocks():
    columns, y, coefficients, *_ = CERTIFIED["longley"]
    triangle = Triangle(tuple(f"B{i}" for i in range(7)))
    for start in range(0, 16, 3):
        triangle = triangle.add(columns[start : start + 3], y[start : start + 3])
    fit = triangle.solve()
    np.testing.assert_allclose(fit.coefficients, coefficients, rtol=1e-9)
    assert fit.n == 16
    assert fit.sigma == pytest.approx(304.854073561965, rel=1e-10)


def test_columns_that_cannot_be_told_apart_are_named():
    x = np.linspace(0, 1, 20)
    with pytest.raises(RankError, match=r"cannot tell apart: 1, cos\(pitch\)$"):
        least_squares(np.column_stack([np.ones(20), x, np.full(20, 0.5)]), x, ["1", "sin(pitch)", "cos(pitch)"])
    with pytest.raises(RankError, match="2 observations cannot determine 3 coefficients"):
        least_squares(np.ones((2, 3)), np.ones(2), ["a", "b", "c"])


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(8, 60), k=st.integers(1, 6))
def test_against_another_solver(seed, n, k):
    rng = np.random.default_rng(seed)
    columns, y = rng.normal(size=(n, k)) * 10.0 ** rng.integers(-2, 3, k), rng.normal(size=n)
    fit = least_squares(columns, y, [str(i) for i in range(k)])
    expected, rss, *_ = np.linalg.lstsq(columns, y, rcond=None)
    np.testing.assert_allclose(fit.coefficients, expected, rtol=1e-7, atol=1e-12 * np.abs(expected).max())
    assert fit.rss == pytest.approx(rss[0])
    assert fit.variance_function(columns).sum() == pytest.approx(k)


def test_intervals_hold_what_they_promise():
    rng = np.random.default_rng(3)
    columns = powers(np.linspace(-1, 1, 12), 2)
    at, truth = powers(np.array([0.0, 1.5]), 2), np.array([1.0, -2.0, 0.5])
    inside = np.zeros((2, 2))
    for _ in range(2000):
        fit = least_squares(columns, columns @ truth + rng.normal(size=12), "abc")
        inside[0] += np.abs(fit.predict(at) - at @ truth) <= fit.confidence(at)
        inside[1] += np.abs(fit.predict(at) - at @ truth - 2.0 * rng.normal(size=2)) <= fit.prediction(at, sigma_0=2.0)
    np.testing.assert_allclose(inside[0] / 2000, 0.95, atol=0.015)
    # sigma_0 / sigma takes the estimated sigma back out of eq. (73), which costs a little coverage
    np.testing.assert_allclose(inside[1] / 2000, 0.95, atol=0.03)


def test_orthonormal_drops_what_is_only_rounding():
    x = np.linspace(0, 1, 30)
    columns = np.column_stack([np.ones(30), x, 2 * x - 1, 1e-15 * np.sin(9 * x)])
    basis = orthonormal(columns, length=np.array([5.0, 5.0, 5.0, 5.0]))
    assert basis.shape == (30, 2)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-14)


@pytest.mark.parametrize(
    ("df", "limits"),
    # Table 2's (F)_95 of K points, L parameters, n replications, where the scan and the definitions agree
    [
        ((73 - 3, 73 * 5), 1.33), ((145 - 3, 145 * 5), 1.23), ((4 - 3, 4 * 5), 4.35), ((325 - 4, 325 * 5), 1.15),
        ((53 - 4, 53 * 5), 1.40), ((325 - 4, 325 * 3), 1.16), ((247 - 4, 247 * 5), 1.17), ((481 - 4, 481 * 5), 1.12),
        ((6 - 4, 6 * 5), 3.32), ((73 - 4, 73 * 5), 1.33), ((5, 6 * 243), 2.22), ((3, 4 * 321), 2.61),
        ((5, 6 * 2), 3.11),
    ],
)  # fmt: skip
def test_limits_of_table_2(df, limits):
    assert round(f_limit(0.95, *df), 2) == pytest.approx(limits, abs=0.0101)
    assert f_tail(f_limit(0.95, *df), *df) == pytest.approx(0.05)


def test_student_limits():
    # Student's table: two-tailed 95 % for 4, 10 and very many degrees of freedom
    assert [round(t_limit(0.95, df), 3) for df in (4, 10, 1e9)] == [2.776, 2.228, 1.960]
    assert t_tail(2.776, 4) == pytest.approx(0.05, abs=1e-4)
