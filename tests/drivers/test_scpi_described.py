"""Meters and sources that the bench file describes: what the file may say, and what is sent."""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import Any

import pytest
from pydantic import ValidationError

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from rig.drivers.roles import OVERLOAD
from rig.drivers.scpi_described import table_of
from rig.drivers.scpi_meter import DescribedMeter
from rig.drivers.scpi_source import DescribedSource
from rig.drivers.wires import Wires
from rig.instruments.opening import open_bench
from rig.simulated.dry_run import DryBench

METER: dict[str, Any] = {
    "driver": "scpi-meter",
    "address": "visa://GPIB0::22::INSTR",
    "model": "M1",
    "reading_s": 0.1,
    "prepare": ["CONF:VOLT:DC 10", "VOLT:NPLC 5"],
    "check": {"VOLT:NPLC?": 5},
    "start": "SAMP:COUN {count};:INIT",
    "fetch": "FETC?",
    "abort": "ABOR",
}
SOURCE: dict[str, Any] = {
    "driver": "scpi-source",
    "address": "visa://GPIB0::24::INSTR",
    "model": "S1",
    "low": -10,
    "high": 10,
    "set": "VOLT {value}",
    "setpoint": "VOLT?",
    "read": "MEAS:VOLT?",
    "on": "OUTP ON",
    "off": "OUTP OFF",
    "output": "OUTP?",
    "tolerance": 0.01,
    "dwell_s": 2,
}


class Bench:
    """One instrument and its twin, in virtual time."""

    def __init__(self, table: dict[str, Any]) -> None:
        self.sent: list[str] = []
        factor = '[factors]\nvolts_V = "it"\n' if "source" in table["driver"] else ""
        text = f'name = "lab"\n[instruments.it]\n{toml(table)}\n[instruments.dvm]\n{toml(METER)}\n{factor}[sensors.x]\n'
        text += 'axis = "x"\nreader = "it"\n' if not factor else 'axis = "x"\nreader = "dvm"\n'
        config = parse_bench(text, "bench.toml")
        self.dry = DryBench(config, {}, tap=self._tap)
        options = check_options(self.dry.config, "bench")
        self.it: Any = open_bench(self.dry.config, options, self.dry.world, self.dry.wires).instruments["it"]
        self.twin = self.dry.sim.twin("it")

    def _tap(self, name: str, direction: str, data: bytes) -> None:
        if direction == "tx" and name == "it":
            self.sent += data.decode().splitlines()


def toml(table: dict[str, Any]) -> str:
    def value(one: Any) -> str:
        if isinstance(one, dict):
            return "{" + ", ".join(f"{value(k)} = {value(v)}" for k, v in one.items()) + "}"
        if isinstance(one, list):
            return f"[{', '.join(map(value, one))}]"
        return str(one).lower() if isinstance(one, bool) else repr(one)

    return "\n".join(f"{key} = {value(one)}" for key, one in table.items())


@pytest.fixture
def bench():
    made = []

    def make(table: dict[str, Any], **other: Any) -> Bench:
        made.append(Bench({key: one for key, one in (table | other).items() if one is not None}))
        return made[-1]

    yield make
    for one in made:
        one.dry.close()


@pytest.mark.parametrize("table", [METER, SOURCE])
@pytest.mark.parametrize("wrong", [{"model": "M2"}, {"model": None, "identity": "STRANGER,.*"}])
def test_a_stranger_is_asked_who_it_is_and_nothing_else(bench, table, wrong):
    it = bench(table)
    driver = getattr(it.it, "_guarded", it.it)
    driver._options = driver._options.model_copy(update={"model": "", "identity": ""} | wrong)
    driver.table = table_of(driver._options, driver._roles())
    with pytest.raises(WrongInstrument, match=r"it at .* should be a (M2|STRANGER,\.\*); it answers 'SIMULATED,"):
        it.it.identify()
    assert [line for line in it.sent if line != "\x03"] == ["*IDN?"]


@pytest.mark.parametrize("table", [METER, SOURCE])
def test_after_every_command_its_errors_are_read(bench, table):
    it = bench(table)
    it.it.identify()
    it.it.prepare()
    if table is SOURCE:
        it.it.set(3.0)
        it.it.make_safe()
    commands = [at for at, line in enumerate(it.sent) if "?" not in line and line != "\x03"]
    assert len(commands) > 2
    assert all(it.sent[at + 1] == "SYST:ERR?" for at in commands)


