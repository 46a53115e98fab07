"""Bridges: drivers of other libraries as instruments of a bench. The library is a stub that misbehaves on demand."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command import rig

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.contracts.declared.bridges import bridged
from rig.contracts.declared.instrument import parse
from rig.drivers.bridges import Value
from rig.drivers.bridges.line import BridgeLine
from rig.drivers.bridges.process import LibraryBridge
from rig.drivers.bridges.secop import SecopBridge
from rig.drivers.clock import RealClock
from rig.drivers.declared import driver_of
from rig.drivers.declared.bridged import resource
from rig.drivers.errors import BadReply, DriverError, InstrumentError, NoReply, Unreachable, WrongInstrument
from rig.drivers.wires import Wires
from rig.errors import ConfigurationError
from rig.instruments.locks import wire_of
from rig.instruments.opening import open_bench
from rig.runs.forecast import rehearse
from rig.runs.plans import plan_of
from rig.sims.world import World
from rig.simulated.dry_run import DryBench

STUB = """
import os, time
class Adapter:
    def close(self): print("closed")
class Instrument:
    def __init__(self, address, **arguments):
        if address == "ASRL/dev/nothing::INSTR":
            raise OSError("no such port")
        print("a library may print")
        self.address, self.arguments, self.adapter, self._level = address, arguments, Adapter(), 0.0
    id = "ACME,S1,SN7,1.0"
"""
SOURCE = """
import os, time
from pymeasure.instruments import Instrument
class Channel:
    voltage = property(lambda self: 2.5)
class Source(Instrument):
    ch_1 = Channel()
    table = {"a": 1.5}
    nothing = None
    nan = float("nan")
    text = "OVLD"
    on = False
    flags = property(lambda self: [1, 0])
    rounded = property(lambda self: self._level, lambda self, value: setattr(self, "_level", round(value)))
    level = property(lambda self: self._level, lambda self, value: setattr(self, "_level", value))
    reading = property(lambda self: self._level + 0.001)
    enabled = property(lambda self: self.on, lambda self, value: setattr(self, "on", bool(value)))
    def enable(self): self.on = True
    def disable(self): self.on = False
    @property
    def late(self): raise TimeoutError("it does not answer")
    @property
    def broken(self): raise ValueError("out of range")
    @property
    def hangs(self): time.sleep(60)
    @property
    def dies(self): os._exit(3)
