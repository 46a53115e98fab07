"""`rig trace` beside what people would use instead: stepwise by BIC, LassoCV, STLSQ, a GAM, symbolic regression.

    python -m benchmarks.bench_trace_peers [nights|tables] [--quick] [--only METHOD]

The peers have an environment of their own; rig needs none of them:

    python -m venv /tmp/peers
    /tmp/peers/bin/pip install numpy scipy pydantic apsw scikit-learn pysindy pygam gplearn
    PYTHONPATH=. OPENBLAS_NUM_THREADS=1 /tmp/peers/bin/python -m benchmarks.bench_trace_peers

What is not installed is left out, and said. What the columns of the tables mean: proving/notes/peers_trace.md.
"""

import argparse
import os
import sys
import time
from dataclasses import dataclass, field
from platform import python_version

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.peer_cases import CLEAN_TABLES, MISSING, night, table
from benchmarks.trace_peers import ABSENT, ON_COLUMNS, ON_VARIABLES, VERSIONS, answer

SHAPE = 0.8
"""Squared correlation with what is truly hidden from which a method without names has found it."""
SINGLES = (
    "pads",
    "offset, temperature",
    "lag",
    "offset step, unrecorded",
    "backlash, roll",
    "creep",
    "square",
    "pitch scale, twice",
    "gear, pitch",
    "slip",
)
PAIRS = (("pads", "cube"), ("offset, temperature", "creep"), ("gear, pitch", "slip"), ("wobble", "backlash, pitch"))


@dataclass
class Score:
    """What is counted of one method in one kind of case."""

    runs: int = 0
    hidden: int = 0
    right: int = 0
    wrong: int = 0
    reported: int = 0
    terms: list = field(default_factory=list)
    ratios: list = field(default_factory=list)
    seconds: list = field(default_factory=list)

    def add(self, right, wrong, terms, error2, case, seconds):
        """Count one run: hidden effects that were found, whether something else was named, terms kept."""
        self.runs += 1
        self.hidden += len(case.right)
        self.right += right
        self.wrong += wrong
        self.reported += terms > 0
        self.terms.append(terms)
        self.ratios.append(np.sqrt(error2 / case.told))
        self.seconds.append(seconds)


def by_rig(case, score):
    """Run the tracer."""
    began = time.process_time()
    leading, error2 = case.traced()
    seconds = time.process_time() - began
    classes = [{name, *aliases} for name, aliases in leading.items()]
    right = sum(any(names & one for one in classes) for names in case.right)
    good = set().union(*case.right)
    score.add(right, any(not one & good for one in classes), len(leading), error2, case, seconds)


def by_columns(method, columns, names, case, score):
    """Run a method on columns, with names or without."""
    began = time.process_time()
    got = answer(method, columns, case.y, case.fold)
    seconds = time.process_time() - began
    if names is None:
        right, wrong = _shape(got.fitted, case), False
    else:
        kept, good = {names[j] for j in got.kept}, set().union(*case.right)
        right, wrong = sum(bool(kept & one) for one in case.right), bool(kept - good)
    error2 = case.declared + float(np.sum((got.fitted - case.hidden) ** 2))
    score.add(right, wrong, len(got.kept), error2, case, seconds)


def by_variables(method, case, score):
    """Run a method on the variables themselves, sensor by sensor."""
    began, fitted, terms = time.process_time(), np.zeros(len(case.y)), 0
    for rows, variables in case.variables:
        got = answer(method, variables, case.y[rows], case.fold[rows])
        fitted[rows], terms = got.fitted, terms + len(got.kept)
    seconds = time.process_time() - began
    error2 = case.declared + float(np.sum((fitted - case.hidden) ** 2))
    score.add(_shape(fitted, case), False, terms, error2, case, seconds)


