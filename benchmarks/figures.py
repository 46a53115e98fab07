"""Figures of docs/figures.md that carry the commit and the date on which they were measured.

    make figures                                    measure all of them (half an hour)
    make figure NAME                                measure one
    .venv/bin/python -m benchmarks.figures --stale  which are older than the last change of the code they speak of

What is measured stands in benchmarks/figures.toml. A row is written by the command that measured it,
and by nothing else. Code that is not committed is marked with a + after the commit.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shlex
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

HERE = Path(__file__).parent.parent
DOCUMENT = HERE / "docs" / "figures.md"
BEGIN, END = "<!-- written by `make figures`: begin -->", "<!-- written by `make figures`: end -->"
HEAD = ("| name | what | figure | command | commit | date |", "| --- | --- | --- | --- | --- | --- |")
TIMES = 3
LIMIT_S = 1800.0


@dataclass(frozen=True)
class Figure:
    """What is measured: see benchmarks/figures.toml."""

    name: str
    what: str
    command: str
    paths: tuple[str, ...]
    says: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """A measured figure, as it stands in the document."""

    name: str
    what: str
    figure: str
    command: str
    commit: str
    date: str

    def line(self) -> str:
        cells = (self.name, self.what, self.figure, f"`{self.command}`", self.commit, self.date)
        return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def figures() -> dict[str, Figure]:
    """Every figure by name."""
    told = tomllib.loads((HERE / "benchmarks" / "figures.toml").read_text())
    return {
        name: Figure(name, one["what"], one["command"], tuple(one["paths"]), tuple(one.get("says", ())))
        for name, one in told.items()
    }


def rows(text: str) -> dict[str, Row]:
    """The rows of a document by name."""
    between = text.partition(BEGIN)[2].partition(END)[0]
    found = {}
    for line in between.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) == 6 and line not in HEAD:
            found[cells[0]] = Row(*cells[:3], cells[3].strip("`"), *cells[4:])
    return found


def written(text: str, measured: dict[str, Row]) -> str:
    """The document with these rows between its marks, in the order of benchmarks/figures.toml."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise SystemExit(f"{DOCUMENT} lacks the marks {BEGIN} and {END}; put them back where the table stands")
    lines = [measured[name].line() for name in figures() if name in measured]
    return before + "\n".join((BEGIN, "", *HEAD, *lines, "", END)) + after


def git(*arguments: str, cwd: Path = HERE) -> str:
    return subprocess.run(["git", *arguments], cwd=cwd, check=True, capture_output=True, text=True).stdout.strip()


def measure(figure: Figure) -> str:
    """Run a figure's command, and quote it. Raises `SystemExit` if it fails or says something else."""
    argv = shlex.split(figure.command)
    argv[0] = str(Path(sys.executable).parent / argv[0])
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    processor, wall = [], []
    for _ in range(1 if figure.says else TIMES):
        began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            argv, cwd=HERE, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            raise SystemExit(f"{figure.name}: `{figure.command}` ended with {done.returncode}:\n{done.stderr}")
        processor.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        wall.append(time.perf_counter() - began)
    if not figure.says:
        middle = TIMES // 2
        return f"{sorted(processor)[middle]:.2f} s of processor time, {sorted(wall)[middle]:.1f} s (medians of {TIMES})"
    said = [found[1] for pattern in figure.says if (found := re.search(pattern, done.stdout))]
    if not said:
        raise SystemExit(f"{figure.name}: `{figure.command}` no longer says {figure.says[0]!r}")
    return "; ".join(re.sub(r"\s+", " ", one) for one in said)


def measured(figure: Figure) -> Row:
    changed = "+" if git("status", "--porcelain", "--", *figure.paths) else ""
    said = measure(figure)
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    busy = f" (load {load:.1f} on {cores} cores)" if load > cores else ""
    date = datetime.now(UTC).date().isoformat()
    commit = git("rev-parse", "--short=8", "HEAD") + changed
    return Row(figure.name, figure.what, said + busy, figure.command, commit, date)


def stale(figure: Figure, row: Row | None, cwd: Path = HERE) -> str:
    """Why a row does not speak of the code of today; "" if it does."""
    if row is None:
        return f"{figure.name}: not measured yet; `make figure {figure.name}`"
    if row.commit.endswith("+"):
        return f"{figure.name}: measured on code that was not committed; `make figure {figure.name}`"
    try:
        since = git("log", "--format=%h", f"{row.commit}..HEAD", "--", *figure.paths, cwd=cwd).split()
    except subprocess.CalledProcessError:
        return f"{figure.name}: its commit {row.commit} is not in this clone"
    if not since:
        return ""
    return (
        f"{figure.name}: measured on {row.date} at {row.commit}; the code it speaks of changed in {len(since)} commits "
        f"since, last in {since[0]}; `make figure {figure.name}`"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="figures to measure; all if none is named")
    parser.add_argument("--stale", action="store_true", help="say which rows are older than their code")
    asked = parser.parse_args()
    known = figures()
    if asked.stale:
        if not (HERE / ".git").exists():
            print("figures: no git here, so their age is not known")
            return
        standing = rows(DOCUMENT.read_text())
        said = [one for figure in known.values() if (one := stale(figure, standing.get(figure.name)))]
        print("\n".join(("docs/figures.md, rows older than their code (a notice):", *said)) if said else "", end="\n")
        return
    strange = [name for name in asked.names if name not in known]
    if strange:
        parser.error(f"no figure {', '.join(strange)}; there are {', '.join(known)}")
    for name in asked.names or known:
        row = measured(known[name])
        text = DOCUMENT.read_text()
        DOCUMENT.write_text(written(text, rows(text) | {name: row}))
        print(row.line(), flush=True)


if __name__ == "__main__":
    main()
