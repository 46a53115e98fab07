"""`rig explain`: generated references cover everything that the program knows."""

from __future__ import annotations

import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
from command import rig

from rig.bench.config import BenchConfig
from rig.bench.plugins import declared, driver_class, drivers
from rig.cli.commands import COMMANDS, loaded
from rig.contracts.declared.instrument import Instrument
from rig.engine.states import TRANSITIONS, State
from rig.errors import ExitCode, UsageError
from rig.explain import TOPICS, explained
from rig.lab import People
from rig.procedures.attitude.effects.catalogue import CATALOGUE
from rig.procedures.general.effects import TABLE_CATALOGUE
from rig.procedures.general.models import standard_models
from rig.procedures.kinds import kinds
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.register import Register
from rig.sims.faults import COMMON
from rig.sims.physics.pressure_truth import TransducerTruth
from rig.sims.physics.truth import SensorTruth, Truth
from rig.sims.physics.undeclared import HeadError
from rig.verbs.certificate.settings import CertificateSettings


def keys_of_model(model: Any) -> set[str]:
    """Names of a model and of its inner models."""
    found = set(model.model_fields)
    for field in model.model_fields.values():
        for one in (field.annotation, *getattr(field.annotation, "__args__", ())):
            if hasattr(one, "model_fields"):
                found |= keys_of_model(one)
    return found


def keys_of_tables(table: Any) -> set[str]:
    found = set()
    for field in fields(table):
        value = getattr(table, field.name)
        found |= {field.name} | (keys_of_tables(value) if is_dataclass(value) else set())
    return found


def options(command: str) -> list[str]:
    """Options that a command's help shows, but for --help."""
    shown = (one for one in loaded(command).params if one.param_type_name == "option" and not one.hidden)
    return [text for one in shown if one.name != "help" for text in one.opts]


ROOT = Path(__file__).parents[2]
SETTINGS = [kind.settings for kind in kinds().values() if kind.settings is not None]
WANTED = {
    "commands": {f"`rig {name}" for name in COMMANDS} | {option for name in COMMANDS for option in options(name)},
    "exit-codes": {f"| {code.value} |" for code in ExitCode},
    "bench": keys_of_model(BenchConfig),
    "equipment": keys_of_model(Register),
    "certificate": keys_of_model(CertificateSettings),
    "people": keys_of_model(People),
    "procedure": set().union(*(keys_of_model(one) for one in SETTINGS)) | {f'kind = "{name}"' for name in kinds()},
    "instruments": {key for name in drivers() for key in (name, *driver_class(name).Options.model_fields)},
    "instrument-file": {name.removesuffix("_") for name in keys_of_model(Instrument)},
    "declared": {f"## `{name}`" for name in declared()},
    "world": set().union(*map(keys_of_tables, (Truth(), SensorTruth(), TransducerTruth(), HeadError()))),
    "faults": {kind.name for kind in COMMON} | {key for kind in COMMON for key in kind.options},
    "effects": {
        f"`{effect.name}`" for effects in (CATALOGUE, PRESSURE_CATALOGUE, TABLE_CATALOGUE) for effect in effects
    },
    "models": {name for name in standard_models() if not re.fullmatch(r"thermocouple-.*-\d", name)},
    "states": {*State, *(transition.trigger for transition in TRANSITIONS)},
}


@pytest.mark.parametrize("topic", TOPICS)
def test_a_reference_has_everything(topic):
    text = explained(topic)
    assert {name for name in WANTED[topic] if name not in text} == set()


def test_a_topic_and_a_name_give_a_part():
    assert explained("bench", "interlocks").startswith("### `[interlocks.NAME]`")
    assert "follows_s" in explained("bench", "follows_s")
    assert explained("bench", "follows_s").count("\n| `") == 1
    assert explained("instruments", "person").count("\n## ") == 0
    assert len(re.findall(r"(?m)^\| `creep`", explained("effects", "creep"))) == 3


@pytest.mark.parametrize(("topic", "name", "word"), [("benches", "", "topics are commands"), ("bench", "xyz", "'xyz'")])
def test_what_is_not_there_is_refused(topic, name, word):
    with pytest.raises(UsageError, match=word):
        explained(topic, name)


def test_it_is_printed_as_markdown_that_names_pages():
    listed = rig("explain")
    assert re.findall(r"rig explain ([\w-]+)", listed.stdout) == list(TOPICS)
    done = rig("explain", "bench")
    assert done.returncode == 0, done.stderr
    assert "register of equipment (`docs/how_to/register.md`)" in done.stdout
    assert "](" not in done.stdout
    assert {page for page in re.findall(r"docs/[\w/]+\.md", done.stdout) if not (ROOT / page).is_file()} == set()
    assert rig("explain", "nothing").returncode == ExitCode.USAGE


def test_every_key_of_a_bench_has_a_meaning():
    assert [line for line in explained("bench").splitlines() if line.endswith("|  |")] == []