def test_a_line_that_the_instrument_refuses_is_named(bench):
    it = bench(METER)
    it.twin._prepare = [("CONF:VOLT:DC", "10")]
    with pytest.raises(InstrumentError, match=r"after 'VOLT:NPLC 5', reports error -113: Undefined header"):
        it.it.prepare()


def test_a_setting_that_reads_back_otherwise_is_refused(bench):
    it = bench(METER, check={"VOLT:NPLC?": 10})
    with pytest.raises(BadReply, match=r"VOLT:NPLC\? answers 5, not 10.0, after it was prepared"):
        it.it.prepare()


def test_a_setting_may_be_lost_and_that_is_how_a_restart_is_known_without_a_mark(bench):
    it = bench(METER, mark=False)
    it.it.prepare()
    assert not it.it.restarted()
    it.twin.power_cycle()
    assert it.it.restarted()
    assert not any("*ESE" in line for line in it.sent)


def test_readings_of_another_measurement_are_refused(bench):
    it = bench(METER)
    it.it.prepare()
    it.it.start(2)
    it.it._mark = 7
    with pytest.raises(BadReply, match="mark 7: these are other readings"):
        it.it.fetch()


def test_a_meter_that_takes_one_command_at_a_time(bench):
    it = bench(METER, start=None, abort=None, fetch="READ?", numbered=False)
    it.it.prepare()
    it.it.start(3)
    assert len(it.it.fetch()["input"]) == 3
    assert it.sent[-4:] == ["READ?"] * 3 + ["SYST:ERR?"]


def test_an_overload_in_the_words_of_the_instrument(bench):
    it = bench(METER, overload=0.1)
    it.it.prepare()
    it.it.start(1)
    assert it.it.fetch() == {"input": [OVERLOAD]}


def test_a_reading_that_is_taken_by_its_question(bench):
    it = bench(METER, start=None, abort=None, fetch="READ?")
    it.it.prepare()
    assert it.it.start(3) == 0.0
    began = it.dry.world.now()
    assert len(set(it.it.fetch()["input"])) == 3
    assert it.dry.world.now() - began > 0.3
    assert it.sent[-3:] == ["*SRE 3", "READ?;*SRE?", "SYST:ERR?"]
    with pytest.raises(NotReady):
        it.it.fetch()
    with pytest.raises(LimitError):
        it.it.start(0)


def test_numbers_may_have_something_around_them(bench):
    it = bench(SOURCE, number="{number},V,*", set="OUT {value} V", setpoint="OUT?", read=None, tolerance=None)
    it.it.prepare()
    it.it.set(1.5)
    assert it.it.read().setpoint == 1.5
    assert "OUT 1.500000 V" in it.sent


def test_a_source_settles_by_its_reading_for_a_time(bench):
    it = bench(SOURCE)
    it.it.prepare()
    it.it.set(8.0)
    early = it.it.read()
    assert (early.settled, early.output) == (False, True)
    assert abs(early.value - 8.0) > 0.01
    found = []
    for _ in range(60):
        it.dry.world.sleep(0.5)
        found.append(it.it.read())
    near = next(n for n, state in enumerate(found) if abs(state.value - 8.0) <= 0.01)
    settled = next(n for n, state in enumerate(found) if state.settled)
    assert settled - near == 4  # two seconds


@pytest.mark.parametrize(
    "how",
    [
        {"settled": "STAT:OPER:COND?", "settled_bit": 4, "tolerance": None},
        {"read": None, "tolerance": None, "dwell_s": 5},
    ],
)
def test_a_source_settles_by_its_own_word_or_by_time(bench, how):
    it = bench(SOURCE, **how)
    it.it.prepare()
    it.it.set(8.0)
    assert not it.it.read().settled
    it.dry.world.sleep(60.0)
    assert it.it.read().settled
    it.it.make_safe()
    assert not it.it.read().settled


def test_a_source_whose_setpoint_reads_back_otherwise_is_switched_off(bench):
    it = bench(SOURCE)
    it.it.prepare()
    it.it.set(1.0)
    it.twin.it._set = lambda value: setattr(it.twin.it, "_setpoint", 9.0)
    with pytest.raises(BadReply, match=r"VOLT\? should answer 2 and answers 9"):
        it.it.set(2.0)
    assert not it.twin.quantity.on


def test_a_source_that_was_off_is_not_switched_on_before_it_is_prepared(bench):
    it = bench(SOURCE)
    it.it.prepare()
    it.twin.power_cycle()
    it.sent.clear()
    with pytest.raises(NotReady, match="has been switched off since it was prepared"):
        it.it.set(1.0)
    assert it.sent == ["*ESE?"]


