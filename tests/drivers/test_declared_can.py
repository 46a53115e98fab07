"""Instruments that are files with CAN messages: signals of a DBC as readings and states, messages as commands."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import can
import cantools.database
import pytest
from declared_bench import DeclaredBench

from rig.bench.plugins import declared, driver_class
from rig.contracts.declared.beside import with_dbc
from rig.contracts.declared.frames import packed, shown, unpacked
from rig.contracts.declared.instrument import parse
from rig.contracts.declared.replay import replayed
from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NoReply, NotReady, WrongInstrument
from rig.drivers.roles import OVERLOAD
from rig.errors import ConfigurationError
from rig.verbs.instrument.scan import scan

THERMOCOUPLES = cantools.database.load_string(parse(declared()["css-canmod-temp"]).wire.dbc, "dbc")
TOP = [one.name for one in THERMOCOUPLES.get_message_by_name("ThermocoupleHrTop").signals]
CHAMBER_DBC = """VERSION ""
BU_: Controller Chamber
BO_ 256 Command: 4 Controller
 SG_ Enable : 0|1@1+ (1,0) [0|1] "" Chamber
 SG_ Setpoint : 16|16@1- (0.01,0) [-80|200] "degC" Chamber
BO_ 257 Reset: 1 Controller
 SG_ Code : 0|8@1+ (1,0) [0|255] "" Chamber
BO_ 512 State: 8 Chamber
 SG_ Mode : 0|2@1+ (1,0) [0|3] "" Controller
 SG_ Arrived : 2|1@1+ (1,0) [0|1] "" Controller
 SG_ Alarm : 8|8@1+ (1,0) [0|255] "" Controller
 SG_ Setpoint : 16|16@1- (0.01,0) [-80|200] "degC" Controller
 SG_ Actual : 32|16@1- (0.01,0) [-80|200] "degC" Controller
BO_ 513 Product: 8 Chamber
 SG_ Type : 0|8@1+ (1,0) [0|255] "" Controller
 SG_ Serial : 16|32@1+ (1,0) [0|0] "" Controller
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 512 100;
VAL_ 512 Mode 0 "Idle" 1 "Running" 2 "Defrosting" ;
VAL_ 513 Type 7 "Chamber C7" 8 "Chamber C8" ;
"""
CHAMBER = """
maker = "ACME"
model = "C7"
parameters = { code = 90 }
prepare = { tell = "Reset: Code = {code}", wait_s = 0.5 }
healthy = [{ ask = "State.Alarm", is = 0 }]
examples = [["200#0104C409C409FFFF", "State.Actual = 25"], ["200#0100C409C409", "State.Mode = Running"]]
[wire]
protocol = "can"
dbc = "chamber.dbc"
timeout_s = 0.5
cyclic = { Command = 0.1 }
[identity]
ask = "Product.Type"
is = "Chamber C7"
serial = "Product.Serial"
[source]
unit = "degC"
low = -70
high = 180
set = "Command: Setpoint = {value}"
setpoint = "State.Setpoint"
read = "State.Actual"
on = "Command: Enable = 1"
off = "Command: Enable = 0"
output = { ask = "State.Mode", words = { Idle = "off", Running = "on", Defrosting = "busy" } }
settled = { ask = "State.Arrived", words = { 1 = "stable", 0 = "unstable" } }
time_constant_s = 10
"""
PROBE_DBC = """VERSION ""
BU_: Host Probe
BO_ 2566834709 Readings: 8 Probe
 SG_ Group M : 0|4@1+ (1,0) [0|15] "" Host
 SG_ Count : 8|8@1+ (1,0) [0|255] "" Host
 SG_ T1 m0 : 23|16@0- (0.01,0) [-200|300] "\u00b0C" Host
 SG_ State1 m0 : 39|4@0+ (1,0) [0|15] "" Host
 SG_ Volts m1 : 31|32@0- (1,0) [0|0] "V" Host
