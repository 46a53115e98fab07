"""Least squares beside its peers, and a million points in constant memory; all measured in one run.

    python -m benchmarks.bench_least_squares            speed
    python -m benchmarks.bench_least_squares speed      2,886 points: ours, lmfit, numpy
    python -m benchmarks.bench_least_squares digits     NIST's eleven linear problems: digits that are right
    python -m benchmarks.bench_least_squares csv        a table of a million rows through `rig fit` (a minute, 135 MB)

lmfit comes with `pip install -e '.[bench]'`; without it its line is left out. The bench is that of the fitter's tests
(proving/truth/attitude.py).
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # tall thin matrices: threads cost more than they bring

import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

from nist import PROBLEMS, digits

from proving.truth.attitude import D1, Bench, simulate
from rig.fitter import Triangle, least_squares
from rig.fitter.all_digits import refine
from rig.fitter.formula import Formula
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import fit_attitude
from rig.procedures.attitude.model import COLUMNS, attitude_columns, attitude_parameters, fit_columns

NIGHT = D1(180, 37, 13)
ROUNDS, CALLS = 40, 5
BLOCK = 10_000
ME = "benchmarks.bench_least_squares"


def medians(actions):
    """Median milliseconds of each action; they take turns, five calls each, so that all meet the same neighbours."""
    took = {name: [] for name in actions}
    for _ in range(ROUNDS):
        for name, action in actions.items():
            start = time.perf_counter()
            for _ in range(CALLS):
                action()
            took[name].append((time.perf_counter() - start) / CALLS)
    return {name: 1e3 * statistics.median(times) for name, times in took.items()}


def speed():
    data, _ = simulate(Bench(), NIGHT, seed=0)
    y = data.outputs["x_V"]
    columns = attitude_columns(data.pitch_deg, data.roll_deg)
    triangle = Triangle(COLUMNS).add(columns, y).solve()

    def from_columns(given):
        fit = fit_columns(given, y)
        return attitude_parameters(0, fit.coefficients, fit.covariance)

    def from_angles():
        return from_columns(attitude_columns(data.pitch_deg, data.roll_deg))

    groups = [
        {
            "from angles: parameters and covariance": from_angles,
            "  with Table 2 (fit_attitude)": lambda: fit_attitude(data, "x_V"),
        },
        {
            "from columns: parameters and covariance": lambda: from_columns(columns),
            "  refined in twice-long arithmetic": lambda: refine(columns, None, y, triangle.root),
            "  numpy.linalg.lstsq, coefficients alone": lambda: np.linalg.lstsq(columns, y, rcond=None),
        },
    ]
    try:
        model, minimized = lmfit_model(data, y), lmfit_minimize(columns, y)
    except ImportError:
        print("lmfit is not installed: pip install -e '.[bench]'")
    else:
        compare(from_angles(), model())
        compare(from_angles(), minimized())
        groups[0]["  lmfit.Model of eq. (2), its defaults"] = model
        groups[1]["  lmfit.minimize, its defaults"] = minimized
    found = medians({name: action for group in groups for name, action in group.items()})
    for group in groups:
        base = found[next(iter(group))]
        for name in group:
            print(f"{name:42s} {found[name]:8.3f} ms  {found[name] / base:6.1f} times")


def lmfit_model(data: AttitudeData, y):
    """Eq. (2) written as its documentation shows, from nominal values; derivatives are numerical."""
    import lmfit

    def output(pitch, roll, b, S, Omega, A):
        a, r, Omega, A = np.radians(pitch), np.radians(roll), np.radians(Omega), np.radians(A)
        lean = np.cos(a) * (np.sin(r) * np.cos(A) + np.cos(r) * np.sin(A))
        return b + S * (np.cos(Omega) * np.sin(a) - np.sin(Omega) * lean)

    model = lmfit.Model(output, independent_vars=["pitch", "roll"])
    return lambda: model.fit(y, pitch=data.pitch_deg, roll=data.roll_deg, b=0.0, S=5.0, Omega=0.5, A=45.0)


def lmfit_minimize(columns, y):
    """The same with sines and cosines computed beforehand."""
    import lmfit

    _, sin_a, across_y, across_z = columns.T.copy()

    def residual(p):
        Omega, A = np.radians(p["Omega"].value), np.radians(p["A"].value)
        lean = across_y * np.cos(A) + across_z * np.sin(A)
        return p["b"].value + p["S"].value * (np.cos(Omega) * sin_a - np.sin(Omega) * lean) - y

    return lambda: lmfit.minimize(residual, lmfit.create_params(b=0.0, S=5.0, Omega=0.5, A=45.0))


def compare(own, theirs):
    values = [theirs.params[name].value for name in ("b", "S", "Omega", "A")]
    errors = [theirs.params[name].stderr for name in ("b", "S", "Omega", "A")]
    away = np.abs(np.array([own.b_V, own.S_V, own.Omega_deg, own.A_deg]) - values) / own.stderr
    print(
        f"ours and lmfit's parameters differ by {away.max():.1e} standard errors, these by "
        f"{np.abs(own.stderr / errors - 1).max():.1e}; lmfit took {theirs.nfev} evaluations"
    )


def digits_right():
    headings = ("coefficients", "their errors", "sigma", "numpy's lstsq")
    print(f"{'fewest digits right, of 15':28s}" + " ".join(f"{heading:>13s}" for heading in headings))
    for name, problem in PROBLEMS.items():
        names, columns = Formula.parse(problem.model).exact_columns(problem.columns)
        y = problem.columns["y"]
        fit = least_squares(columns.hi, y, names, tails=columns.lo)
        theirs = np.linalg.lstsq(columns.hi, y, rcond=None)[0]
        found = (fit.coefficients, fit.stderr, [fit.sigma], theirs)
        certified = (problem.coefficients, problem.stderr, [problem.sigma], problem.coefficients)
        least = [min(map(digits, f, c)) for f, c in zip(found, certified, strict=True)]
        print(f"{name:10s} condition {fit.condition:7.1e}" + " ".join(f"{max(value, 0.0):13.1f}" for value in least))


def csv():
    from benchmarks.scratch import RUNS

    path = RUNS / "million.csv"
    # written elsewhere: a process is charged with what its parent had in memory
    subprocess.run([sys.executable, "-m", ME, f"write:{path}"], check=True)
    size = path.stat().st_size / 1e6
    try:
        read = f"from pathlib import Path; from rig.tables import read_table; read_table(Path({str(path)!r}))"
        for what, command in (
            ("read", [sys.executable, "-c", read]),
            ("rig fit", [sys.executable, "-m", "rig", "fit", str(path), "--json"]),
        ):
            start = time.perf_counter()
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
            _, status, usage = os.wait4(process.pid, 0)
            assert status == 0
            took = time.perf_counter() - start
            print(f"{what:8s} {size:.0f} MB of CSV: {took:.1f} s, {usage.ru_maxrss / 1e3:.0f} MB resident")
    finally:
        path.unlink()


def write(path):
    from rig.tables.csv_files import write_csv

    data, _ = simulate(Bench(), D1(180, 1801, 93), seed=1)
    names = ("replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC")
    write_csv({**{name: getattr(data, name) for name in names}, **data.outputs}, Path(path))
    print(f"{len(data):,} rows")


if __name__ == "__main__":
    for name in sys.argv[1:] or ["speed"]:
        what, _, given = name.partition(":")
        if what == "write":
            write(given)
        else:
            {"speed": speed, "csv": csv, "digits": digits_right}[what]()
