"""The one command of campaigns of seeds: what is asked, who works it out, what is printed of it."""

from __future__ import annotations

import argparse
import inspect
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from proving.ledger import Result
from proving.seeds import Campaign, Digest, Place
from rig.cli.progress import counting
from rig.cli.show import err, out, print_json
from rig.errors import RigError, UsageError

Figures = dict[str, Any]
"""What is counted, by name, made of what JSON has."""
Results = Sequence[Result]

_OF_DATA = (
    "attitude", "budgets", "charts", "closed_loop", "confirm", "cover", "coverage_effects", "coverage_sides", "curves",
    "early_warnings", "forecasts", "fractions", "gross_errors", "inference", "intervals", "laboratories", "laws",
    "planted_errors", "pressure", "registers", "split_plots", "strangers", "tables", "tables_power", "whole_plots",
)  # fmt: skip
MODULES = {
    **{name.replace("_", "-"): f"proving.statistics.{name}" for name in _OF_DATA},
    "certificates": "proving.certificates.runs",
    "crashes": "proving.crashes.campaigns",
    "goals": "proving.goals",
    "loops": "proving.loops",
}
"""Campaigns: each is a module with its `PARTS`."""


@dataclass(frozen=True)
class Study:
    """Cases that are done with the same seeds, and what is counted in each.

    Attributes:
        cases: what is done with a seed, by name; a function of a module, or a `partial` of one.
        figures: of a case's results, in order of their seeds.
        totals: further rows of figures, from the results of all cases.
        enough: whether a case needs no more seeds.
        fails: whether figures, by case, are those of a failure.
        block: seeds that are worked through together.

    """

    cases: Mapping[str, Callable[[int], Result]]
    figures: Callable[[Results], Figures]
    totals: Callable[[Mapping[str, Results]], Mapping[str, Figures]] | None = None
    enough: Callable[[Results], bool] | None = None
    fails: Callable[[Mapping[str, Figures]], bool] = lambda _: False
    block: int = 1


@dataclass(frozen=True)
class Part:
    """What can be asked for by one command.

    Attributes:
        study: made of the command's own options: its parameters, which have defaults.
        seeds: how many, where nobody says.
        first: of them.

    """

    study: Callable[..., Study]
    seeds: int = 20
    first: int = 0


@dataclass(frozen=True)
class Told:
    """What became of a study.

    Attributes:
        rows: figures, by case, and the totals.
        digest: of all results, in order.
        failed: whether figures are those of a failure.

    """

    rows: Mapping[str, Figures]
    digest: str
    failed: bool = False


def pooled(figures: Callable[[Results], Figures]) -> Callable[[Mapping[str, Results]], Mapping[str, Figures]]:
    """A total: figures of all cases' results as if they were one's."""
    return lambda found: {"all": figures([one for results in found.values() for one in results])}


def run(study: Study, name: str, seeds: range, place: Place) -> Told:
    """Work through all cases of a study.

    A case and a seed have one number between them, so that many cases with few seeds keep as many workers busy as one
    case with many.

    Args:
        study: which.
        name: with everything that its results depend on.
        seeds: of each case; consecutive.
        place: where to.

    """
    names, count = list(study.cases), len(study.cases)
    campaign = Campaign(partial(_one, cases=tuple(study.cases.values())), name, study.block)
    numbers = range(seeds.start * count, seeds.stop * count)
    # Where cases may have enough, one after the other: none is worked out further for another's sake.
    parts = [numbers] if study.enough is None else [numbers[at::count] for at in range(count)]
    found: dict[str, list[Result]] = {case: [] for case in names}
    digest = Digest()
    with counting(name.partition(" {")[0], len(numbers)) as one_more:
        for part in parts:
            with closing(place.results(campaign, part)) as results:
                for number, result in results:
                    case = names[number % count]
                    found[case].append(result)
                    digest.add(number, result)
                    one_more(case)
                    if study.enough is not None and study.enough(found[case]):
                        break
    rows = {case: study.figures(known) for case, known in found.items()}
    totals = {} if study.totals is None else study.totals(found)
    return Told({**rows, **totals}, str(digest), study.fails(rows))