BO_ 32 Ask: 1 Host
 SG_ Channel : 0|8@1+ (1,0) [0|2] "" Probe
BO_ 33 Answer: 4 Probe
 SG_ Load : 0|32@1- (1,0) [0|0] "kN" Host
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_ "GenMsgCycleTime" BO_ 2566834709 100;
SIG_VALTYPE_ 2566834709 Volts : 1;
SIG_VALTYPE_ 33 Load : 1;
VAL_ 2566834709 State1 0 "valid" 1 "settling" 2 "open" ;
"""
PROBE = """
model = "P2"
words = { valid = "stable", settling = "busy", open = "error: T1 is open" }
[wire]
protocol = "can"
dbc = "probe.dbc"
timeout_s = 0.5
counter = "Count"
[identity]
ask = "Readings.Count"
[reader]
unit = "degC"
[reader.channels]
t1 = { reading = { ask = "Readings.T1", status = "Readings.State1" } }
volts = { unit = "V", reading = { ask = "Readings.Volts" } }
"""
LOAD = """
model = "L1"
[wire]
protocol = "can"
dbc = "probe.dbc"
timeout_s = 0.5
[identity]
ask = "Answer.Load"
request = "Ask: Channel = 2"
[reader]
unit = "kN"
reading = { ask = "Answer.Load", request = "Ask: Channel = 2" }
"""


def whole(text: str, dbc: str = CHAMBER_DBC) -> str:
    return with_dbc(text, lambda name: dbc.encode("cp1252"))


def bench(text: str = CHAMBER, dbc: str = CHAMBER_DBC) -> DeclaredBench:
    return DeclaredBench(whole(text, dbc), protocol="can")


def refused(text: str, dbc: str = CHAMBER_DBC) -> str:
    with pytest.raises(ConfigurationError) as caught:
        driver_class(whole(text, dbc))
    return str(caught.value)


class Foreign:
    """What the driver hears, made by cantools and not by our twin: its frames come in the twin's place."""

    def __init__(self, it: DeclaredBench, dbc: str) -> None:
        self.it, self.dbc = it, cantools.database.load_string(dbc, "dbc")
        it.twin._say = lambda *_: None  # it is silent

    def sends(self, after_s: float, message: str, **values: float) -> None:
        one = self.dbc.get_message_by_name(message)
        data = one.encode(values, strict=False)
        can_id = one.frame_id | (1 << 31 if one.is_extended_frame else 0)
        self.it.dry.world.call_in(after_s, lambda: self.it.twin._tx(can_id, data))


def test_a_chamber_is_set_read_and_made_safe_by_messages():
    it = bench()
    try:
        found = it.it.identify()
        assert (found.maker, found.model, found.confirmed) == ("ACME", "C7", True)
        it.it.prepare()
        assert ("tx", packed(257, b"\x5a")) in it.wire
        it.it.set(50.0)
        state = it.it.read()
        assert (state.setpoint, state.output, state.settled) == (50.0, True, False)
        it.sleep(120.0)
        assert it.it.read().settled
        assert it.it.read().value == pytest.approx(50.0, abs=0.01)
        it.it.make_safe()
        state = it.it.read()
        assert (state.output, state.safe) == (False, True)
        assert [data for way, data in it.wire if way == "tx"][-1] == packed(256, b"\x00\x00\x88\x13")  # 50.00, off
    finally:
        it.close()


def test_the_identifiers_may_depend_on_a_node_number():
    text = CHAMBER.replace("{ code = 90 }", "{ code = 90, node = 16 }").replace("[identity]", "XX[identity]", 1)
    text = text.replace("XX", 'identifiers_plus = "node"\n')
    it = DeclaredBench(whole(text), protocol="can", more="node = 3")
    try:
        it.it.identify()
        it.it.prepare()
        it.it.set(50.0)
        assert it.it.read().output
        assert {data[:2] for way, data in it.wire if way == "tx"} == {b"\x01\x03", b"\x01\x04"}
        it.twin._say = lambda *_: None
        it.sleep(20.0)
        with pytest.raises(NoReply, match=r"no frame 203h \(State\)"):
            it.it.read()
    finally:
        it.close()
    assert "parameters has no whole number 'nod'" in refused(text.replace('plus = "node"', 'plus = "nod"'))


