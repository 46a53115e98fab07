"""Loops with a goal whose hours do not suffice for everything: what they make of them.

python -m proving.scarce_hours [--loops 10] [--seed 1] [--jobs 2]

Each loop is a dry one of the voltmeter, in a world of its own with an undeclared offset of two ranges. Its goal is a
standard uncertainty of the gain; its hours would hold a part of the replications that the declared model needs for it.
Printed of each: runs, bench hours, whether the offset is confirmed, whether the goal is met, the half-width of the gain
over its goal, and the error of the calibration without noise, rms over the settings of the design, over the scatter of
an observation.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import statistics
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from proving.loops import files_of, loop_in, voltmeter
from rig.fitter.formula import Formula
from rig.fitter.sequential import t_of
from rig.loop import Program

READINGS = 5


@dataclass(frozen=True)
class Spent:
    """Figures of one loop.

    Attributes:
        runs: numbers of replications that were added before the first further run and after it, and of further runs.
        hours: bench hours, of those it had.
        had: these.
        confirmed: whether the offset is confirmed.
        met: whether the goal is met by the calibration that is written.
        half: half-width of the gain's interval in it, over that of the goal.
        error: error of the calibration without noise, rms over the scatter of an observation.
        why: why nothing more is done for the goal.
    """

    runs: tuple[int, int, int]
    hours: float
    had: float
    confirmed: bool
    met: bool
    half: float
    error: float
    why: str


def one_loop(seed: int) -> Spent:
    """Conduct a loop."""
    rng, world = random.Random(7000 + seed), voltmeter(seed)
    sigma, had = rng.uniform(1.5e-9, 3e-9), rng.uniform(0.7, 1.6)
    goal = {"sigma": {"input_V": sigma}, "least_replications": 2, "most_replications": 40}
    world = replace(world, procedure={**world.procedure, "goal": goal})
    with tempfile.TemporaryDirectory() as name:
        files_of("voltmeter", world, Path(name))
        program = loop_in(Path(name), had)
        return _spent(program, world.procedure, world.sizes["range-step:input_V"], sigma, had)


def _spent(program: Program, procedure: dict[str, Any], size: float, sigma: float, had: float) -> Spent:
    kinds = [run.planned.segment for run in program.runs[1:]]
    before = next((k for k, segment in enumerate(kinds) if not segment), len(kinds))
    (file,) = program.wrote["calibration"].files
    fitted = json.loads(program.path.with_name(file).read_text(encoding="utf-8"))
    coefficients = _coefficients(fitted)
    x = np.array(procedure["factors"]["input_V"]["levels"], np.float64)
    terms = Formula.parse(" + ".join(name for name in coefficients if name != "1"))
    names, columns = terms.columns({"input_V": x})
    said = columns @ np.array([coefficients[name]["estimate"] for name in names])
    true = 3e-6 + 1.000012 * x + size * (np.abs(x) > 12.0)
    gain = coefficients["input_V"]
    half = t_of(gain["df"]) * gain["stderr"] / (1.96 * sigma)
    took = sum(run.ended.took_s for run in program.runs if run.ended is not None) / 3600.0
    verdicts = program.found[max(program.found)].verdicts
    return Spent(
        (before, sum(kinds) - before, len(kinds) - sum(kinds)), took, had,
        confirmed=verdicts.get("range-step:input_V") == "confirmed", met=half <= 1.0, half=half,
        error=float(np.sqrt(np.mean((said - true) ** 2))) / (15e-6 / READINGS**0.5),
        why=program.goal.why.partition(":")[0] if program.goal is not None else "",
    )  # fmt: skip


def _coefficients(given: Any) -> dict[str, Any]:
    """The coefficients of the first model in a calibration file."""
    if isinstance(given, dict):
        found = given.get("coefficients")
        if isinstance(found, dict) and "input_V" in found:
            return found
        for value in given.values():
            if deeper := _coefficients(value):
                return deeper
    return {}


def main() -> int:
    """As the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--loops", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    seeds = range(asked.seed, asked.seed + asked.loops)
    with ProcessPoolExecutor(asked.jobs) as pool:
        told = []
        for seed, one in zip(seeds, pool.map(one_loop, itertools.chain(seeds)), strict=True):
            told.append(one)
            print(
                f"  {seed}: replications {one.runs[0]} before and {one.runs[1]} after {one.runs[2]} further runs, "
                f"{one.hours:.2f} of {one.had:.2f} h, confirmed {one.confirmed}, goal met {one.met} ({one.half:.2f}), "
                f"error {one.error:.2f}; {one.why}",
                flush=True,
            )
    half, error = (statistics.median(values) for values in zip(*((one.half, one.error) for one in told), strict=True))
    print(
        f"seeds {seeds.start} to {seeds.stop - 1}: confirmed {sum(one.confirmed for one in told)}, goals met "
        f"{sum(one.met for one in told)}, half-width over goal, median {half:.2f}, error over scatter, median "
        f"{error:.2f}; bench hours, sum "
        f"{sum(one.hours for one in told):.1f} of {sum(one.had for one in told):.1f}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
