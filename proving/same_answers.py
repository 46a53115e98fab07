"""Do two states of the program give the same answers? For changes that must not change any.

    .venv/bin/python -m proving.same_answers make FOLDER             # run files, tables and calibrations to ask about
    .venv/bin/python -m proving.same_answers ask FOLDER before       # with this checkout; or --code ANOTHER_CHECKOUT
    .venv/bin/python -m proving.same_answers ask FOLDER after
    .venv/bin/python -m proving.same_answers compare FOLDER before after

`ask` asks about the files that `make` made, and makes the run files anew to see whether the bench gives the same
readings. What the tests print as JSON is compared as well: run them with `-p proving.answers_of_tests` in both states.
Numbers are compared to the last digit.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent.parent
SEEDS = 10
"""Run files of each laboratory."""

ATTITUDE = [("replications = 6", "replications = 3"), ("pitch_count = 13", "pitch_count = 7"), ("= 25", "= 13")]
"""A smaller design: enough for every statistic, and a tenth of the time."""

VOLATILE = {"file", "out", "path", "run", "id", "log"}
"""Keys of JSON that name files or moments, not results."""


def main() -> int:
    """Make, ask or compare, as the command line says; 1 where answers differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_subparsers(dest="what", required=True)
    for name in ("make", "ask", "compare"):
        one = what.add_parser(name)
        one.add_argument("folder", type=Path)
        if name == "ask":
            one.add_argument("name")
        if name == "compare":
            one.add_argument("names", nargs=2)
        else:
            one.add_argument("--code", type=Path, default=HERE, help="checkout to ask, with its own .venv")
    asked = parser.parse_args()
    if asked.what == "make":
        make(asked.folder, asked.code)
    elif asked.what == "ask":
        ask(asked.folder, asked.folder / asked.name, asked.code)
    else:
        return compare(*(asked.folder / name for name in asked.names))
    return 0


