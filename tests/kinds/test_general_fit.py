"""Fits of any table on the command line, against answers of other programs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import rig
from scipy import stats

from rig.fitter.constant_scatter import rank_correlation

# Yates (1935), oats: yield in quarter pounds by block, variety and nitrogen; as R's nlme package has it.
OATS = {
    "I": {"Victory": (111, 130, 157, 174), "Golden Rain": (117, 114, 161, 141), "Marvellous": (105, 140, 118, 156)},
    "II": {"Victory": (61, 91, 97, 100), "Golden Rain": (70, 108, 126, 149), "Marvellous": (96, 124, 121, 144)},
    "III": {"Victory": (68, 64, 112, 86), "Golden Rain": (60, 102, 89, 96), "Marvellous": (89, 129, 132, 124)},
    "IV": {"Victory": (74, 89, 81, 122), "Golden Rain": (64, 103, 132, 133), "Marvellous": (70, 89, 104, 117)},
    "V": {"Victory": (62, 90, 100, 116), "Golden Rain": (80, 82, 94, 126), "Marvellous": (63, 70, 109, 99)},
    "VI": {"Victory": (53, 74, 118, 113), "Golden Rain": (89, 82, 86, 104), "Marvellous": (97, 99, 119, 121)},
}


@pytest.fixture
def oats(tmp_path):
    path = tmp_path / "oats.csv"
    rows = [
        f"{block},{variety},{0.2 * i:.1f},{value}"
        for block, varieties in OATS.items()
        for variety, values in varieties.items()
        for i, value in enumerate(values)
    ]
    path.write_text("\n".join(["Block,Variety,nitro,yield", *rows]) + "\n")
    return path


def test_oats_as_lme4_fits_them(oats):
    """lmer(yield ~ nitro + Variety + (1|Block/Variety)), lme4 1.1-31: REML criterion 578.8918."""
    options = ("--response", "yield", "--formula", "1 + nitro + C(Variety)", "--whole-plot", "Block,Variety")
    done = rig("fit", oats, *options, "--replicate", "Block", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    table = {name: (v["estimate"], v["stderr"], v["df"]) for name, v in found["coefficients"].items()}
    assert table["1"][:2] == pytest.approx((82.4, 8.05857199723), abs=1e-6)
    assert table["nitro"] == pytest.approx((73.6666666667, 6.78147989761, 53), abs=1e-6)
    assert table["C(Variety)[Marvellous]"] == pytest.approx((5.29166666667, 7.07890384379, 10), abs=1e-6)
    assert table["C(Variety)[Victory]"] == pytest.approx((-6.875, 7.07890384379, 10), abs=1e-6)
    assert found["sigma_subplot"] ** 2 == pytest.approx(165.558490566, rel=1e-8)
    assert found["sigma_wholeplot"] ** 2 == pytest.approx(108.943016247, rel=1e-6)
    assert found["sigma_replicate"] ** 2 == pytest.approx(214.477083333, rel=1e-6)
    assert -2 * found["reml_loglik"] == pytest.approx(578.891786957, abs=1e-6)


def test_without_whole_plots_it_is_ordinary_least_squares(oats):
    """lm(yield ~ nitro + Variety): 73.667 +- 11.192 on 68 degrees of freedom, sigma 21.2351."""
    done = rig("fit", oats, "--response", "yield", "--formula", "nitro + C(Variety)", "--json")
    found = json.loads(done.stdout)
    assert found["sigma_E"] == pytest.approx(21.2350928, abs=1e-6)
    assert found["coefficients"]["nitro"]["stderr"] == pytest.approx(11.191877, abs=1e-5)
    assert found["coefficients"]["nitro"]["df"] == 68


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--response", "yield", "--formula", "1 + nitro +"), "something is missing at the end"),
        (("--response", "yield", "--formula", "1 + foo"), "there is no column 'foo'; it has Block, Variety, nitro"),
        (("--response", "Variety", "--formula", "1 + nitro"), "Variety is not a column of numbers"),
        (("--response", "yield", "--formula", "1 + Variety"), "as a category it is C(Variety)"),
        (("--response", "yield"), "--response needs --formula"),
        (("--whole-plot", "Variety"), "any other table is fitted with --response and --formula"),
        (("--response", "yield", "--formula", "1 + nitro + I(2*nitro)"), "nitro"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_a_line(oats, options, message):
    done = rig("fit", oats, *options)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_row_in_a_message_is_the_row_of_the_file(tmp_path):
    """The header is row 1; rows that were put in order of time keep their numbers."""
    (tmp_path / "t.csv").write_text("x,y,elapsed_s\n1,1,9\n0,2,8\n2,3,7\n3,4,6\n4,5.1,5\n5,6.2,4\n")
    for command in ("fit", "trace"):
        done = rig(command, "t.csv", "--response", "y", "--formula", "1 + log(x)", cwd=tmp_path)
        assert done.returncode == 2
        assert "log(x) is not a finite number in row 3, where x = 0" in done.stderr


def test_rank_correlations_are_those_of_scipy():
    rng = np.random.default_rng(5)
    for rows in (12, 40, 300):
        x = np.abs(rng.normal(size=rows))
        for y in (rng.integers(0, 9, rows).astype(float), 3.0 * x + rng.normal(size=rows), x, -x):
            r, p = rank_correlation(x, y)
            theirs = stats.spearmanr(x, y)
            assert (r, p) == pytest.approx((theirs.statistic, theirs.pvalue), rel=1e-12, abs=1e-200)