def test_a_cyclic_command_goes_on_while_nobody_talks_and_ends_with_the_driver():
    it = bench()
    try:
        it.it.identify()
        it.it.prepare()
        it.it.set(50.0)
        it.sleep(600.0)
        assert it.it.read().output  # its twin switches off without it
        it.it.close()
        it.sleep(10.0)
        assert not it.twin.quantity.on
    finally:
        it.close()


def test_a_request_for_the_identity_may_be_a_sign_of_life_that_goes_on():
    text = LOAD.replace('request = "Ask: Channel = 2"', 'request = "Ask: Channel = 1"', 1)
    it = bench(text.replace("[identity]", "cyclic = { Ask = 0.5 }\n[identity]"), PROBE_DBC)
    try:
        heard = []
        it.dry.sim.wire("it").begins = heard.append
        it.it.identify()
        it.sleep(5.2)
        assert len(heard) == 11
    finally:
        it.close()


def test_a_number_of_the_dbc_may_be_a_word():
    text = PROBE.replace(', status = "Readings.State1"', ', words = { "99.99" = "error: no sensor" }')
    it = bench(text, PROBE_DBC)
    try:
        foreign = Foreign(it, PROBE_DBC)
        it.it.start(1)
        foreign.sends(0.1, "Readings", Group=0, Count=1, T1=99.99, State1=0)
        with pytest.raises(InstrumentError, match="no sensor"):
            it.it.fetch()
    finally:
        it.close()


def test_a_second_session_does_not_switch_off_what_is_on():
    """A message has the signals that a command does not name, too: what the instrument says is on stays on."""
    it = bench()
    try:
        it.it.identify()
        it.it.prepare()
        it.it.set(50.0)
        it.it._talk._sent.clear()  # as a new process
        it.it._guarded._told = None
        it.wire.clear()
        it.it.set(60.0)
        assert [data for way, data in it.wire if way == "tx"] == [packed(256, b"\x01\x00\x70\x17")]
    finally:
        it.close()


def test_a_state_is_not_that_of_a_frame_from_before_the_command():
    it = bench()
    try:
        it.it.identify()
        it.it.prepare()
        for aim in (20.0, 30.0, 40.0):
            it.it.set(aim)  # reads its setpoint back at once
            assert it.it.read().setpoint == aim
    finally:
        it.close()


def test_an_instrument_that_shows_a_command_late_is_waited_for_and_one_that_never_does_is_switched_off():
    it = bench()
    try:
        it.it.identify()
        it.it.prepare()
        obey, late_s = it.twin._obey, [0.35]
        it.twin._obey = lambda *given: it.dry.world.call_in(late_s[0], lambda: obey(*given))
        it.it.set(40.0)
        assert it.it.read().output
        it.it.make_safe()
        late_s[0] = 30.0
        with pytest.raises(BadReply, match=r"State\.Setpoint should answer 50 and answers 40"):
            it.it.set(50.0)
        assert [data for way, data in it.wire if way == "tx"][-1] == packed(256, b"\x00\x00\x88\x13")  # off
    finally:
        it.close()


