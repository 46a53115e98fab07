"""The frame of all campaigns that say how often what is said of data is so (proving/notes/campaigns.md)."""

from __future__ import annotations

import inspect
import json
import re
import shlex
import sys
from functools import partial
from pathlib import Path

import pytest
import toys

from proving.executor import Processes
from proving.frame import MODULES, Study, asked, main, parts_of, run
from proving.seeds import Place
from proving.statistics import gross_errors
from proving.statistics.gross_errors import CASES

FOLDER = Path(gross_errors.__file__).parent
ROOT = Path(__file__).parents[2]
SEEDS = range(4, 12)


def sums(results):
    return {"sum": sum(one["value"] for one in results), "of": len(results)}


def together(found):
    return {"all": sums([one for results in found.values() for one in results])}


TOY = Study({name: partial(toys.times, factor=factor) for name, factor in (("once", 1), ("thrice", 3))}, sums, together)


def test_every_module_is_a_campaign_that_can_be_asked_for():
    others = {"__init__", "told", "dry_runs", "confirm_any"}  # the last is a part of `confirm`
    of_data = {module.rpartition(".")[2] for module in MODULES.values() if module.startswith("proving.statistics.")}
    assert {path.stem for path in FOLDER.glob("*.py")} - others == of_data


@pytest.mark.parametrize("name", MODULES)
def test_help_of_every_campaign_names_its_options(name, capsys):
    with pytest.raises(SystemExit) as end:
        asked(name, ["--help"])
    assert end.value.code == 0
    assert f"python -m proving {name}" in capsys.readouterr().out


@pytest.mark.parametrize("name", MODULES)
def test_every_part_has_cases_that_workers_can_be_given_and_says_what_it_is(name, tmp_path):
    (tmp_path / "commands.toml").write_text("[one]\n")
    for part in parts_of(name).values():
        options = {"folder": str(tmp_path)} if "folder" in inspect.signature(part.study).parameters else {}
        study = part.study(**options)
        assert study.cases
        assert inspect.getdoc(part.study)
        for one in study.cases.values():
            assert isinstance(one, partial) or one.__module__ != "__main__"
            of_module = one.func if isinstance(one, partial) else one
            assert getattr(sys.modules[of_module.__module__], of_module.__qualname__) is of_module


@pytest.mark.parametrize("jobs", [1, 2])
def test_each_case_is_counted_over_its_seeds_with_one_digest_for_any_number_of_workers(jobs):
    told = run(TOY, "toy", SEEDS, Place(Processes(jobs)))
    assert told.rows == {
        "once": {"sum": sum(SEEDS), "of": len(SEEDS)},
        "thrice": {"sum": 3 * sum(SEEDS), "of": len(SEEDS)},
        "all": {"sum": 4 * sum(SEEDS), "of": 2 * len(SEEDS)},
    }
    assert told.digest == run(TOY, "another name", SEEDS, Place(Processes(1))).digest
    assert told.digest != run(TOY, "toy", range(4, 13), Place(Processes(1))).digest


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_case_that_has_enough_counts_no_more_seeds(jobs):
    study = Study(TOY.cases, sums, enough=lambda known: sum(one["value"] for one in known) >= 15)
    rows = run(study, "toy", SEEDS, Place(Processes(jobs))).rows
    assert rows == {"once": {"sum": 4 + 5 + 6, "of": 3}, "thrice": {"sum": 3 * (4 + 5), "of": 2}}


def told(capsys, *words):
    assert main([str(word) for word in words]) == 0
    return json.loads(capsys.readouterr().out)


def test_workers_and_a_ledger_change_no_figure(capsys, tmp_path):
    command = ("gross-errors", "--seeds", 24, "--only", "12 rows", "--json")
    alone = told(capsys, *command, "--jobs", 1)
    (case,) = (one for name, one in CASES.items() if "12 rows" in name)
    named = sum(any(found.rows.size for found in case(seed)) for seed in range(24))
    assert alone["rows"] == {"12 rows, 2 coefficients": {"named": named, "of": 24}}
    ledger = ("--ledger", tmp_path / "ledger")
    told(capsys, *command, "--seeds", 9, "--jobs", 1, *ledger)
    assert told(capsys, *command, "--jobs", 2, *ledger) == alone


def test_what_is_in_the_ledger_is_not_done_again(capsys, tmp_path, monkeypatch):
    ledger = ("--jobs", 1, "--ledger", tmp_path / "ledger", "--json")
    first = told(capsys, "gross-errors", "--seeds", 9, "--only", "12 rows", *ledger)

    def fails(seed: int, case: str):
        raise ZeroDivisionError(f"seed {seed} of {case}")

    monkeypatch.setattr(gross_errors, "_named", fails)
    with pytest.raises(ZeroDivisionError, match="seed 9 of 12 rows"):
        main([*map(str, ("gross-errors", "--seeds", 10, "--only", "12 rows", *ledger))])
    assert told(capsys, "gross-errors", "--seeds", 9, "--only", "12 rows", *ledger) == first


def test_figures_are_said_in_words(capsys):
    assert main(["gross-errors", "--seeds", "8", "--only", "12 rows", "--jobs", "1"]) == 0
    figures, digest = capsys.readouterr().out.splitlines()
    assert figures.startswith("12 rows, 2 coefficients: named ")
    assert figures.endswith(", of 8")
    assert len(digest.removeprefix("digest ")) == 64


COMMANDS = [
    shlex.split(command)
    for document in sorted([*ROOT.glob("docs/**/*.md"), *ROOT.glob("proving/notes/*.md")])
    for command in re.findall(r"`python -m proving ([^`]*)`", document.read_text(encoding="utf-8"))
]


def test_commands_in_the_documents_can_be_asked_for():
    """Those without a part name the campaign in the caption of a table whose rows have the parts."""
    whole = [command for command in COMMANDS if command[-1] != "..." and command != ["whole-plots"]]
    assert len(whole) > 20
    assert {name for name, *_ in COMMANDS} == set(MODULES)
    for name, *words in whole:
        asked(name, words)  # ends the program where there is no such option


def test_what_is_no_case_or_lacks_its_folder_is_refused(capsys):
    assert main(["gross-errors", "--only", "13 rows"]) == 2
    assert "no case is called so; there are: 12 rows" in capsys.readouterr().err
    assert main(["tables", "measured"]) == 2
    assert "--folder" in capsys.readouterr().err
    for words in (["gross-errors", "--seeds", "0"], ["gross-errors", "--jobs", "0"], ["nothing"]):
        with pytest.raises(SystemExit) as refused:
            main(words)
        assert refused.value.code == 2
