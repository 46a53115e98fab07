"""Values of files are taken as they are written: no "yes" for true, no "3" for 3, and one line says what is wrong."""

from __future__ import annotations

import re
import typing

import pytest
from dry import write_short
from pydantic import BaseModel

from rig.bench.bench_file import check_options
from rig.bench.config import BenchConfig, parse_bench, parse_procedure
from rig.bench.plugins import driver_class, installed
from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError
from rig.examples import example
from rig.files.explained import of_pattern
from rig.procedures.kinds import kinds
from rig.register import Register
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.verbs.certificate.settings import CertificateSettings

PROCEDURE = 'kind = "pitch-roll"\nname = "n"\nreplications = 2\n[design]\ntype = "T6"\n'
BENCH = example("attitude-lab") / "bench.toml"


def refused(text):
    with pytest.raises(ConfigurationError) as caught:
        parse_procedure(text, "night.toml")
    (line,) = str(caught.value).splitlines()
    return line


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('[warnings]\nhold = "yes"', "warnings.hold: should be true or false, without quotes (it is 'yes')"),
        ("[warnings]\nhold = 1", "warnings.hold: should be true or false, without quotes (it is 1)"),
        ("[measure]\nreadings = 4.0", "measure.readings: should be a whole number, without quotes or decimal point"),
        ('[measure]\nreadings = "4"', "measure.readings: should be a whole number"),
        ("[measure]\nreadings = true", "measure.readings: should be a whole number"),
        ('[settle]\ndwell_s = "2"', "settle.dwell_s: should be a number, without quotes (it is '2')"),
        ("[settle]\ndwell_s = true", "settle.dwell_s: should be a number"),
        ("[warnings]\nagainst = 3", "warnings.against: should be a text in quotes (it is 3)"),
        ("[faults]\nno_reply = 3", "faults.no_reply: should be a step or a list of steps, each in quotes"),
        ('[faults]\nno_reply = ["retry", 3]', "faults.no_reply: should be a step or a list of steps"),
        ("[faults]\nno_reply = { retry = 3 }", "faults.no_reply: should be a step or a list of steps"),
    ],
)
def test_a_value_of_another_kind_is_refused_in_one_line(more, says):
    assert refused(f"{PROCEDURE}{more}\n").startswith(f"night.toml: {says}")


def test_a_word_that_is_nearly_right_is_named():
    assert refused(PROCEDURE.replace('"T6"', '"T66"')).endswith("design.type: 'T66' is unknown; did you mean 'T6'?")


def test_a_whole_number_will_do_where_a_number_is_asked_for():
    assert parse_procedure(f"{PROCEDURE}[settle]\ndwell_s = 2\n", "night.toml").settle.dwell_s == 2.0


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            'name = "attitude-lab"',
            'name = "attitude-lab"\nsimulated = "no"',
            "bench.toml: simulated: should be true or",
        ),
        ("[limits]", "[limits]\npitch_degg = [true, 3]", "bench.toml: limits.pitch_degg.0: should be a number"),
    ],
)
def test_a_bench_file_is_taken_just_as_strictly(old, new, says):
    text = BENCH.read_text()
    assert old in text
    with pytest.raises(ConfigurationError, match=says):
        parse_bench(text.replace(old, new), "bench.toml")


def test_and_so_are_the_options_of_drivers():
    text = BENCH.read_text().replace("speed_deg_per_s = 5.0", 'speed_deg_per_s = "5.0"')
    with pytest.raises(ConfigurationError, match=r"instruments.head: speed_deg_per_s: should be a number"):
        check_options(parse_bench(text, "bench.toml"), "bench.toml")


def test_a_run_that_a_laxer_version_began_goes_on(tmp_path, monkeypatch):
    """Quotes that were taken for numbers and truths when the run began are in its file for good."""
    lax = BENCH.read_text().replace("nplc = 10", 'nplc = "10"')
    assert lax != BENCH.read_text()
    (tmp_path / "bench.toml").write_text(lax)
    with pytest.raises(ConfigurationError, match="nplc: should be"):
        load_plan(write_short(tmp_path), tmp_path / "bench.toml", dry=True)
    with monkeypatch.context() as earlier:
        earlier.setattr(BaseModel, "model_validate_json", _laxly)
        plan = load_plan(write_short(tmp_path), tmp_path / "bench.toml", dry=True)
        run = []
        start_run(plan, tmp_path, signals=Signals("SIGTERM"), announce=run.append, on_progress=lambda _: None)
    result = resume_run(run[0], signals=Signals(), on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE, result.message


_STRICTLY = BaseModel.model_validate_json.__func__


@classmethod
def _laxly(cls, text, **options):
    return _STRICTLY(cls, text, **{**options, "strict": False})


@pytest.mark.parametrize("limit", ["[-inf, inf]", "[0, inf]", "[nan, 5]"])
def test_a_limit_that_limits_nothing_is_refused(limit):
    with pytest.raises(ConfigurationError, match=r"limits\.pitch_deg"):
        parse_bench(re.sub(r"(?m)^pitch_deg = .*$", f"pitch_deg = {limit}", BENCH.read_text()), "bench.toml")


def _patterns(model, seen):
    """Patterns of all texts of a model and of the models inside it."""
    if model in seen:
        return
    seen.add(model)
    for field in model.model_fields.values():
        stack = [field.annotation]
        yield from (one.pattern for one in field.metadata if getattr(one, "pattern", None))
        while stack:
            one = stack.pop()
            stack += [*typing.get_args(one)]
            yield from (item.pattern for item in getattr(one, "metadata", ()) if getattr(item, "pattern", None))
            yield from (item.pattern for item in getattr(one, "__metadata__", ()) if getattr(item, "pattern", None))
            if isinstance(one, type) and issubclass(one, BaseModel):
                yield from _patterns(one, seen)


def test_no_message_is_a_regular_expression():
    models = [BenchConfig, Register, CertificateSettings, *(one.settings for one in kinds().values() if one.settings)]
    models += [driver_class(name).Options for name in installed("rig.drivers")]
    seen: set[type] = set()
    patterns = {pattern for model in models for pattern in _patterns(model, seen)}
    assert len(patterns) >= 7
    assert [pattern for pattern in patterns if "pattern" in of_pattern(pattern)] == []
    step = '[[by_hand]]\nbefore = 1\nsay = "weigh"\nchange = "weighed"\nvalue = "kN"\n'
    assert refused(f"{PROCEDURE}{step}") == (
        "night.toml: by_hand.0.value: should be a name and its unit, with an underscore between: force_kN (it is 'kN')"
    )


def test_what_is_on_a_bench_is_listed_once():
    """A factor in degC that a thermometer measures is a readback and a temperature."""
    text = (example("bath-lab") / "bench.toml").read_text()
    text = f'{text}\n[interlocks.none]\nwatch = "nothing"\nwithin = [0, 1]\n'
    with pytest.raises(ConfigurationError, match="on this bench there are") as caught:
        check_options(parse_bench(text, "bench.toml"), "bench.toml")
    names = str(caught.value).partition("there are ")[2].partition(";")[0].split(", ")
    assert len(names) == len(set(names))
