"""Measured figures, each with the commit and the date of its measurement: proving/notes/figures.md.

    make figures                                    measure all times and memories (half an hour)
    make campaigns                                  repeat a bounded share of each kind of campaign (an hour or two)
    make figure NAME                                measure one

What is measured stands in benchmarks/figures.toml. A row between the marks of the document is written by the command
that measured it, and by nothing else. Code that is not committed is marked with a + after the commit.
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
DOCUMENT = HERE / "proving" / "notes" / "figures.md"
MARKS = [
    (f"<!-- written by `make {what}`: begin -->", f"<!-- written by `make {what}`: end -->")
    for what in ("figures", "campaigns")
]
"""Around the table of times and memories, and around that of campaigns."""
HEAD = ("| name | what | figure | command | commit | date |", "| --- | --- | --- | --- | --- | --- |")
TIMES = 3
LIMIT_S = 1800.0


@dataclass(frozen=True)
class Figure:
    """What is measured: see benchmarks/figures.toml."""

    name: str
    what: str
    command: str
    says: tuple[str, ...] = ()
    campaign: bool = False
    spans: tuple[str, ...] = ()


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
    return {
        name: Figure(
            name,
            one["what"],
            one["command"],
            tuple(one.get("says", ())),
            bool(one.get("campaign", False)),
            tuple(one.get("spans", ())),
        )
        for name, one in tomllib.loads((HERE / "benchmarks" / "figures.toml").read_text()).items()
    }


def rows(text: str) -> dict[str, Row]:
    """The rows of a document by name."""
    found = {}
    for begin, end in MARKS:
        for line in text.partition(begin)[2].partition(end)[0].splitlines():
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if len(cells) == 6 and line not in HEAD:
                found[cells[0]] = Row(*cells[:3], cells[3].strip("`"), *cells[4:])
    return found


def written(text: str, measured: dict[str, Row]) -> str:
    """The document with these rows between its marks, in the order of benchmarks/figures.toml."""
    for campaign, (begin, end) in enumerate(MARKS):
        before, found, rest = text.partition(begin)
        _, ended, after = rest.partition(end)
        if not (found and ended):
            raise SystemExit(f"{DOCUMENT} lacks the marks {begin} and {end}; put them back where the table stands")
        known = figures().items()
        lines = [measured[name].line() for name, one in known if name in measured and one.campaign == bool(campaign)]
        text = before + "\n".join((begin, "", *HEAD, *lines, "", end)) + after
    return text


def git(*arguments: str, cwd: Path = HERE) -> str:
    return subprocess.run(["git", *arguments], cwd=cwd, check=True, capture_output=True, text=True).stdout.strip()


def surroundings(**also: str) -> dict[str, str]:
    """The environment of a measured command: one thread, compiled modules kept as where the program is used."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | also


def measure(figure: Figure) -> str:
    """Run a figure's command, and quote it. Raises `SystemExit` if it fails or says something else."""
    argv = shlex.split(figure.command)
    argv[0] = str(Path(sys.executable).parent / argv[0])
    environment = surroundings()
    processor, wall = [], []
    quoted = figure.says + figure.spans
    for _ in range(1 if quoted else TIMES):
        began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            argv, cwd=HERE, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            raise SystemExit(f"{figure.name}: `{figure.command}` ended with {done.returncode}:\n{done.stderr}")
        processor.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        wall.append(time.perf_counter() - began)
    if not quoted:
        middle = TIMES // 2
        return f"{sorted(processor)[middle]:.2f} s of processor time, {sorted(wall)[middle]:.1f} s (medians of {TIMES})"
    said = told(figure, done.stdout)
    if not said:
        raise SystemExit(f"{figure.name}: `{figure.command}` no longer says {quoted[0]!r}")
    return "; ".join(re.sub(r"\s+", " ", one).strip() for one in said)


def told(figure: Figure, output: str) -> list[str]:
    """What a figure quotes of its command's output: of a campaign every match, of another figure the first."""
    said = []
    for pattern in figure.says:
        every = [found[1] for found in re.finditer(pattern, output)]
        said += every if figure.campaign else every[:1]
    for pattern in figure.spans:
        numbers = [float(found[1]) for found in re.finditer(pattern, output)]
        if numbers:
            mean = sum(numbers) / len(numbers)
            said.append(f"{min(numbers):g} to {max(numbers):g}, mean {mean:.4g}, in {len(numbers)}")
    return said


def today() -> tuple[str, str]:
    """The commit, with a + if there are changes that are not committed, and the date."""
    changed = "+" if git("status", "--porcelain") else ""
    return git("rev-parse", "--short=8", "HEAD") + changed, datetime.now(UTC).date().isoformat()


def measured(figure: Figure) -> Row:
    commit, date = today()
    said = measure(figure)
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    busy = f" (load {load:.1f} on {cores} cores)" if load > cores and not figure.campaign else ""
    return Row(figure.name, figure.what, said + busy, figure.command, commit, date)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="figures to measure; all if none is named")
    parser.add_argument("--campaigns", action="store_true", help="the campaigns")
    asked = parser.parse_args()
    known = figures()
    strange = [name for name in asked.names if name not in known]
    if strange:
        parser.error(f"no figure {', '.join(strange)}; there are {', '.join(known)}")
    names = asked.names or [name for name, one in known.items() if one.campaign == asked.campaigns]
    for name in names:
        row = measured(known[name])
        text = DOCUMENT.read_text()
        DOCUMENT.write_text(written(text, rows(text) | {name: row}))
        print(row.line(), flush=True)


if __name__ == "__main__":
    main()