def make(folder: Path, code: Path) -> None:
    """Make the run files, tables and calibrations that are asked about."""
    inputs = folder / "inputs"
    inputs.mkdir(parents=True, exist_ok=True)
    for lab, seed in _runs():
        _dry_run(code, lab, seed, inputs)
        run = inputs / f"{lab}-{seed}.sqlite"
        _rig(code, "export", run, "--out", run.with_suffix(".csv"))
        _rig(code, "fit", run, "--out", run.with_suffix(".json"))
    for name, columns in _tables():
        with (inputs / f"{name}.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))


def ask(folder: Path, answers: Path, code: Path) -> None:
    """Ask about all of them, an answer a file."""
    answers.mkdir(parents=True, exist_ok=True)
    inputs = folder / "inputs"
    for lab, seed in _runs():
        run = inputs / f"{lab}-{seed}.sqlite"
        for name, arguments in {
            "fit": ("fit", run),
            "fit-table": ("fit", run.with_suffix(".csv")),
            "trace": ("trace", run),
            "confirm-list": ("confirm", run, "--list"),
            "verify": ("verify", run),
            "status": ("status", run),
        }.items():
            _keep(answers / f"{lab}-{seed}-{name}.json", _rig(code, *arguments, "--json"))
        inferred = answers / f"{lab}-{seed}-inferred.csv"
        _rig(code, "infer", run.with_suffix(".json"), run.with_suffix(".csv"), "--out", inferred)
        again = answers / "again"
        again.mkdir(exist_ok=True)
        _dry_run(code, lab, seed, again)
        _rig(code, "export", again / f"{lab}-{seed}.sqlite", "--out", answers / f"{lab}-{seed}-readings.csv")
    for lab in ("attitude", "pressure"):
        runs = [inputs / f"{lab}-{seed}.csv" for seed in range(1, 6)]
        dated = [f"{run}@2026-0{month}-15" for month, run in enumerate(runs, 1)]
        _keep(answers / f"{lab}-chart.json", _rig(code, "chart", *dated, "--today", "2026-07-01", "--json"))
    for name, columns in _tables():
        table = inputs / f"{name}.csv"
        options = ["--response", "y", "--formula", "1 + x"]
        for column in ("whole_plot", "replicate"):
            options += [f"--{column.replace('_', '-')}", column] if column in columns else []
        _keep(answers / f"table-{name}-fit.json", _rig(code, "fit", table, *options, "--json"))
        more = ["--time", "t_s"] if "t_s" in columns else []
        more += ["--group", "batch"] if "batch" in columns else []
        _keep(answers / f"table-{name}-trace.json", _rig(code, "trace", table, *options, *more, "--json"))


def compare(one: Path, other: Path) -> int:
    """Say which answers differ, and where first; 1 if any does."""
    names = {path.name for folder in (one, other) for path in folder.iterdir() if path.is_file()}
    differing = 0
    for name in sorted(names):
        texts = [(folder / name).read_text() if (folder / name).exists() else "missing" for folder in (one, other)]
        if texts[0] == texts[1]:
            continue
        differing += 1
        print(f"{name}: {_first_difference(*texts)}")
    print(f"{len(names)} answers, {differing} differ")
    return 1 if differing else 0


def plain(value: Any) -> Any:
    """A JSON value without what names files or moments."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items() if key not in VOLATILE}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, str):
        return re.sub(r"\S*/\S*", "PATH", value)
    return value


def _runs() -> Iterator[tuple[str, int]]:
    for lab in ("attitude", "pressure"):
        for seed in range(1, SEEDS + 1):
            yield lab, seed


def _dry_run(code: Path, lab: str, seed: int, folder: Path) -> None:
    """Run the example of the laboratory with this seed of order and world; only every second has anything hidden."""
    target = folder / f"{lab}-{seed}.sqlite"
    if target.exists():
        return
    example = code / "examples" / f"{lab}-lab"
    work = folder / f"{lab}-{seed}"
    work.mkdir(exist_ok=True)
    for name in ("bench.toml", "world.toml", "procedure.toml"):
        text = (example / name).read_text()
        if name == "procedure.toml":
            text = text.replace("seed = 1\n", f"seed = {seed}\n")
            for old, new in ATTITUDE if lab == "attitude" else ():
                text = text.replace(old, new)
        if name == "world.toml":
            text = re.sub(r"(?m)^seed = \d+$", f"seed = {seed}", text)
            if seed % 2:
                text = text.split("\n# What nobody declared.")[0]
        (work / name).write_text(text)
    _rig(
        code,
        "run",
        work / "procedure.toml",
        "-b",
        work / "bench.toml",
        "--dry",
        "--world",
        work / "world.toml",
        "-o",
        work,
    )
    (run,) = work.glob("*.sqlite")
    run.rename(target)


def _tables() -> Iterator[tuple[str, dict[str, list[Any]]]]:
    """Tables of ten shapes, with and without something that the straight line lacks."""
    n = 60
    t_s = np.arange(n) * 30.0
    for number, lack in enumerate(
        ("none", "cubic", "drift", "batch", "periodic", "grows", "step", "plots", "walk", "few")
    ):
        rng = np.random.default_rng(number)
        x = rng.permutation(np.linspace(0.0, 10.0, n))
        error = rng.standard_normal(n)
        batch = np.repeat(np.arange(6), 10)
        columns: dict[str, list[Any]] = {"x": list(x), "t_s": list(t_s)}
        y = 3 + 2 * x + error
        if lack == "cubic":
            y = y + 0.02 * (x - 5) ** 3
        elif lack == "drift":
            y = y + 2e-3 * t_s
        elif lack == "batch":
            y, columns["batch"] = y + rng.standard_normal(6)[batch] * 2, [f"b{k}" for k in batch]
        elif lack == "periodic":
            y = y + np.sin(2 * np.pi * x / 2.5)
        elif lack == "grows":
            y = 3 + 2 * x + error * (0.2 + 0.3 * x)
        elif lack == "step":
            y = y + 2.0 * (np.arange(n) >= 37)
        elif lack == "plots":
            y, columns["whole_plot"] = y + rng.standard_normal(6)[batch], [int(k) for k in batch]
        elif lack == "walk":
            y = y + np.cumsum(rng.standard_normal(n)) * 0.5
        columns["y"] = list(y)
        rows = 12 if lack == "few" else n
        yield lack, {name: values[:rows] for name, values in columns.items()}


def _rig(code: Path, *arguments: object) -> str:
    """What the command printed; where it failed, that and why."""
    command = [str(code / ".venv" / "bin" / "python"), "-m", "rig", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=code)
    if done.returncode not in (0, 3):
        return json.dumps({"exit": done.returncode, "said": plain(str(done.stderr))})
    return str(done.stdout)


def _keep(path: Path, answer: str) -> None:
    path.write_text(json.dumps(plain(json.loads(answer)), indent=1, sort_keys=True))


def _first_difference(one: str, other: str) -> str:
    for number, (left, right) in enumerate(zip(one.splitlines(), other.splitlines(), strict=False), 1):
        if left != right:
            return f"line {number}: {left.strip()[:90]} | {right.strip()[:90]}"
    return f"{len(one.splitlines())} lines, {len(other.splitlines())} lines"


if __name__ == "__main__":
    sys.exit(main())
