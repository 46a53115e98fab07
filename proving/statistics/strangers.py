"""Worlds that nobody here wrote: a stranger's set of hidden causes, traced and scored (proving/strangers/README.md)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import proving.strangers
from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.strangers import runs
from proving.strangers.judge import judge_of
from proving.strangers.loops import KIND, one_loop
from proving.strangers.sets import load, opened
from proving.strangers.shares import alarms, classes
from rig.errors import UsageError

NEWEST = Path(proving.strangers.__file__).parent / "nineteenth"


def effects(set: str = "", judged: str = "", sizes: str = "1,2", left_out: int = 0) -> Study:  # noqa: A002 - the option's name
    """Every effect and pair of a set: what is said of it, and whether it is so.

    `--left_out 1` also asks for the error on rows left out, which takes most of the time.
    """
    folder, list_of_judge = _folder(set), Path(judged) if judged else None
    stranger = load(folder)
    judge = judge_of(stranger, list_of_judge)
    opened(stranger)  # before workers compare the sources, of which OPENED.txt is one
    cases, listed = {}, {}
    for kind in stranger.modules:
        for names in stranger.effects(kind):
            for size in _numbers(sizes):
                case = f"{kind}: {' + '.join(names)}, size {size:g}"
                cases[case] = partial(
                    runs.hidden,
                    folder=folder,
                    kind=kind,
                    effects=names,
                    size=size,
                    judged=list_of_judge,
                    left_out=bool(left_out),
                )
                listed[case] = [bool(one.right or one.near) for one in judge.of(kind, names)]

    def totals(found: Mapping[str, Results]) -> Mapping[str, Figures]:
        groups: dict[str, list[str]] = {"all": list(found)}
        groups |= {kind: [case for case in found if case.startswith(f"{kind}:")] for kind in stranger.modules}
        ends = [f"size {size:g}" for size in _numbers(sizes)]
        groups |= {end: [case for case in found if case.endswith(f", {end}")] for end in ends}
        groups["single effects"] = [case for case in found if len(listed[case]) == 1]
        groups["pairs"] = [case for case in found if len(listed[case]) > 1]
        groups["all in a catalogue"] = [case for case in found if all(listed[case])]
        groups["none in a catalogue"] = [case for case in found if not any(listed[case])]
        rows = {name: [one for case in those for one in found[case]] for name, those in groups.items()}
        when = {"the set": {"seal": stranger.seal, "opened": opened(stranger)}}
        return {**{name: classes(results) for name, results in rows.items() if results}, **when}

    return Study(cases, _runs, totals)


def nulls(set: str = "") -> Study:  # noqa: A002
    """Tables of a set with nothing hidden, by noise: in how many anything is named, or said to be there without one."""
    folder = _folder(set)
    stranger = load(folder)
    opened(stranger)
    cases = {
        f"{kind}, nothing hidden, {noise}": partial(runs.null, folder=folder, kind=kind, noise=noise)
        for kind in stranger.modules
        for noise in stranger.noises(kind)
    }

    def totals(found: Mapping[str, Results]) -> Mapping[str, Figures]:
        groups: dict[str, list[str]] = {"all": list(found)}
        groups |= {kind: [case for case in found if case.startswith(f"{kind},")] for kind in stranger.modules}
        for case in found:
            groups.setdefault(case.split(", ")[-1], []).append(case)
        rows = {name: [one for case in those for one in found[case]] for name, those in groups.items()}
        return {name: alarms(results) for name, results in rows.items() if results}

    return Study(cases, _alarms, totals)


def loops(set: str = "", size: float = 2.0) -> Study:  # noqa: A002
    """Loops on a bench with causes of a set, of so many standard deviations of a row: what is confirmed."""
    folder = _folder(set)
    stranger = load(folder)
    judge_of(stranger)
    names = [names[0] for names in stranger.effects(KIND) if len(names) == 1]
    return Study({name: partial(_loop, folder=folder, name=name, size=size) for name in names}, _said)


def _loop(seed: int, folder: Path, name: str, size: float) -> Result:
    return {"seed": seed, "said": one_loop(seed, folder, name, size)}


def _said(results: Results) -> Figures:
    return {f"seed {one['seed']}": one["said"] for one in results}


def _runs(results: Results) -> Figures:
    """Each run of a case in one line."""
    lines = {f"seed {one['seed']}": f"{one['class']}. {one['line']}" for one in results}
    return {"hidden": results[0]["about"] if results else "", **lines}


def _alarms(results: Results) -> Figures:
    lines = {
        f"seed {one['seed']}": one["line"] for one in results if one["alarm"] or one["class"] in {"crash", "refused"}
    }
    return {**alarms(results), **lines}


def _folder(text: str) -> Path:
    return Path(text).resolve() if text else NEWEST


def _numbers(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise UsageError(f"--sizes {text}: numbers with commas between") from error


PARTS = {
    "effects": Part(effects, seeds=2, first=1),
    "nulls": Part(nulls, seeds=10, first=1),
    "loops": Part(loops, seeds=1, first=1),
}
