"""Rows of which none is far enough off by itself, but all together are no chance: their number is told."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import rig

from rig.fitter.gross import gross_errors

N, ALIKE, SD = 500, 50, 1e-3


def table(seed, *, alike=ALIKE, size=4.0, far=(), n=N):
    """A line with noise, of which `alike` rows are just `size` sd off, up or down, and one is off for each of `far`."""
    rng = np.random.default_rng([41, seed])
    x = np.linspace(0.0, 10.0, n)
    line = 1.0 + 2.0 * x
    y = line + SD * rng.normal(size=n)
    bad = rng.choice(n, alike + len(far), replace=False)
    sign = rng.choice([-1.0, 1.0], bad.size)
    y[bad] = line[bad] + SD * sign * np.r_[np.full(alike, size), far]
    return x, y, bad


def found(x, y):
    return gross_errors(y, np.column_stack([np.ones(len(x)), x]))


@pytest.mark.parametrize("far", [(), (50.0,), (1e6, 1e6)], ids=["alone", "beside one", "beside giants"])
def test_many_that_are_a_little_off_are_doubtful(far):
    """Beside a row that was named they were not mentioned: it alone outweighs them in a test of all."""
    for seed in range(3):
        x, y, bad = table(seed, far=far)
        told = found(x, y)
        assert set(bad[ALIKE:].tolist()) <= set(told.rows.tolist()) <= set(bad.tolist())
        assert told.doubtful > 0
        assert bad.size <= told.rows.size + told.doubtful <= 1.2 * bad.size, "with the farthest of the good rows"


@pytest.mark.parametrize("far", [(), (7.0,), (20.0, 1e5)])
def test_good_rows_are_not_doubtful(far):
    assert [found(*table(seed, alike=0, far=far, n=40)[:2]).doubtful for seed in range(20)] == [0] * 20


def test_rows_that_are_named_are_not_counted_again():
    x, y, bad = table(0, size=6.0)
    told = found(x, y)
    assert set(told.rows.tolist()) == set(bad.tolist())
    assert told.doubtful == 0


@pytest.mark.parametrize(
    ("far", "words"),
    [
        ((), "no gross errors found; the scatter is not that of normal errors: up to {} rows may be wrong, but none"),
        ((50.0,), "the scatter is not that of normal errors: up to {} more rows may be wrong, but none is far enough"),
    ],
)
def test_rig_fit_says_how_many_and_keeps_them(tmp_path, far, words):
    x, y, _ = table(0, far=far)
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    (tmp_path / "t.csv").write_text("x,y\n" + rows)
    arguments = ("fit", "t.csv", "--response", "y", "--formula", "1 + x", "--leave-out", "gross")
    told = json.loads(rig(*arguments, "--json", cwd=tmp_path).stdout)
    gross = told["gross_errors"]
    assert len(gross["rows"]) == len(far) == len(told["data"]["rows_left_out"])
    assert ALIKE <= gross["doubtful"] <= 1.2 * ALIKE
    assert words.format(gross["doubtful"]) in gross["sentence"]
    assert words.format(gross["doubtful"]).partition(":")[0] in " ".join(rig(*arguments, cwd=tmp_path).stdout.split())