def test_another_product_is_refused_and_silence_is_said_to_be_silence():
    it = bench(CHAMBER.replace('is = "Chamber C7"', 'is = "Chamber C8"'))
    try:
        it.twin.table = parse(whole(CHAMBER))
        it.twin._asks["Product.Type"] = [("identity", it.twin.table.identity)]
        with pytest.raises(WrongInstrument, match=r"answers 'Chamber C7' to 'Product\.Type'"):
            it.it.identify()
    finally:
        it.close()
    it = bench()
    try:
        it.twin._say = lambda *_: None
        with pytest.raises(NoReply, match=r"no frame 201h \(Product\) came \(nothing is heard on this bus\); is it"):
            it.it.identify()
        for n in range(8):
            for can_id in (0x301, 0x18FECA15 | 1 << 31):
                it.dry.world.call_in(0.5 * n, lambda can_id=can_id: it.twin._tx(can_id, b"\x01"))
        with pytest.raises(NoReply, match=r"201h \(Product\) came \(heard instead: 301h, 18FECA15h\)"):
            it.it.identify()
    finally:
        it.close()


def test_a_setpoint_that_no_frame_can_have_is_refused_before_anything_is_sent():
    it = bench(CHAMBER.replace("high = 180", "high = 500"))
    try:
        it.it.identify()
        it.it.prepare()
        it.wire.clear()
        with pytest.raises(LimitError, match="does not fit into its message"):
            it.it.set(400.0)
        assert not [
            data for way, data in it.wire if way == "tx" and data[:2] == b"\x01\x00" and data[4:] == b"\x40\x9c"
        ]
    finally:
        it.close()


def test_multiplexed_signals_a_float_in_motorola_order_and_a_unit_with_a_degree_sign():
    it = bench(PROBE, PROBE_DBC)
    try:
        it.it.identify()
        it.it.prepare()
        it.it.start(3)
        found = it.it.fetch()
        assert [len(found[name]) for name in ("t1", "volts")] == [3, 3]
        assert it.it.units() == {"t1": "degC", "volts": "V"}
        assert all(way == "rx" for way, _ in it.wire)  # nothing was sent
        assert it.wire[0][1][:4] == (2566834709).to_bytes(4, "big")
    finally:
        it.close()


def test_a_frame_that_waited_since_before_the_start_is_no_reading():
    it = bench(PROBE, PROBE_DBC)
    try:
        foreign = Foreign(it, PROBE_DBC)
        it.it._talk._caught_up()
        for n, value in enumerate((10.0, 11.0, 12.0)):  # while nobody listens
            foreign.sends(0.1 * n, "Readings", Group=0, Count=n, T1=value, State1=0)
        foreign.sends(5.3, "Readings", Group=0, Count=4, T1=20.0, State1=0)
        foreign.sends(5.4, "Readings", Group=1, Count=5, Volts=0.25)
        it.sleep(5.0)
        it.it.start(1)
        assert it.it.fetch() == {"t1": [20.0], "volts": [0.25]}
    finally:
        it.close()


def status(state: int) -> Callable[[Foreign], None]:
    def act(foreign: Foreign) -> None:
        foreign.sends(0.1, "Readings", Group=0, Count=1, T1=20.0, State1=state)
        foreign.sends(0.4, "Readings", Group=1, Count=1, Volts=1.0)
        foreign.sends(0.8, "Readings", Group=0, Count=2, T1=21.0, State1=0)
        foreign.sends(0.9, "Readings", Group=1, Count=2, Volts=1.0)

    return act


@pytest.mark.parametrize(
    ("frames", "outcome"),
    [
        (status(0), 20.0),
        (status(1), 21.0),  # busy: the next one
        (status(2), "T1 is open"),
        (status(5), r"'Readings.State1 = 5' .*one of the words valid, settling, open"),
        (lambda f: [f.sends(0.1 * n, "Readings", Group=0, Count=9, T1=20.0, State1=0) for n in (1, 2, 3)], "no frame"),
    ],
)
def test_what_a_status_says_of_a_reading(frames, outcome):
    it = bench(PROBE, PROBE_DBC)
    try:
        foreign = Foreign(it, PROBE_DBC)
        it.it.start(1)
        frames(foreign)
        if isinstance(outcome, float):
            assert it.it.fetch()["t1"] == [outcome]
            return
        with pytest.raises((InstrumentError, BadReply, NoReply), match=outcome):
            it.it.fetch()
    finally:
        it.close()


