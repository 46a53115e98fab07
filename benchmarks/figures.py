"""Measured figures, each with the commit and the date of its measurement: docs/figures.md, docs/larger_campaigns.md.

    make figures                                    measure all times and memories (half an hour)
    make campaigns                                  repeat the campaigns that are older than their code (an hour or two)
    make figure NAME                                measure one
    .venv/bin/python -m benchmarks.figures --stale  which are older than the last change of the code they speak of
    .venv/bin/python -m benchmarks.figures --stamp "short nights, attitude"  a campaign's row has been measured now

What is measured stands in benchmarks/figures.toml. A row between the marks of docs/figures.md is written by the command
that measured it, and by nothing else. Of each kind of campaign a bounded share is there too (`campaign = true`),
minutes each. Larger ones take hours and are told in words in docs/larger_campaigns.md: a person writes their figure,
and --stamp writes the commit and the date. Code that is not committed is marked with a + after the commit; before
commits were written, a row got that of its text, marked with <=: it was measured then or earlier.
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
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent.parent
DOCUMENT = HERE / "docs" / "figures.md"
LARGER = HERE / "docs" / "larger_campaigns.md"
MARKS = [
    (f"<!-- written by `make {what}`: begin -->", f"<!-- written by `make {what}`: end -->")
    for what in ("figures", "campaigns")
]
"""Around the table of times and memories, and around that of campaigns."""
HEAD = ("| name | what | figure | command | commit | date |", "| --- | --- | --- | --- | --- | --- |")
CAMPAIGNS = ("| what | figure | command | commit | date |", "| --- | --- | --- | --- | --- |")
BEFORE = "<= "
"""Mark of a commit at or before which a row was measured."""
SECTIONS = "sections"
"""Table of benchmarks/figures.toml with the paths of each section of the larger campaigns."""
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
            tuple(one["paths"]),
            tuple(one.get("says", ())),
            bool(one.get("campaign", False)),
            tuple(one.get("spans", ())),
        )
        for name, one in _told().items()
        if name != SECTIONS
    }


def sections() -> dict[str, tuple[str, ...]]:
    """The paths that the larger campaigns of each section speak of."""
    return {name: tuple(paths) for name, paths in _told()[SECTIONS].items()}


def _told() -> dict[str, Any]:
    return tomllib.loads((HERE / "benchmarks" / "figures.toml").read_text())


@dataclass(frozen=True)
class Campaign:
    """A row that a person wrote: where it stands, and what it speaks of.

    Attributes:
        section: its heading.
        line: its line in the document, from 0.
        row: name (what is measured), figure, command, commit and date.

    """

    section: str
    line: int
    row: Row


def campaigns(text: str) -> list[Campaign]:
    """Rows of all tables of campaigns, in their order."""
    found, section, inside = [], "", False
    for number, line in enumerate(text.splitlines()):
        if line.startswith("#"):
            section = line.lstrip("# ")
        inside = line.startswith("|") and (inside or line == CAMPAIGNS[0])
        if inside and line not in CAMPAIGNS:
            what, figure, command, commit, date = (cell.strip() for cell in line.strip().strip("|").split("|"))
            found.append(Campaign(section, number, Row(what, what, figure, command, commit, date)))
    return found


def campaign(text: str, begins: str) -> Campaign:
    """The row that begins so. Raises `SystemExit` if it is not one."""
    every = campaigns(text)
    mine = [one for one in every if one.row.what.startswith(begins)]
    if len(mine) != 1:
        known = "\n  ".join(one.row.what for one in mine or every)
        raise SystemExit(f"{len(mine)} rows begin with {begins!r}; name one of\n  {known}")
    return mine[0]


def stamped(text: str, one: Campaign, commit: str, date: str) -> str:
    """The document with this commit and date in a campaign's row."""
    lines = text.splitlines(keepends=True)
    kept = lines[one.line].rstrip().removesuffix("|").rsplit("|", 2)[0]
    lines[one.line] = f"{kept}| {commit} | {date} |\n"
    return "".join(lines)


def old_campaigns(text: str) -> list[str]:
    """What to say of campaigns that are older than their code."""
    paths = sections()
    said = []
    for one in campaigns(text):
        figure = Figure(one.row.what, one.row.what, one.row.command, paths[one.section])
        row = replace(one.row, commit=one.row.commit.removeprefix(BEFORE))
        if why := stale(figure, row, HERE).partition("; `make figure")[0]:
            said.append(why.replace("measured on", "measured on or before") if row != one.row else why)
    return said


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


def today(paths: Sequence[str]) -> tuple[str, str]:
    """The commit, with a + if these paths have changes that are not committed, and the date."""
    changed = "+" if git("status", "--porcelain", "--", *paths) else ""
    return git("rev-parse", "--short=8", "HEAD") + changed, datetime.now(UTC).date().isoformat()


def measured(figure: Figure) -> Row:
    commit, date = today(figure.paths)
    said = measure(figure)
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    busy = f" (load {load:.1f} on {cores} cores)" if load > cores and not figure.campaign else ""
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
    parser.add_argument("--all", action="store_true", help="with --stale: larger campaigns one by one")
    parser.add_argument("--campaigns", action="store_true", help="those campaigns that are older than their code")
    parser.add_argument("--stamp", metavar="TEXT", help="write commit and date of now to a larger campaign's row")
    asked = parser.parse_args()
    known = figures()
    if asked.stale:
        if not (HERE / ".git").exists():
            print("figures: no git here, so their age is not known")
            return
        larger = LARGER.read_text()
        standing, older = rows(DOCUMENT.read_text()), old_campaigns(larger)
        said = [one for figure in known.values() if (one := stale(figure, standing.get(figure.name)))]
        if older and not asked.all:
            count = f"{len(older)} of {len(campaigns(larger))} larger campaigns"
            older = [f"{count}: python -m benchmarks.figures --stale --all"]
        said += older
        print("\n".join(("measured figures older than their code (a notice):", *said)) if said else "", end="\n")
        return
    if asked.stamp:
        text = LARGER.read_text()
        mine = campaign(text, asked.stamp)
        LARGER.write_text(stamped(text, mine, *today(sections()[mine.section])))
        return
    strange = [name for name in asked.names if name not in known]
    if strange:
        parser.error(f"no figure {', '.join(strange)}; there are {', '.join(known)}")
    names = asked.names or [name for name, one in known.items() if one.campaign == asked.campaigns]
    for name in names:
        if asked.campaigns and not asked.names and not stale(known[name], rows(DOCUMENT.read_text()).get(name)):
            continue
        row = measured(known[name])
        text = DOCUMENT.read_text()
        DOCUMENT.write_text(written(text, rows(text) | {name: row}))
        print(row.line(), flush=True)


if __name__ == "__main__":
    main()