def _one(number: int, cases: Sequence[Callable[[int], Result]]) -> Result:
    return cases[number % len(cases)](number // len(cases))


def main(words: Sequence[str]) -> int:
    """As the command line says; 1 if the campaign has found a failure."""
    parser = argparse.ArgumentParser(prog="python -m proving", description=__doc__)
    parser.add_argument("campaign", choices=MODULES)
    campaign = parser.parse_args(words[:1]).campaign
    given = asked(campaign, words[1:])
    part = parts_of(campaign)[given.part]
    options = {name: getattr(given, name) for name in inspect.signature(part.study).parameters}
    try:
        study = _only(part.study(**options), given.only)
        told_by = json.dumps({**options, "only": given.only}, sort_keys=True)
        name = " ".join(filter(None, (campaign, given.part, told_by)))
        with Place.open(given.jobs, given.scheduler, given.ledger) as place:
            told = run(study, name, range(given.first, given.first + given.seeds), place)
    except RigError as error:
        err.print(str(error), soft_wrap=True, markup=False)
        return int(error.exit_code)
    if given.json:
        print_json({"digest": told.digest, "rows": told.rows})
        return int(told.failed)
    for row, figures in told.rows.items():
        line = f"{row}: {said(figures)}"
        for text in [line] if len(line) <= _WIDE else [row, *(f"  {name}: {said(figures[name])}" for name in figures)]:
            out.print(text, soft_wrap=True, markup=False, highlight=False)
    out.print(f"digest {told.digest}", soft_wrap=True, highlight=False)
    return int(told.failed)


_WIDE = 140


def parts_of(campaign: str) -> Mapping[str, Part]:
    """Parts of a campaign, by name; "" where there is one."""
    parts: Mapping[str, Part] = import_module(MODULES[campaign]).PARTS
    return parts


def _only(study: Study, words: str) -> Study:
    """The cases that have these words in their names."""
    cases = {name: one for name, one in study.cases.items() if words in name}
    if not cases:
        raise UsageError(f"--only {words}: no case is called so; there are: {'; '.join(study.cases)}")
    return replace(study, cases=cases)


def asked(campaign: str, words: Sequence[str]) -> argparse.Namespace:
    """Options of a campaign; argparse ends the program where they are none."""
    parts = parts_of(campaign)
    about = import_module(MODULES[campaign]).__doc__
    shape = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog=f"python -m proving {campaign}", description=about, formatter_class=shape)
    if "" in parts:
        parser.set_defaults(part="")
        _options(parser, parts[""])
        return parser.parse_args(words)
    below = parser.add_subparsers(dest="part", required=True)
    for name, part in parts.items():
        text = (inspect.getdoc(part.study) or "").replace("%", "%%")  # argparse takes it for a format
        _options(below.add_parser(name, help=text, description=text), part)
    return parser.parse_args(words)


def _options(parser: argparse.ArgumentParser, part: Part) -> None:
    for name, parameter in inspect.signature(part.study).parameters.items():
        kind = type(parameter.default)
        parser.add_argument(
            f"--{name}", type=kind, default=parameter.default, help=f"default: {parameter.default}".replace("%", "%%")
        )
    parser.add_argument("--seeds", type=_from(1), default=part.seeds, help=f"of each case; default: {part.seeds}")
    parser.add_argument("--first", type=_from(0), default=part.first, help=f"the first seed; default: {part.first}")
    parser.add_argument("--only", default="", help="part of a case's name")
    parser.add_argument("--jobs", type=_from(1), default=os.cpu_count() or 1, help="processes of this machine")
    parser.add_argument("--scheduler", help="a Dask cluster instead: its scheduler's address, tcp://host:8786")
    parser.add_argument("--ledger", type=Path, help="keep results in this file, and go on with what is in it")
    parser.add_argument("--json", action="store_true", help="figures and digest as JSON")


def _from(least: int) -> Callable[[str], int]:
    def number(word: str) -> int:
        if int(word) < least:
            raise argparse.ArgumentTypeError(f"{word}: less than {least}")
        return int(word)

    return number


def said(value: Any) -> str:
    """Figures in words."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {said(one)}" if str(name) else said(one) for name, one in value.items()) or "none"
    if isinstance(value, list):
        return f"[{', '.join(map(said, value))}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