def test_frames_that_repeat_their_count_are_those_of_an_instrument_that_hangs():
    it = bench(PROBE, PROBE_DBC)
    try:
        foreign = Foreign(it, PROBE_DBC)
        for n in range(40):
            foreign.sends(0.05 * (n + 1), "Readings", Group=0, Count=9, T1=20.0, State1=0)
        it.it._talk._counts["Readings", frozenset(("Group", "Count", "T1", "State1"))] = 9.0
        it.it.start(1)
        with pytest.raises(NoReply, match="frames repeat their Count: it hangs"):
            it.it.fetch()
    finally:
        it.close()


def test_a_reading_at_the_end_of_its_range_is_an_overload_and_one_beyond_it_is_refused():
    for value, outcome in ((300.0, OVERLOAD), (310.0, "expected a number from -200 to 300")):
        it = bench(PROBE.replace(', status = "Readings.State1"', ""), PROBE_DBC)
        try:
            foreign = Foreign(it, PROBE_DBC)
            it.it.start(1)
            foreign.sends(0.1, "Readings", Group=0, Count=1, T1=value, State1=0)
            foreign.sends(0.2, "Readings", Group=1, Count=2, Volts=0.0)
            if isinstance(outcome, float):
                assert it.it.fetch()["t1"] == [outcome]
            else:
                with pytest.raises(BadReply, match=outcome):
                    it.it.fetch()
        finally:
            it.close()


def test_a_frame_that_is_too_short_or_of_an_unknown_group_is_named():
    it = bench(PROBE, PROBE_DBC)
    try:
        Foreign(it, PROBE_DBC)
        it.it.start(1)
        it.dry.world.call_in(0.1, lambda: it.twin._tx(2566834709, b"\x00\x01"))
        with pytest.raises(NoReply, match=r"18FECA15h .*0001 does not fit the DBC .*2 bytes instead of 8"):
            it.it.fetch()
    finally:
        it.close()


def test_a_reading_may_be_asked_for_and_a_late_answer_is_not_the_next_ones():
    it = bench(LOAD, PROBE_DBC)
    try:
        it.it.identify()
        it.it.start(2)
        assert len(it.it.fetch()["input"]) == 2
        asked = [data for way, data in it.wire if way == "tx"]
        assert asked == [packed(32, b"\x02")] * 3
        replies = it.twin._reply
        it.twin._reply = lambda *_: None
        it.it.start(1)
        with pytest.raises(NoReply, match="asked by 'Ask: Channel = 2'"):
            it.it.fetch()
        foreign = Foreign(it, PROBE_DBC)
        foreign.sends(0.2, "Answer", Load=-99.0)  # the late one
        it.sleep(0.1)
        it.twin._reply = replies
        it.it.start(1)
        assert abs(it.it.fetch()["input"][0]) < 1.0
    finally:
        it.close()


@pytest.mark.parametrize("extended", [False, True])
def test_a_reading_may_be_asked_for_by_a_remote_frame(extended):
    dbc = PROBE_DBC.replace("BO_ 33 ", "BO_ 2147483681 ").replace("_ 33 ", "_ 2147483681 ") if extended else PROBE_DBC
    it = bench(LOAD.replace('"Ask: Channel = 2"', '"remote"'), dbc)
    try:
        it.it.identify()
        it.it.start(2)
        assert len(it.it.fetch()["input"]) == 2
        (asked,) = {data for way, data in it.wire if way == "tx"}
        assert shown(asked) == ("00000021#R4" if extended else "021#R4")
        assert unpacked(asked)[0] == 33 | 1 << 30 | extended << 31
    finally:
        it.close()


