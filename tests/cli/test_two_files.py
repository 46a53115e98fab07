"""Mistakes of a person who writes the two files of a general laboratory: one message with the place and the way out."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import rig
from general_lab import BENCH, PROCEDURE, REFERENCE, WORLD, run_dry, written

from rig.errors import ConfigurationError
from rig.runs.plans import load_plan

_THERMOMETER = """[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
channels = { "101" = "rtd-4w-385" }
[temperatures.room_degC]
reader = "scanner"
channel = "101"
place = "lab"
"""


def _refused(folder: Path, procedure: str = PROCEDURE, bench: str = BENCH) -> str:
    files = written(folder, procedure, bench, WORLD)
    with pytest.raises(ConfigurationError) as refused:
        load_plan(files[0], files[1], dry=True)
    assert sorted(folder.iterdir()) == sorted(files)
    return str(refused.value).replace(f"{folder}/", "")


@pytest.mark.parametrize(
    ("written", "instead", "said"),
    [
        ('"up-down"', "\u201cup-down\u201d", 'quotes are straight: "text"'),
        ("seed = 1", "; a remark\nseed = 1", "(at line 3, column 1): a remark begins with #"),
        ("dwell_s = 5", "dwell_s = 5,5", "the decimal sign is a point"),
        ("[0, 1, 2, 5]", "[0 1 2 5]", "commas separate the values of a list"),
        ('order = "up-down"', "hard = True", "write true or false"),
        ('order = "up-down"', "order = up-down", "a text has quotes"),
        ("[settle]", "[settle", "a section ends with ]"),
        ("[settle]", "[factors.force_kN]\n[settle]", "[factors.force_kN] is there already; put its keys together"),
        ("seed = 1", "seed: 1", "write NAME = VALUE"),
        ("[0, 1, 2, 5]", '"0..5"', "factors.force_kN.levels: should be a list in square brackets, such as [0, 10]"),
        ("[0, 1, 2, 5]", "[]", "factors.force_kN.levels: is empty"),
        ("[0, 1, 2, 5]", "[nan]", "factors.force_kN.levels.0: should be a finite number (it is nan)"),
        ("dwell_s = 5", "dwell_s = -5", "settle.dwell_s: should be greater than or equal to 0 (it is -5)"),
        ('"1 + force_kN"', '"a*force_kN"', "a is not a factor (force_kN)"),
        ('"1 + force_kN"', '"a*exp(force_kN)"', "parameters have start values, start = { a = 1 }"),
        ("[model]", "[acceptance]\nsigma_E = 0.1\n[model]", "should be a table, { NAME = VALUE } (it is 0.1)"),
        ('kind = "general"', "[instruments]", "procedure.toml is a bench file, because it has instruments"),
    ],
)
def test_a_mistake_in_the_procedure(tmp_path: Path, written: str, instead: str, said: str) -> None:
    assert written in PROCEDURE
    assert said in _refused(tmp_path, PROCEDURE.replace(written, instead, 1))


@pytest.mark.parametrize(
    ("written", "instead", "said"),
    [
        ('force_kN = "operator"\n', "", 'what sets a factor is said under [factors], force_kN = "INSTRUMENT"'),
        ("[0, 10]", "10", "limits.force_kN: should be a list in square brackets, such as [0, 10] (it is 10)"),
        ('"person"\n', '"person"\ndue = "31.05.2028"\n', "due: should be a date, such as 2028-05-31"),
        ('"/dev/rig/dvm"', '"\\\\.\\COM12"', "a text with backslashes has single quotes"),
        ('name = "a stand"', 'kind = "general"', "bench.toml is a procedure, because it has a kind"),
    ],
)
def test_a_mistake_in_the_bench(tmp_path: Path, written: str, instead: str, said: str) -> None:
    assert written in BENCH
    assert said in _refused(tmp_path, bench=BENCH.replace(written, instead, 1))


def test_a_model_of_a_temperature_that_nothing_reads_is_no_news_of_the_morning(tmp_path: Path) -> None:
    with_room = PROCEDURE.replace('"1 + force_kN"', '"1 + force_kN + room_degC"')
    said = _refused(tmp_path / "no", with_room)
    assert said.endswith("model.formula: nothing on the bench reads room_degC: it has no [temperatures]")
    other = BENCH + _THERMOMETER.replace("room_degC", "hall_degC")
    assert _refused(tmp_path / "other", with_room, other).endswith("room_degC: [temperatures] has hall_degC")
    files = written(tmp_path / "yes", with_room, BENCH + _THERMOMETER)
    assert load_plan(files[0], files[1], dry=True).run_list


def test_a_standard_model_of_other_units_is_refused_before_the_run(tmp_path: Path) -> None:
    procedure = PROCEDURE.replace('formula = "1 + force_kN"', 'standard = "callendar"')
    assert "model.standard = 'callendar': cell_V is in V, and this model needs ohm" in _refused(tmp_path, procedure)
    bath = procedure.replace("force_kN", "bath_psia"), BENCH.replace("force_kN", "bath_psia")
    assert "cell_V is in V" in _refused(tmp_path / "two", *bath)


def test_a_rehearsal_asks_nobody_for_anything(tmp_path: Path) -> None:
    from rig.runs.forecast import rehearse  # noqa: PLC0415

    files, told = written(tmp_path), []
    rehearse(load_plan(files[0], files[1]), told.append)
    assert {(news.state, news.message) for news in told} == {("rehearsing", "")}
    path, _ = run_dry(tmp_path / "run", on_progress=told.append)
    assert any("to do by hand" in news.message for news in told), path


def test_text_of_windows_says_how_to_save_it(tmp_path: Path) -> None:
    files = written(tmp_path)
    files[1].write_bytes(b"# at 23 \xb0C\n" + BENCH.encode())
    with pytest.raises(ConfigurationError, match=r"is not UTF-8 text .byte 8.; save it as UTF-8"):
        load_plan(files[0], files[1])
    files[1].write_bytes(b"\xef\xbb\xbf" + BENCH.replace("\n", "\r\n").encode())
    assert load_plan(files[0], files[1]).run_list


@pytest.mark.parametrize(
    ("off", "said"), [("0.3", "warning: 14 points are flagged reference; `rig status RUN` says why"), ("0", "")]
)
def test_a_reference_that_disagrees_at_every_point_is_said_when_the_run_ends(
    tmp_path: Path, off: str, said: str
) -> None:
    world = f'{WORLD}[references.force_kN]\nformula = "force_kN / 4 + {off}"\n'
    files = written(tmp_path, bench=BENCH + REFERENCE, world=world)
    done = rig("run", files[0], "--bench", files[1], "--dry", "--world", files[2], "--out", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if "flagged" in line] == ([said] if said else [])
