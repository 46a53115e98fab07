"""Calibrations whose rows are not kept: the same answer as with all rows at once, in constant memory."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from fitter import RankError, Triangle
from procedures.attitude.fit import fit_attitude
from procedures.attitude.stream import fit_stream
from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate


def blocks_of(data, sizes):
    start = 0
    for size in sizes:
        rows = slice(start, start + size)
        yield data.pitch_deg[rows], data.roll_deg[rows], {name: v[rows] for name, v in data.outputs.items()}
        start += size


@pytest.mark.parametrize("sizes", [[2886], [1, 2, 0, 3, 2880], [100] * 28 + [86], [1] * 200 + [2686]])
def test_blocks_of_any_size_give_the_fit_of_all_rows_at_once(sizes):
    data, _ = simulate(Bench(), D1(180, 37, 13), seed=1)
    found = fit_stream(blocks_of(data, sizes))
    for sensor in data.sensors:
        whole, streamed = fit_attitude(data, sensor), found[sensor]
        np.testing.assert_allclose(streamed.linear.coefficients, whole.linear.coefficients, rtol=1e-10, atol=1e-13)
        np.testing.assert_allclose(streamed.linear.covariance, whole.linear.covariance, rtol=1e-9, atol=1e-25)
        assert streamed.linear.sigma == pytest.approx(whole.linear.sigma, rel=1e-11)
        assert streamed.linear.n == 2886
        assert streamed.parameters.Omega_deg == pytest.approx(whole.parameters.Omega_deg, rel=1e-10)
        np.testing.assert_allclose(streamed.parameters.stderr, whole.parameters.stderr, rtol=1e-8)


def test_without_roll():
    plan = Plan(np.linspace(-180, 180, 73), np.array([0.0]))
    data, _ = simulate(Bench(sensors=(Sensor("x"),)), plan, seed=2)
    streamed = fit_stream(blocks_of(data, [200, 238]), roll=False)["x_V"]
    whole = fit_attitude(data, "x_V")
    assert streamed.parameters.phi_deg == pytest.approx(whole.parameters.phi_deg, rel=1e-9)
    with pytest.raises(RankError, match=r"cos\(pitch\)\*sin\(roll\)"):
        fit_stream(blocks_of(data, [438]))


def test_axes_may_be_told():
    data, _ = simulate(Bench(sensors=(Sensor("z"),)), D1(90, 19), seed=3)
    renamed = [(p, r, {"down": out["z_V"]}) for p, r, out in blocks_of(data, [len(data)])]
    found = fit_stream(renamed, axes={"down": "z"})["down"]
    assert found.parameters.Omega_deg == pytest.approx(0.6, abs=0.01)


def test_memory_does_not_grow_with_the_rows():
    rng = np.random.default_rng(4)

    def made(count):
        for _ in range(count):
            pitch, roll = rng.uniform(-180, 180, (2, 1000))
            yield pitch, roll, {"x_V": np.sin(np.radians(pitch)) + rng.normal(0, 1e-5, 1000)}

    peaks = []
    for count in (20, 200):
        tracemalloc.start()
        fit_stream(made(count))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]
    assert peaks[1] < 1_000_000


def test_what_no_fit_comes_of():
    good = ([0.0, 90, 180, -90, 0, 0], [0.0, 0, 0, 0, 90, -90], {"x_V": np.ones(6)})
    assert fit_stream([good])["x_V"].linear.coefficients[0] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="there are no observations"):
        fit_stream([])
    with pytest.raises(ValueError, match="there are no observations"):
        fit_stream([([], [], {"x_V": []})])
    with pytest.raises(ValueError, match="a block has y_V where the first had x_V"):
        fit_stream([good, (good[0], good[1], {"y_V": np.ones(6)})])
    with pytest.raises(ValueError, match="x_V: row 1 holds nan"):
        fit_stream([([0.0, 1], [0.0, 1], {"x_V": [1.0, float("nan")]})])
    with pytest.raises(ValueError, match="x_V: expected 2 values"):
        fit_stream([([0.0, 1], [0.0, 1], {"x_V": [1.0]})])


def test_several_responses_share_a_triangle():
    rng = np.random.default_rng(5)
    columns, y = rng.normal(size=(20, 3)), rng.normal(size=(20, 2))
    both = Triangle(("a", "b", "c")).add(columns[:2], y[:2]).add(columns[2:], y[2:])
    for i in range(2):
        fit, (c, rss, *_) = both.of(i).solve(), np.linalg.lstsq(columns, y[:, i], rcond=None)
        np.testing.assert_allclose(fit.coefficients, c, rtol=1e-12)
        assert fit.rss == pytest.approx(rss[0], rel=1e-12)
    with pytest.raises(ValueError, match="2 columns were given for 3 names"):
        both.add(columns[:, :2], y)


def test_the_documents_example_prints_what_it_says(capsys):
    text = (Path(__file__).parent.parent / "docs" / "least_squares.md").read_text(encoding="utf-8")
    code, printed = re.search(r"```python\n(.*?)```\n\nprints\n\n```\n(.*?)```", text, re.DOTALL).groups()
    exec(compile(code, "least_squares.md", "exec"), {})
    assert capsys.readouterr().out == printed