def test_an_acknowledgement_and_a_signal_for_errors():
    dbc = CHAMBER_DBC.replace(
        "BA_DEF_ BO_",
        'BO_ 514 Done: 1 Chamber\n SG_ Result : 0|8@1+ (1,0) [0|255] "" Controller\nBA_DEF_ BO_',
        1,
    )
    text = CHAMBER.replace(
        'set = "Command: Setpoint = {value}"',
        'set = { tell = "Command: Setpoint = {value}", answer = "Done.Result = 1" }',
    )
    it = bench(text.replace("[source]", "[errors]\nask = 'State.Alarm'\ncodes = { 3 = 'door open' }\n[source]"), dbc)
    try:
        it.it.identify()
        it.it.prepare()
        it.it.set(30.0)
        it.twin._acknowledge = lambda path, value, tx: tx(514, b"\x02")
        with pytest.raises(InstrumentError, match=r"after 'Command: Setpoint = 40', .*it refuses \(Done.Result = 2\)"):
            it.it.set(40.0)
        it.twin._acknowledge = type(it.twin)._acknowledge.__get__(it.twin)
        it.it.make_safe()
        it.twin.queue.append("door")
        it.twin._obey = lambda *_: None
        with pytest.raises(InstrumentError, match=r"3.*door open"):
            it.it.prepare()
    finally:
        it.close()


def test_a_twin_that_is_not_heard_costs_nothing_and_speaks_when_somebody_listens_again():
    it = bench(PROBE, PROBE_DBC)
    try:
        it.it.identify()
        it.sleep(30.0)
        assert it.dry.world.next_due() is None
        it.it.start(1)
        assert len(it.it.fetch()["t1"]) == 1
    finally:
        it.close()


def test_all_that_a_file_has_wrong_is_said_at_once_with_what_the_dbc_has():
    said = refused(
        CHAMBER.replace('read = "State.Actual', 'read = "State.Acutal')
        .replace("Command: Enable = 1", "Command: Enabel = 1")
        .replace("Command: Enable = 0", "Command: Enable = 2")
        .replace('Idle = "off", Running = "on", Defrosting = "busy"', 'Off = "off", Running = "on"')
        .replace('unit = "degC"', 'unit = "K"')
        .replace("cyclic = { Command", "cyclic = { Comand")
        .replace("timeout_s = 0.5", "timeout_s = 0.5\nbaud = 9600")
        .replace("prepare = {", 'prepare = "Rest: Code = 1"\nlocal = {')
    )
    for one in (
        "source.read = 'State.Acutal' is not in the DBC; it has State.Mode, State.Arrived",
        "source.on: Command has no signal 'Enabel'; it has Enable, Setpoint",
        "source.off: Command.Enable = 2 is outside 0 to 1",
        "source.output.words: State.Mode is never 'Off'; the DBC has Idle, Running, Defrosting",
        "State.Mode may be 'Defrosting' (2) by the DBC; say in words what that means",
        "source.setpoint: State.Setpoint is in 'degC' by the DBC, and the file says K",
        "wire.cyclic: the DBC has no message 'Comand'",
        "wire: baud belong to lines of text",
        "prepare: the DBC has no message 'Rest'; it has Command, Reset, State, Product",
    ):
        assert one in said, one