def _shape(fitted, case):
    """How many of the hidden effects count as found, by what was fitted: all or none."""
    if not case.right or not np.any(fitted):
        return 0
    return len(case.right) if np.corrcoef(fitted, case.hidden)[0, 1] ** 2 >= SHAPE else 0


METHODS = {
    "rig trace": by_rig,
    **{
        f"{name}; {what}": lambda case, score, m=method, named=named: by_columns(
            m, case.columns if named else case.generic, case.names if named else None, case, score
        )
        for what, named in (("catalogue", True), ("generic library", False))
        for name, (method, package) in ON_COLUMNS.items()
        if package not in ABSENT
    },
    **{
        name: lambda case, score, m=method: by_variables(m, case, score)
        for name, (method, package) in ON_VARIABLES.items()
        if package not in ABSENT
    },
}


def nights(quick):
    """(kind, case) of pitch-roll nights."""
    for k, name in enumerate(SINGLES[::5] if quick else SINGLES):
        for rms in (0.5,) if quick else (0.25, 0.5, 2.0):
            yield f"one effect, {rms:g} sd", night([name], rms, 100 + k)
    for k, names in enumerate(PAIRS[:1] if quick else PAIRS):
        yield "two effects, 0.5 sd each", night(list(names), 0.5, 200 + k)
    for k in range(1 if quick else 6):
        yield "nothing hidden", night([], 0.0, 300 + k)
    for k in range(1 if quick else 4):
        yield "nothing hidden, replications offset by 0.5 sd", night([], 0.0, 400 + k, offset_sd=0.5)


def tables(quick):
    """The same of tables."""
    for name, missing in MISSING.items():
        for rms in (1.0,) if quick else (0.5, 1.0):
            for seed in range(1 if quick else 3):
                yield f"one effect, {rms:g} sd", table(name, missing.lab, rms, 100 + seed)
    for what, labs in CLEAN_TABLES.items():
        for seed in range(1 if quick else 12):
            for lab in labs:
                yield f"nothing hidden, {what}", table(None, lab, 0.0, 300 + seed)


def campaign(title, cases, only):
    """Run all methods over all cases and print a table of each kind."""
    began, scores = time.time(), {}
    for kind, case in cases:
        for name, run in METHODS.items():
            if only in name:
                run(case, scores.setdefault(kind, {}).setdefault(name, Score()))
        print(f"{time.time() - began:6.0f} s  {kind}", file=sys.stderr, flush=True)
    for kind, by in scores.items():
        clean = kind.startswith("nothing")
        counts = ["something reported"] if clean else ["found", "wrong name besides"]
        heads = ["method", "runs", *counts, "terms, median", "error ratio, median; 95 %", "s"]
        print(f"\n{title}: {kind}\n\n| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
        for name, score in by.items():
            print(line(name, score, clean=clean), flush=True)


def line(name, score, *, clean):
    """A row of the table."""
    ratio = f"{np.median(score.ratios):.2f}; {np.quantile(score.ratios, 0.95):.2f}"
    rest = f"{np.median(score.terms):.0f} | {ratio} | {np.median(score.seconds):.2f} |"
    if clean:
        return f"| {name} | {score.runs} | {score.reported} | {rest}"
    wrong = "-" if "generic" in name or name in ON_VARIABLES else f"{score.wrong}"
    return f"| {name} | {score.runs} | {score.right} of {score.hidden} | {wrong} | {rest}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("what", nargs="?", choices=["nights", "tables"])
    parser.add_argument("--quick", action="store_true", help="about two minutes")
    parser.add_argument("--only", default="", help="methods whose name has this in it")
    given = parser.parse_args()
    print(f"Python {python_version()}, " + ", ".join(f"{p} {v}" for p, v in VERSIONS.items() if v))
    for package in ABSENT:
        print(f"{package} is not installed here: what needs it is left out")
    for title, cases in (("nights", nights), ("tables", tables)):
        if given.what in (None, title):
            campaign(title, cases(given.quick), given.only)


if __name__ == "__main__":
    main()
