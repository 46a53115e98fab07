"""Fractions of simulated nights with the paper's isolation pads: how often they say what the whole night says.

    python -m benchmarks.fraction_campaign [--seeds 100]

The bench is that of the fitter's tests (proving/truth/attitude.py): 1.5e-4 deg of scatter, pads so soft that sigma_bias
of the x sensor is the paper's 3.7e-4 deg. Beside them figures of NASA/TP-1999-209835: Table 2, sections 9.2.2 to 9.3.4.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from test_fractions import PADS, table_of

from procedures.attitude.fractions_compared import compare_fractions
from proving.truth.attitude import D1, simulate

CASES = (
    ("13 x 25 over +-30 deg, 53 points", D1(30, 13, 25), "53", (26.2, 36.2, 1.005, 0.911)),
    ("37 x 13 over +-180 deg, 73 points", D1(180, 37, 13), "73", (23.9, 27.3, 1.002, 0.995)),
    ("37 x 13 over +-180 deg, tumble", D1(180, 37, 13), "tumble", (23.9, 85.0, 2.54, 2.40)),
)
HEADINGS = ("T_bias, all", "of the part", "residuals", "over sigma_E", "interval", "within 95 %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    seeds = parser.parse_args().seeds
    print("x sensor, medians. residuals: of all points under the part's coefficients, over those under their own;")
    print("over sigma_E: the same over what the part says itself; interval: over that of all points")
    print(f"{'':36s}", " ".join(f"{heading:>12s}" for heading in HEADINGS))
    for name, plan, which, paper in CASES:
        rows = np.array([figures(plan, which, seed) for seed in range(seeds)])
        found, kept = rows[:, -1].sum(), np.count_nonzero(rows[:, 2] < 1.02)
        print(f"{name:36s}", " ".join(f"{value:12.3f}" for value in np.median(rows[:, :-1], axis=0)))
        print(f"{'  the paper':36s}", " ".join(f"{value:12.3f}" for value in paper))
        print(f"  lack of fit found by the part in {found:.0f} of {seeds}; residuals within 2 % in {kept}", flush=True)


def figures(plan, which, seed):
    found = compare_fractions(table_of(simulate(PADS, plan, seed)[0]), which)
    whole, part = (side["sensors"]["x_V"] for side in (found["full"], found["fractions"][0]))
    return (
        whole["T_bias"],
        part["T_bias"],
        part["residual_deg"] / whole["residual_deg"],
        part["residual_deg"] / part["sigma_E_deg"],
        part["interval_ratio"],
        part["coverage95"],
        part["T_bias"] > part["F_bias_95"],
    )


if __name__ == "__main__":
    main()