@pytest.mark.parametrize(
    ("text", "dbc", "said"),
    [
        (CHAMBER.replace('dbc = "chamber.dbc"\n', ""), CHAMBER_DBC, "wire.dbc is missing: name of its DBC"),
        (CHAMBER.replace('"chamber.dbc"', '"../chamber.dbc"'), CHAMBER_DBC, "has to be a DBC file beside this one"),
        (CHAMBER.replace('protocol = "can"\n', ""), CHAMBER_DBC, 'wire: cyclic, dbc belong to protocol = "can"'),
        (CHAMBER, "nonsense", "wire.dbc: the DBC cannot be read"),
        (CHAMBER, CHAMBER_DBC.replace("Command: 4", "Command: 12"), "12 bytes; only classic frames of up to 8"),
        (CHAMBER.replace("Command: Enable = 1", "Enable, 1"), CHAMBER_DBC, "should be a message with signals"),
        (PROBE.replace("words = { valid", "units = { valid").replace('"stable"', '"a"').replace('"busy"', '"b"')
         .replace('"error: T1 is open"', '"c"'), PROBE_DBC, "status = 'Readings.State1' needs words"),
        (CHAMBER.replace("[source]", 'reading = "X.Y"\n[source]'), CHAMBER_DBC, "identity.reading: is no key here"),
        (CHAMBER.replace("output = { ask", "output_ = { ask"), CHAMBER_DBC, "source.output_: is no key here"),
        (CHAMBER.replace(', words = { Idle = "off", Running = "on", Defrosting = "busy" }', ""), CHAMBER_DBC,
         "may be 'Idle' (0) by the DBC; say in words"),
        (PROBE.replace('counter = "Count"', 'counter = "Number"'), PROBE_DBC, "no message of the DBC has a signal"),
    ],
)  # fmt: skip
def test_defects_of_a_file(text, dbc, said):
    assert said in refused(text, dbc)


def test_the_readback_allows_the_steps_of_the_dbc():
    source = parse(whole(CHAMBER)).source
    assert source.nearness == pytest.approx(0.01, rel=1e-5)
    assert parse(whole(CHAMBER)).coarse
    assert parse(whole(PROBE, PROBE_DBC)).step == 0.01


def test_frames_of_the_examples_are_read():
    assert list(replayed(parse(whole(CHAMBER.replace(', ["200#0100C409C409", "State.Mode = Running"]', ""))))) == []
    wrong = whole(CHAMBER.replace("State.Actual = 25", "State.Actual = 26"))
    assert any("is 25.0, not 26" in one for one in replayed(parse(wrong)))


def test_not_ready_without_a_stable_reading():
    text = PROBE.replace("[reader.channels]", "patience_s = 0.5\nagain_s = 0.1\n[reader.channels]")
    it = bench(text, PROBE_DBC)
    try:
        foreign = Foreign(it, PROBE_DBC)
        it.it.start(1)
        for n in range(60):
            foreign.sends(0.1 * (n + 1), "Readings", Group=0, Count=n, T1=20.0, State1=1)
        with pytest.raises(NotReady, match=r"no stable reading for 0\.5 s"):
            it.it.fetch()
    finally:
        it.close()


def test_the_text_of_a_file_stands_for_itself(tmp_path: Path):
    text = whole(CHAMBER)
    assert whole(text, "another") == text
    assert "\n" in parse(text).wire.dbc


def test_a_scan_of_a_bus_says_what_is_heard_there(monkeypatch):
    quick = declared()["css-canmod-temp"].replace('protocol = "can"', 'protocol = "can"\ntimeout_s = 0.5')
    monkeypatch.setattr("rig.verbs.instrument.scan.declared", lambda: {"css-canmod-temp": quick})
    theirs = can.Bus("scanned", "virtual")
    data = THERMOCOUPLES.encode_message("ThermocoupleHrTop", {one: 25 if "Temp" in one else 0 for one in TOP})
    sent, stop = [can.Message(arbitration_id=0x77, data=b"\x01", is_extended_id=False)], threading.Event()

    def talk() -> None:
        while not stop.wait(0.01):
            for one in sent:
                theirs.send(one)

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        with pytest.raises(NoReply, match=r"ThermocoupleHrTop\) came \(heard instead: 077h\)"):
            list(scan("can:virtual/scanned", RealClock()))
        sent.append(can.Message(arbitration_id=2, data=data, is_extended_id=False))
        found = list(scan("can:virtual/scanned", RealClock()))
        assert found == [("css-canmod-temp", "CSS Electronics CANmod.temp")]
    finally:
        stop.set()
        thread.join()
        theirs.shutdown()
