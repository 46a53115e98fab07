"""Figures of another commit and of today's code in turns, on the same machine.

    git worktree add --detach /tmp/other COMMIT
    .venv/bin/python -m benchmarks.in_turns /tmp/other [NAME ...] [--times 3]

NAME is a figure of benchmarks/figures.toml; all but `late-point` if none is named. Each command runs first in one tree,
then in the other, with the packages of this environment, and who is first changes with each turn. Medians are printed:
processor time of the command, peak memory, and the numbers of what it says where both trees say it in the same words. A
command that the other commit does not have is said.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.figures import HERE, LIMIT_S, Figure, figures, git, surroundings

_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\d)")
_TOO_LONG = frozenset({"late-point"})
_MEASURED = """
import resource, subprocess, sys
ended = subprocess.run(sys.argv[1:])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(f"measured {used.ru_utime + used.ru_stime} {used.ru_maxrss / 1024}", file=sys.stderr)
sys.exit(ended.returncode)
"""
"""Runs a command as its only child, so that the largest memory is that of this command."""


@dataclass(frozen=True)
class Turn:
    """One run of a command: processor time in s, peak memory in MB, and the numbers it said by their words."""

    processor_s: float
    peak_mb: float
    said: dict[str, float]


def numbers(text: str) -> dict[str, float]:
    """Numbers of a text by the words around them, with the numbers taken out; one that comes twice is counted."""
    found: dict[str, float] = {}
    for line in text.splitlines():
        words = " ".join(_NUMBER.sub("#", line).split())
        for place, number in enumerate(_NUMBER.findall(line), start=1):
            key = f"{words} [{place}]"
            while key in found:
                key += "'"
            found[key] = float(number)
    return found


def turn(figure: Figure, tree: Path) -> Turn | str:
    """Run a figure's command in a tree; what went wrong as a text."""
    argv = shlex.split(figure.command)
    argv = argv[1:] if argv[0] == "python" else ["-m", *argv]
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, sys.executable, *argv],
        cwd=tree,
        env=surroundings(PYTHONPATH=str(tree)),
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    said, _, used = done.stderr.rpartition("measured ")
    if done.returncode:
        return (said.strip().splitlines() or [f"ended with {done.returncode}"])[-1]
    quoted = [found[1] for pattern in figure.says if (found := re.search(pattern, done.stdout))]
    processor_s, peak_mb = map(float, used.split())
    return Turn(processor_s, peak_mb, numbers("\n".join(quoted)))


def compared(figure: Figure, other: Path, times: int) -> list[str]:
    """Lines about a figure: medians there and here, and their ratio."""
    turns: dict[Path, list[Turn]] = {other: [], HERE: []}
    if not figure.says:  # it is timed as a whole: without the compilation of its modules
        turn(figure, other), turn(figure, HERE)
    for time in range(times):
        for tree in (other, HERE) if time % 2 == 0 else (HERE, other):
            ran = turn(figure, tree)
            if isinstance(ran, str):
                return [f"{figure.name}: fails {'there' if tree == other else 'here'}: {ran}"]
            turns[tree].append(ran)

    def line(what: str, there: list[float], here: list[float]) -> str:
        before, after = median(there), median(here)
        ratio = f"{after / before:.2f}" if before else "-"
        return f"  {what}: {before:.4g} there, {after:.4g} here, ratio {ratio} ({_all(there)}; {_all(here)})"

    there, here = turns[other], turns[HERE]
    lines = [
        figure.name,
        line("processor time, s", [one.processor_s for one in there], [one.processor_s for one in here]),
        line("peak memory, MB", [one.peak_mb for one in there], [one.peak_mb for one in here]),
    ]
    both = [words for words in here[0].said if all(words in one.said for one in (*there, *here))]
    lines += [line(words, [one.said[words] for one in there], [one.said[words] for one in here]) for words in both]
    return lines


def _all(values: list[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("other", type=Path, help="folder of a checkout of the other commit")
    parser.add_argument("names", nargs="*", help="figures to compare")
    parser.add_argument("--times", type=int, default=3, help="turns of each (3)")
    asked = parser.parse_args()
    known = figures()
    strange = [name for name in asked.names if name not in known]
    if strange:
        parser.error(f"no figure {', '.join(strange)}; there are {', '.join(known)}")
    other = asked.other.resolve()
    if not (other / "benchmarks").is_dir():
        parser.error(f"{other} is no checkout of this project: it has no benchmarks")
    print(f"there: {git('rev-parse', '--short=8', 'HEAD', cwd=other)}, here: {git('rev-parse', '--short=8', 'HEAD')}")
    for name in asked.names or (one for one in known if one not in _TOO_LONG):
        print("\n".join(compared(known[name], other, asked.times)), f"\n  load {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
