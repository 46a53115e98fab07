"""Outputs that are on when a run starts: said with their value, and with what became of them, before preparing."""

from __future__ import annotations

from pathlib import Path

import general_lab as lab
import pytest

from rig.engine.session import Outcome, Progress
from rig.run_file.events.bench import AsFound
from rig.run_file.read.reader import RunReader
from rig.sims.declared.lines import LinesTwin
from rig.watch.lines import Lines

BATH = """
maker = "ACME"
model = "B1"
[identity]
ask = "ID?"
answer = "{maker} {model}"
[source]
unit = "V"
low = -8
high = 8
set = "SP={value:.3}"
setpoint = "SP?"
read = "PV?"
safe_value = 0
tolerance = 0.001
dwell_s = 1
"""
BENCH = lab.SOURCE[lab.SOURCE.index("[instruments.dvm]") :]
BENCH = 'name = "volts"\n[instruments.bath]\ndriver = "./bath.toml"\naddress = "/dev/rig/bath"\n' + BENCH
BENCH = BENCH.replace('"calibrator"', '"bath"')


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (7.5, "input was found on at 7.5 V, with a setpoint of 7.5; it was left so"),
        (
            0.25,
            "input was found on at 0.25 V, with a setpoint of 7.5; its setpoint was made 0.25, so that it stops there",
        ),
    ],
)
def test_a_source_that_is_on_is_told_with_its_value_and_what_was_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: float, said: str
) -> None:
    """Somebody had switched it on. One that was still changing was stopped where it was, and no page said so."""
    before = LinesTwin.answers

    def found(self: LinesTwin, place: str, *rest: object) -> object:
        told = before(self, place, *rest)  # type: ignore[arg-type]
        if not any(line.startswith("SP=") for line in heard):
            now = {"source.setpoint": 7.5, "source.read": value}
            told = told._replace(value=now.get(place, told.value))
        return told

    def hears(self: LinesTwin, line: str, carried_out=LinesTwin._carried_out) -> object:  # type: ignore[no-untyped-def]
        heard.append(line)
        return carried_out(self, line)

    heard: list[str] = []
    monkeypatch.setattr(LinesTwin, "answers", found)
    monkeypatch.setattr(LinesTwin, "_carried_out", hears)
    (tmp_path / "bath.toml").write_text(BATH)
    told: list[Progress] = []
    path, result = lab.run_dry(tmp_path, lab.SOURCE_PROCEDURE, BENCH, lab.SOURCE_WORLD, on_progress=told.append)
    assert result.outcome is Outcome.COMPLETE, result.message
    with RunReader.open(path) as run:
        records = list(run.records())
    (event,) = [one.event for one in records if isinstance(one.event, AsFound)]
    assert event.outputs == [said]
    first = next(line for line in heard if line.startswith("SP="))
    assert (first == "SP=0.250") == (value == 0.25)
    assert any(news.message == said for news in told)
    assert told[-1].message == ""
    page = Lines()
    for number, record in enumerate(records):
        page.add(number, record)
    assert any(line["words"].startswith(f"the bench was read as found; {said}") for line in page.lines)


def test_a_chamber_that_runs_is_told_too() -> None:
    state = {"oven": {"setpoint_degC": 60.0, "temperature_degC": 58.25, "running": True}}
    said = "oven was found on at 58.25 degC, with a setpoint of 60; it was left so"
    assert AsFound(chambers=state).outputs == [said]
    state["oven"]["running"] = False
    assert AsFound(chambers=state).outputs == []