def test_a_source_without_switch_goes_to_its_safe_value(bench):
    it = bench(SOURCE, on=None, off=None, output=None, safe_value=0)
    it.it.prepare()
    it.it.set(5.0)
    assert not it.it.read().safe
    it.it.make_safe()
    assert (it.it.read().setpoint, it.it.read().safe) == (0.0, True)


def test_what_is_not_healthy_is_a_fault(bench):
    it = bench(SOURCE, healthy={"STAT:PROT?": 0})
    it.it.prepare()
    assert it.it.read().faults == ()
    it.twin._healthy["STAT:PROT?"] = "1"
    assert it.it.read().faults == ("STAT:PROT? answers 1, not 0.0",)


def test_lines_keep_their_distance(bench):
    it = bench(SOURCE, pace_s=0.5)
    began = it.dry.world.now()
    it.it.prepare()
    assert it.dry.world.now() - began >= 0.5 * (len(it.sent) - 1)


@pytest.mark.parametrize(
    ("cls", "table", "says"),
    [
        (DescribedMeter, {"model": None}, "give model, or identity"),
        (DescribedMeter, {"identity": ".*"}, "give model, or identity"),
        (DescribedMeter, {"model": None, "identity": "("}, "is not a regular expression"),
        (DescribedMeter, {"start": "INIT"}, r"needs the placeholder \{count\} once"),
        (DescribedMeter, {"fetch": "FETC"}, "is not a question"),
        (DescribedMeter, {"prepare": ["*IDN?"]}, "is a question; this is for commands"),
        (DescribedMeter, {"prepare": ["A\nB"]}, "one line of 1 to 200 printable"),
        (DescribedMeter, {"number": "x"}, r"needs the placeholder \{number\} once"),
        (DescribedMeter, {"mark": False, "check": None}, "without mark, check is needed"),
        (DescribedSource, {"low": 10}, "low = 10 has to be below high = 10"),
        (DescribedSource, {"high": float("inf")}, "both finite"),
        (DescribedSource, {"off": None}, "on, off and output belong together; here is only on and output"),
        (DescribedSource, {"on": None, "off": None, "output": None}, "its safe state is missing"),
        (DescribedSource, {"safe_value": 11}, "safe_value = 11 is outside -10 to 10"),
        (DescribedSource, {"read": None}, "tolerance needs read"),
        (DescribedSource, {"prepare": ["*RST"]}, r"prepare must not contain \*RST"),
        (DescribedSource, {"set": "VOLT {value} {value}"}, r"needs the placeholder \{value\} once"),
        (DescribedSource, {"decimals": 3}, "setpoints would be rounded further than it allows"),
    ],
)
def test_a_description_that_cannot_be_meant_is_refused(cls, table, says):
    given = (METER if cls is DescribedMeter else SOURCE) | table
    options = {key: one for key, one in given.items() if one is not None and key not in ("driver", "address")}
    with pytest.raises(ValidationError, match=says):
        cls.Options.model_validate(options)


class TestMock:
    """pyvisa-sim's own devices: a source of others, with an error queue and without *ESE."""

    @pytest.fixture
    def source(self, monkeypatch):
        monkeypatch.setenv("PYVISA_LIBRARY", "@sim")
        table = {"maker": "SCPI", "model": "MOCK", "low": 1.0, "high": 8.0, "mark": False, "safe_value": 1.0}
        table |= {"set": ":VOLT:IMM:AMPL {value}", "decimals": 3, "readback": 1e-3, "setpoint": ":VOLT:IMM:AMPL?"}
        table |= {"error": ":SYST:ERR?", "check": {"*IDN?": "SCPI,MOCK,VERSION_1.0"}, "dwell_s": 0.0}
        clock, wires = RealClock(), None
        wires = Wires(clock)
        yield DescribedSource(
            "mock", "visa://GPIB0::4::INSTR", DescribedSource.Options.model_validate(table), wires, clock
        )
        wires.close()

    def test_it_is_set_and_made_safe(self, source):
        assert asdict(source.identify()) == {
            "maker": "SCPI", "model": "MOCK", "serial": "VERSION_1.0", "firmware": ""
        }  # fmt: skip
        source.prepare()
        source.set(2.345)
        state = source.read()
        assert (state.setpoint, state.settled, state.output, state.safe) == (2.345, True, True, False)
        source.make_safe()
        assert source.read().safe

    def test_its_error_is_told(self, source):
        source.prepare()
        with pytest.raises(InstrumentError, match=re.escape("after ':VOLT:IMM:AMPL 7.000', reports error 1: Command")):
            source.set(7.0)  # its own limit is 6