"""


@pytest.fixture(scope="module")
def stub(tmp_path_factory) -> Iterator[Path]:
    """A package that calls itself pymeasure, before the real one."""
    folder = tmp_path_factory.mktemp("stub")
    package = folder / "pymeasure" / "instruments"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").touch()
    (package / "__init__.py").write_text(STUB)
    (package / "acme.py").write_text(SOURCE)
    (folder / "qcodes.py").write_text("raise ImportError('not here')")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PYTHONPATH", str(folder))
        yield package


@pytest.fixture(scope="module")
def library(stub) -> Iterator[LibraryBridge]:
    made = LibraryBridge(bridged("pymeasure:acme.Source"), "GPIB0::4::INSTR", {}, "source at GPIB", RealClock())
    yield made
    made.close()


def test_attributes_are_read_and_set(library):
    assert library.identity(10) == ("ACME", "S1", "SN7", "1.0")
    library.write("level", "1.25", 5)
    assert library.read("level", 5) == Value("1.25")
    assert library.read("ch_1.voltage", 5).text == "2.5"
    assert library.read("flags[0]", 5).text == "1"
    assert library.read("flags", 5).text == "1,0"
    library.call("enable()", 5)
    assert library.read("enabled", 5).text == "1"


@pytest.mark.parametrize(
    ("path", "error", "said"),
    [
        ("levle", InstrumentError, "did you mean level"),
        ("_level", InstrumentError, "private"),
        ("__import__('os')", InstrumentError, "private"),
        ("level + 1", InstrumentError, "more than attributes"),
        ("level)", InstrumentError, "is no attribute"),
        ("enable", InstrumentError, "is a method; write enable"),
        ("table", InstrumentError, "name one of them"),
        ("ch_1", InstrumentError, "neither a number nor a text"),
        ("late", NoReply, "does not answer"),
        ("broken", InstrumentError, "ValueError: out of range"),
    ],
)
def test_what_cannot_be_read_is_said(library, path, error, said):
    with pytest.raises(error, match=said):
        library.read(path, 5)
    assert library.read("text", 5).text == "OVLD"


@pytest.mark.parametrize(("path", "said"), [("levle", "did you mean level"), ("reading", "can only be read")])
def test_a_setting_that_python_would_invent_is_refused(library, path, said):
    """Python makes an attribute of any name; nothing would be sent."""
    with pytest.raises(InstrumentError, match=said):
        library.write(path, "1", 5)


def test_a_call_without_brackets_is_refused(library):
    with pytest.raises(InstrumentError, match=r"write enable\(\)"):
        library.call("enable", 5)


def test_a_library_that_hangs_is_ended(library):
    library.write("level", "1.25", 10)
    with pytest.raises(NoReply, match=r"did nothing for 0.2 s.*process was ended"):
        library.read("hangs", 0.2)
    assert library.read("level", 10).text == "0.0"  # another process, which has begun anew


def test_nothing_is_imported_from_where_rig_stands(stub, tmp_path, monkeypatch):
    (tmp_path / "queue.py").write_text("raise SystemExit(9)")
    monkeypatch.chdir(tmp_path)
    made = LibraryBridge(bridged("pymeasure:acme.Source"), "GPIB0::4::INSTR", {}, "source", RealClock())
    assert made.identity(10)[0] == "ACME"
    made.close()


def test_a_library_that_dies_is_reported(library):
    with pytest.raises(Unreachable, match="exit code 3"):
        library.read("dies", 10)


@pytest.mark.parametrize(
    ("driver", "address", "said"),
    [
        ("pymeasure:acme.Sorce", "GPIB0::4::INSTR", "no driver pymeasure.instruments.acme.Sorce"),
        ("pymeasure:os.path", "GPIB0::4::INSTR", "no driver"),
        ("pymeasure:acme.Source", "ASRL/dev/nothing::INSTR", "no such port"),
        ("qcodes:acme.Source", "GPIB0::4::INSTR", "pip install"),
    ],
)
def test_what_cannot_be_opened_is_said(stub, driver, address, said):
    made = LibraryBridge(bridged(driver), address, {}, "source", RealClock())
    with pytest.raises(Unreachable, match=said):
        made.identity(10)
    made.close()


TABLE = """
bridge = "pymeasure:acme.Source"
[source]
unit = "V"
low = -10
high = 10
set = "level"
setpoint = "level"
read = "reading"
on = "enable()"
off = "disable()"
output = "enabled"
tolerance = 0.01
dwell_s = 0
"""


def driver(text: str) -> Any:
    cls = driver_of(text)
    clock = RealClock()
    return cls("source", "visa://GPIB0::4::INSTR", cls.Options(), Wires(clock), clock)


def test_a_source_is_set_read_back_and_made_safe(stub):
    source = driver(TABLE)
    try:
        assert source.identify().serial == "SN7"
        source.prepare()
        source.set(2.5)
        state = source.read()
        assert (state.setpoint, state.value, state.output, state.settled) == (2.5, 2.501, True, True)
        source.make_safe()
        assert source.read().safe
        assert "does not say which instrument" in source.remarks()[0]
    finally:
        source.close()


def test_another_instrument_is_refused(stub):
    source = driver('maker = "ACME"\nmodel = "S2"' + TABLE)
    try:
        with pytest.raises(WrongInstrument, match="should be a ACME S2"):
            source.identify()
    finally:
        source.close()


def test_a_setting_that_a_library_rounds_is_noticed(stub):
    source = driver(TABLE.replace('"level"', '"rounded"'))
    try:
        with pytest.raises(BadReply, match=r"should answer 2\.5 and answers 2"):
            source.set(2.5)
    finally:
        source.close()


class Quantity:
    """A value with a unit, as a library gives it."""

    def __init__(self, unit: str) -> None:
        self._unit = unit

    def read(self, path: str, timeout_s: float) -> Value:
        return Value("1.5", self._unit)

    measures_when_asked = True


@pytest.mark.parametrize(("unit", "right"), [("V", True), ("", True), ("A", False), ("mV", False)])
def test_a_unit_that_a_library_says_has_to_be_the_declared_one(stub, unit, right):
    text = 'bridge = "pymeasure:acme.Source"\ncheck = [{ ask = "level", is = 1.5 }]\n'
    reader = driver(text + 'reader = { unit = "V", reading = "level" }')
    reader._talk.line._bridge = Quantity(unit)
    assert reader.wrong() == ()  # a setting may have any unit
    reader.start(1)
    if right:
        assert reader.fetch() == {"input": [1.5]}
    else:
        with pytest.raises(BadReply, match="a number in V"):
            reader.fetch()


@pytest.mark.parametrize(
    ("reading", "said"), [("nan", "'nan'"), ("text", "'OVLD'"), ("nothing", "'None'"), ("flags", "'1,0'")]
)
def test_what_is_no_number_is_no_reading(stub, reading, said):
    reader = driver(f'bridge = "pymeasure:acme.Source"\nreader = {{ unit = "V", reading = "{reading}" }}')
    try:
        reader.start(1)
        with pytest.raises(BadReply, match=said):
            reader.fetch()
    finally:
        reader.close()


class Told:
    """A bridge that gives values as told."""

    def __init__(self, *values: Value, asked: bool = False) -> None:
        self._values, self.measures_when_asked = list(values), asked

    def read(self, path: str, timeout_s: float) -> Value:
        return self._values.pop(0) if len(self._values) > 1 else self._values[0]

    def close(self) -> None:
        pass


def line(*values: Value, asked: bool = False) -> tuple[BridgeLine, World]:
    world = World()
    told: Any = Told(*values, asked=asked)
    return BridgeLine(told, "it", "it", lambda text: text == "T", 10.0, world, None), world


def test_a_reading_is_newer_than_its_question():
    it, world = line(Value("1.0", "V", 100.0), Value("1.0", "V", 100.0), Value("2.0", "V", 101.0))
    assert it.query_lines("T", 1) == ["2.0 V"]
    assert 0.0 < world.now() < 1.0


def test_a_value_that_nobody_renews_is_refused_in_time():
    it, world = line(Value("1.0", "V", 100.0))
    with pytest.raises(NoReply, match="not been renewed for 10 s"):
        it.query_lines("T", 1)
    assert world.now() == pytest.approx(10.0, abs=0.2)
    assert it.query_lines("SP", 1) == ["1.0 V"]  # a setting does not change by itself


def test_what_is_measured_when_asked_must_not_repeat_its_time():
    it, world = line(Value("1.0", "", 5.0), Value("1.0", "", 5.0), Value("2.0", "", 6.0), asked=True)
    assert it.query_lines("T", 1) == ["1.0"]
    assert world.now() == 0.0
    assert it.query_lines("T", 1) == ["2.0"]


class Node:
    """A line to a SECoP node with one module."""

    def __init__(self, **answers: str) -> None:
        of = {"value": {"datainfo": {"unit": "K"}}, "target": {"datainfo": {"unit": "$"}}, "status": {}}
        described = {"equipment_id": "rig.demo", "modules": {"cryo": {"accessibles": of}}}
        self._answers = {
            "*IDN?": "ISSE&SINE2020,SECoP,V2019-09-16,v1.0",
            "describe .": f"describing . {json.dumps(described)}",
            "read cryo:value": 'reply cryo:value [4.2, {"t": 1.5}]',
            "read cryo:target": 'reply cryo:target [5.0, {"t": 1.0}]',
            "change cryo:target 6.5": 'changed cryo:target [6.5, {"t": 2.0}]',
            "do cryo:stop": 'done cryo:stop [null, {"t": 2.0}]',
            **{key.replace("_", " ", 1).replace("__", ":"): one for key, one in answers.items()},
        }
        self.later: list[str] = []

    def query(self, text: str, timeout_s: float, *, repeat: bool = True) -> str:
        return self._answers[text]

    def heard(self, timeout_s: float) -> str:
        return self.later.pop(0)

    def bad_reply(self, text: str, reply: object, expected: str) -> BadReply:
        return BadReply(f"{reply!r} to {text!r}; expected {expected}")


def cryo(node: Any = None) -> SecopBridge:
    return SecopBridge(node or Node(), "cryo", "cryo at node")


def test_secop_reads_and_changes():
    it = cryo()
    assert it.identity(1) == ("SECoP", "rig.demo cryo", "", "")
    assert it.read("value", 1) == Value("4.2", "K", 1.5)
    assert it.read("target", 1) == Value("5.0", "K", 1.0)
    it.write("target", "6.5", 1)
    it.call("stop()", 1)


@pytest.mark.parametrize(
    ("code", "word"), [(0, "DISABLED"), (100, "IDLE"), (200, "WARN"), (300, "BUSY"), (390, "BUSY")]
)
def test_secop_states_are_words(code, word):
    node = Node(read_cryo__status=f'reply cryo:status [[{code}, "said"], {{"t": 1.0}}]')
    assert cryo(node).read("status", 1).text == word
    assert cryo(node).read("status[0]", 1).text == str(code)


@pytest.mark.parametrize(
    ("answer", "error", "said"),
    [
        ('error_read cryo:value ["HardwareError", "no sensor", {}]', InstrumentError, "HardwareError: no sensor"),
        ('reply cryo:target [4.2, {"t": 1.5}]', BadReply, "begins with 'reply cryo:value'"),
        ("reply cryo:value [4.2", BadReply, "expected JSON"),
        ("reply cryo:value 4.2", BadReply, "with its qualifiers"),
        ('reply cryo:value [null, {"t": 1.5}]', None, "None"),
        ('reply cryo:value [{"a": 1}, {}]', BadReply, "several values"),
    ],
)
def test_secop_answers_that_are_none(answer, error, said):
    it = cryo(Node(read_cryo__value=answer))
    if error is None:  # the form of a number refuses it
        assert it.read("value", 1).text == said
        return
    with pytest.raises(error, match=said):
        it.read("value", 1)


def test_secop_errors_of_state_unknown_parameters_and_other_nodes():
    with pytest.raises(InstrumentError, match="error 400: too warm"):
        cryo(Node(read_cryo__status='reply cryo:status [[400, "too warm"], {}]')).read("status", 1)
    with pytest.raises(BadReply, match="it has value, target, status"):
        cryo().read("pressure", 1)
    with pytest.raises(WrongInstrument, match="no module heater; it has cryo"):
        SecopBridge(Node(), "heater", "it").identity(1)  # type: ignore[arg-type]
    other: Any = Node()
    other._answers["*IDN?"] = "ACME,M1,0,1"
    with pytest.raises(WrongInstrument, match="should be a SECoP node"):
        cryo(other).identity(1)


def test_secop_lines_that_nobody_asked_for_are_passed_over():
    node = Node(read_cryo__value='update cryo:value [9.9, {"t": 1.0}]')
    node.later = ['update cryo:target [9.9, {"t": 1.0}]', 'reply cryo:value [4.2, {"t": 1.5}]']
    assert cryo(node).read("value", 1).text == "4.2"


BENCH = """name = "lab"
[instruments.cold]
driver = "secop:localhost:10767/cryo"
[instruments.cold.source]
unit = "K"
low = 0
high = 30
set = "target"
setpoint = "target"
read = "value"
tolerance = 0.1
safe_value = 10
time_constant_s = 2
[instruments.probe]
driver = "ophyd:LAB:PROBE"
reader = { unit = "V" }
[instruments.meter]
driver = "qcodes:Keithley.Keithley2450"
address = "visa://GPIB0::22::INSTR"
[instruments.meter.reader]
unit = "V"
[instruments.meter.reader.channels]
a = { reading = "voltage" }
b = { reading = "current", unit = "A" }
[sensors.probe]
reader = "probe"
[sensors.a]
reader = "meter"
channel = "a"
[sensors.b]
reader = "meter"
channel = "b"
unit = "A"
[factors]
cold_K = "cold"
[limits]
cold_K = [0, 30]
"""
PROCEDURE = """kind = "general"
name = "cold"
seed = 1
replications = 1
[factors.cold_K]
levels = [9, 11]
[settle]
dwell_s = 2
[measure]
readings = 3
[model]
formula = "1 + cold_K"
"""


def test_a_bench_with_bridges_is_planned_and_run_dry():
    config = parse_bench(BENCH, "bench")
    checked = check_options(config, "bench")
    assert config.instruments["cold"].address == "socket://localhost:10767"
    assert wire_of(config.instruments["probe"].address) == "epics:LAB:PROBE"
    plan = plan_of({"bench.toml": BENCH, "procedure.toml": PROCEDURE}, dry=False)
    assert rehearse(plan, lambda news: None).rehearsed == 2
    dry = DryBench(config, {})
    try:
        bench = open_bench(dry.config, {**checked, **check_options(dry.config, "dry")}, dry.clock, dry.wires)
        for instrument in bench.instruments.values():
            assert "lines are not those of the instrument" in instrument.remarks()[0]  # type: ignore[attr-defined]
    finally:
        dry.close()


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("[instruments.meter.reader]", "high = 5\n[instruments.meter.reader]", "high is unknown here"),
        ('"secop:localhost:10767/cryo"', '"secop:localhost:cryo"', "HOST:PORT/MODULE"),
        ("low = 0\n", "", "source.low is missing"),
        ('reader = { unit = "V" }', "reader = {}", "reader.unit is missing"),
        ('address = "visa://GPIB0::22::INSTR"\n', "", "address is missing"),
        ("[instruments.meter.reader]", "readers = 1\n[instruments.meter.reader]", "readers is unknown here"),
    ],
)
def test_what_is_wrong_in_a_bench_with_bridges(before, after, said):
    assert before in BENCH
    with pytest.raises(ConfigurationError, match=said):
        check_options(parse_bench(BENCH.replace(before, after), "bench"), "bench")


def test_a_short_setting_is_an_assignment():
    assert parse(TABLE).source.set[0].tell == "level = {value}"  # type: ignore[union-attr]


def test_addresses_are_resources():
    assert resource("COM4") == "ASRL4::INSTR"
    assert resource("socket://10.0.0.5:5025") == "TCPIP::10.0.0.5::5025::SOCKET"
    assert resource("epics:LAB:BATH") == "LAB:BATH"
    with pytest.raises(DriverError, match="no place for a bridge"):
        resource("rfc2217://10.0.0.5:4001")


PAGE = (Path(__file__).parents[2] / "docs" / "how_to" / "bridges.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"^```\w+ ([\w.]+)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE))


def test_the_commands_of_the_page_run_on_its_files(tmp_path):
    for name, text in BLOCKS.items():
        if name.endswith(".toml"):
            (tmp_path / name).write_text(text)
    for command in BLOCKS["run"].splitlines():
        done = rig(*shlex.split(command)[1:], cwd=tmp_path)
        assert done.returncode == 0, (command, done.stdout[-1500:], done.stderr[-1500:])
    assert "complete: 3 of 3 points" in done.stderr


@pytest.mark.parametrize("driver", re.findall(r"^\| `(\w+:[\w.:/]+)` \|", PAGE, re.MULTILINE))
def test_the_drivers_of_the_page_are_drivers(driver):
    assert bridged(driver.replace("HOST", "localhost")).what
