"""Instruments that are tables: what a file may say, what is sent, and what its twin answers."""

from __future__ import annotations

import itertools
from statistics import stdev

import pytest
from declared_bench import QUIET, answers

from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import parse
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NoReply, NotReady, WrongInstrument
from rig.drivers.roles import OVERLOAD, Reader, Restartable, SelfChecking, Source, WithUnits

BATH = r"""
maker = "ACME"
model = "B1"
[wire]
send_end = "\r"
reply_end = "\r\n"
[identity]
ask = "version"
answer = "{maker} {model} V{firmware}"
[source]
unit = "degC"
low = -20
high = 150
set = "out_sp_00 {value:.2}"
setpoint = "in_sp_00"
read = "in_pv_00"
on = "out_mode_05 1"
off = "out_mode_05 0"
output = "in_mode_05"
tolerance = 0.05
dwell_s = 60
time_constant_s = 30
"""
BALANCE = r"""
maker = "ACME"
model = "W1"
words = { S = "stable", D = "unstable", I = "busy", "+" = "overload", "-" = "overload" }
[wire]
send_end = "\r\n"
[identity]
ask = "I2"
answer = 'I2 A "{model} {text}"'
[errors]
replies = ["ES", "ET", "EL"]
[reader]
unit = "g"
reading = { ask = "SI", answer = ["S {state} {value:10.2} {unit}", "S {state}"] }
reading_s = 0.2
resolution = 0.01
"""
SCANNER = r"""
model = "C1"
maker = "ACME"
prepare = ["RANGE 1", "FILTER ON"]
check = [{ ask = "RANGE?", is = 1 }, { ask = "FILTER?", answer = "{text}", is = "ON" }]
[[healthy]]
ask = "FUSE?"
words = { OK = "stable", BLOWN = "error: its fuse is blown" }
is = "stable"
[identity]
ask = "ID?"
[errors]
ask = "ERR?"
answer = "E{code} {text}"
codes = { 7 = "no such range" }
[reader]
unit = "ohm"
select = "CHAN {channel}"
settle_s = 2
discard = 2
confirm = { ask = "CHAN?", answer = "CHAN {channel}" }
reading = "READ?"
[reader.channels]
a = { is = "1" }
b = { is = "2" }
"""
NODES = r"""
model = "N1"
maker = "ACME"
parameters = { node = 3 }
[wire]
request = "#{node:02}{line}{checksum}"
reply = "={node:02}{line}{checksum}"
checksum = "xor"
[identity]
ask = "ID"
answer = "{model}"
[source]
unit = "L_per_min"
low = 0
high = 100
set = { tell = "SP{value:04x}", answer = "OK", scale = 0.003125 }
setpoint = { ask = "SP?", answer = "SP{value:04x}", scale = 0.003125 }
read = { ask = "PV?", answer = "PV{value:04x}", scale = 0.003125 }
safe_value = 0
tolerance = 0.1
"""
HUBER = r"""
maker = "Huber"
model = "PB"
about = "hexadecimal two's complements, and braces that are meant"
[wire]
send_end = "\r\n"
[identity]
ask = "{{M1B****"
answer = "{{S1B{text}"
[source]
unit = "degC"
low = -90
high = 200
set = { tell = "{{M00{value:04x}", answer = "{{S00{value:04x}", scale = 0.01, signed = true }
setpoint = { ask = "{{M00****", answer = "{{S00{value:04x}", scale = 0.01, signed = true }
read = { ask = "{{M01****", answer = "{{S01{value:04x}", scale = 0.01, signed = true }
on = { tell = "{{M140001", answer = "{{S140001" }
off = { tell = "{{M140000", answer = "{{S140000" }
output = { ask = "{{M14****", answer = "{{S14{value:04x}", words = { 0 = "off", 1 = "on" } }
tolerance = 0.05
time_constant_s = 20
"""
VENTED = r"""
model = "P1"
maker = "ACME"
[identity]
ask = "ID?"
[source]
unit = "bar"
low = 0
high = 10
set = ["SETP {value:.4}", "START"]
setpoint = "SETP?"
read = { ask = "PRES?", answer = "{value:.5} {unit}" }
on = "MODE CTRL"
off = ["MODE MEAS", "MODE VENT"]
output = { ask = "MODE?", words = { CTRL = "on", MEAS = "off", VENT = "vent" } }
settled = { ask = "STAT?", answer = "{value:d}", bit = 3 }
dwell_s = 0
"""


class TestForms:
    @pytest.mark.parametrize(
        ("form", "line", "fields"),
        [
            ("S {state} {value:10.2} {unit}", "S S     100.00 g", {"state": "S", "value": "100.00", "unit": "g"}),
            ("S {state} {value:10.2} {unit}", "S S     10.00 g", None),  # a digit was lost
            ("{value:9.2} {unit}", "12.34 g", {"value": "12.34", "unit": "g"}),  # spaces at the ends are not there
            ("{value:04x}", "0FA0", {"value": "0FA0"}),
            ("{value:+.3e}", "+1.234E-03", {"value": "+1.234E-03"}),
            ("{value:+.3e}", "1.234E-03", None),
            ("{a},{b},{}", "1.5,2.5,x y", {"a": "1.5", "b": "2.5"}),
            ("{{{value:d}}}", "{7}", {"value": "7"}),
        ],
    )
    def test_a_line_is_read_whole_or_not_at_all(self, form, line, fields):
        assert Form(form).read(line) == fields

    @pytest.mark.parametrize("form", ["{value:.q}", "{", "x}", "{value} {value}"])
    def test_a_form_that_makes_no_sense_is_refused(self, form):
        with pytest.raises(ValueError, match=r"brace|after the colon|one name"):
            Form(form)

    @pytest.mark.parametrize("value", [0.0, 1.25, -20.0, 149.99])
    @pytest.mark.parametrize("form", ["T {value:8.2} C", "{value:+09.3}", "{value:+.5e}", "{value}"])
    def test_what_is_written_is_read(self, form, value):
        text = Form(form).write({"value": value})
        found = Form(form).read(text.strip())
        assert found is not None
        assert Form(form).fields["value"].read(found["value"]) == pytest.approx(value)


class TestFiles:
    def test_all_that_a_role_lacks_is_named_at_once(self):
        with pytest.raises(ValueError, match="model is missing") as found:
            parse('[source]\nset = "X {other}"\non = "ON"\n[reader]\n')
        said = str(found.value)
        for key in (
            "identity",
            "source.unit",
            "source.low",
            "source.high",
            "source.setpoint",
            "source has no safe state",
        ):
            assert f"- {key}" in said
        for key in ("reader.unit", "reader.reading", "source.output", "{other} is no parameter"):
            assert key in said
        assert "in the manual:" in said

    @pytest.mark.parametrize(
        ("old", "new", "says"),
        [
            ("high = 150", "high = -30", "has to be below"),
            ('read = "in_pv_00"', "", "tolerance needs read"),
            ('output = "in_mode_05"', "", "output is missing"),
            ('read = "in_pv_00"', 'read = { ask = "in_pv_00", words = { x = "fine" } }', "is 'fine'; known: stable"),
            ('read = "in_pv_00"', "read = { register = 4 }", "source.read has no line of text"),
            ("[source]", "[source]\ncolour = 1", "is no key here"),
            ("dwell_s = 60", "dwell_s = 60\nreadback = 0.001", "less than half the step of set"),
        ],
    )
    def test_what_cannot_be_meant_is_refused(self, old, new, says):
        with pytest.raises(ValueError, match=says):
            parse(BATH.replace(old, new))


class TestBath:
    def test_its_lines(self, bench):
        it = bench(BATH)
        assert it.it.identify().model == "B1"
        it.it.prepare()
        it.it.set(25.0)
        state = it.it.read()
        assert (state.setpoint, state.output, state.settled) == (25.0, True, False)
        assert it.sent == [
            "version", "out_sp_00 25.00", "in_sp_00", "in_mode_05", "out_mode_05 1", "in_mode_05",
            "in_sp_00", "in_mode_05", "in_pv_00",
        ]  # fmt: skip
        assert ("tx", b"in_pv_00\r") in it.wire
        assert isinstance(it.it, Source)
        assert isinstance(it.it, SelfChecking)
        assert not isinstance(it.it, Reader)
        assert not isinstance(it.it, Restartable)

    def test_it_settles_by_its_reading_for_a_time_and_goes_to_its_safe_state(self, bench):
        it = bench(BATH)
        it.it.prepare()
        it.it.set(40.0)
        for _ in range(80):
            it.sleep(10.0)
            if it.it.read().settled:
                break
        assert it.it.read().settled
        it.it.make_safe()
        assert it.it.read().safe
        assert not it.twin.quantity.on
        with pytest.raises(LimitError):
            it.it.set(151.0)

    def test_a_bench_may_have_narrower_limits_but_not_wider_ones(self, bench):
        assert bench(BATH, more="low = 0\nhigh = 100").it.limits() == (0.0, 100.0)
        with pytest.raises(Exception, match=r"less than or equal to 150|at most 150"):
            bench(BATH, more="high = 200")

    def test_another_instrument_is_refused(self, bench):
        it = bench(BATH.replace('"{maker} {model} V{firmware}"', '"ACME {model} V{firmware}"'))
        it.twin.__class__.table = parse(BATH.replace('model = "B1"', 'model = "B2"'))
        it.twin._whole.pop("version")
        with pytest.raises(Exception, match=r"nothing|should be"):
            it.it.identify()

    def test_a_setpoint_that_reads_back_otherwise_switches_off(self, bench):
        it = bench(BATH)
        it.it.prepare()
        it.it.set(30.0)
        it.twin._set = lambda value: None
        with pytest.raises(BadReply, match="in_sp_00 should answer 31 and answers 30"):
            it.it.set(31.0)
        it.sleep(0.1)
        assert not it.twin.quantity.on


class TestBalance:
    def test_a_reading_has_its_unit_and_its_digits(self, bench):
        it = bench(BALANCE)
        it.it.identify()
        it.it.prepare()
        it.it.start(3)
        (values,) = it.it.fetch().values()
        assert len(values) == 3
        assert all(round(value, 2) == value for value in values)
        assert it.it.units() == {"input": "g"}
        assert isinstance(it.it, WithUnits)

    def test_what_it_says_on_being_switched_on_is_no_answer(self, bench):
        it = bench(BALANCE)
        it.dry.world.call_in(0.1, lambda: it.dry.sim.cables["it"]._receive(b'I2 A "W1 of before"\r\n'))
        it.it.identify()
        it.it.prepare()
        it.it.start(1)
        assert len(it.it.fetch()["input"]) == 1
        assert it.sent == ["I2", "SI"]

    def _says(self, it, *answers):
        """The twin answers this, in turn."""
        left = list(answers)
        before = it.twin._carried_out
        it.twin._carried_out = lambda line: (left.pop(0), 0.0) if left and line == "SI" else before(line)

    def test_an_unstable_or_busy_balance_is_asked_again(self, bench):
        it = bench(BALANCE)
        it.it.prepare()
        self._says(it, "S D     100.00 g", "S I", "S S     100.01 g")
        it.it.start(1)
        assert it.it.fetch() == {"input": [100.01]}
        assert it.sent == ["SI"] * 3

    def test_or_accepted_or_refused_as_the_file_says(self, bench):
        it = bench(BALANCE + 'unstable = "accept"\n')
        it.it.prepare()
        self._says(it, "S D     100.00 g")
        it.it.start(1)
        assert it.it.fetch() == {"input": [100.0]}
        it = bench(BALANCE + 'unstable = "refuse"\n')
        it.it.prepare()
        self._says(it, "S D     100.00 g")
        it.it.start(1)
        with pytest.raises(NotReady, match=r"'100\.00' is not stable"):
            it.it.fetch()

    @pytest.mark.parametrize(
        ("answer", "error", "says"),
        [
            ("ES", InstrumentError, "after 'SI': it refuses"),
            ("S S     100.00 kg", BadReply, "a number in g; was its unit changed"),
            ("S S     10.00 g", BadReply, r"answered 'S S     10\.00 g' to 'SI'; expected an answer as in"),
            ("S X     100.00 g", BadReply, "expected an answer as in"),
        ],
    )
    def test_what_is_no_reading_is_an_error_with_its_bytes(self, bench, answer, error, says):
        it = bench(BALANCE)
        it.it.prepare()
        self._says(it, answer)
        it.it.start(1)
        with pytest.raises(error, match=says):
            it.it.fetch()

    def test_an_overload_in_words(self, bench):
        it = bench(BALANCE)
        it.it.prepare()
        self._says(it, "S +")
        it.it.start(1)
        assert it.it.fetch() == {"input": [OVERLOAD]}


class TestScanner:
    def test_a_channel_is_chosen_awaited_confirmed_and_read(self, bench):
        it = bench(SCANNER)
        it.it.prepare()
        it.wire.clear()
        began = it.dry.world.now()
        it.it.start(1)
        assert set(it.it.fetch()) == {"a", "b"}
        assert it.dry.world.now() - began > 4.0
        one = ["CHAN 1", "ERR?", "CHAN?", "READ?", "READ?", "READ?"]
        assert it.sent == [*one, *(line.replace("CHAN 1", "CHAN 2") for line in one), "ERR?"]

    def test_another_channel_than_the_chosen_one_is_refused(self, bench):
        it = bench(SCANNER)
        it.it.prepare()
        before = it.twin.does
        it.twin.does = lambda place, *rest: None if place == "reader.select" else before(place, *rest)
        it.it.start(1)
        with pytest.raises(BadReply, match=r"channel 1: this is another one's answer|an answer as in"):
            it.it.fetch()

    def test_settings_are_asked_again_and_a_restart_is_known_by_them(self, bench):
        it = bench(SCANNER)
        it.it.prepare()
        assert it.it.wrong() == ()
        assert not it.it.restarted()
        it.twin.power_cycle()
        assert it.it.restarted()
        assert len(it.it.wrong()) == 2

    def test_a_command_that_is_refused_is_named_with_the_instruments_words(self, bench):
        it = bench(SCANNER)
        it.twin._whole.pop("range 1")
        with pytest.raises(InstrumentError, match="after 'RANGE 1', reports error 7: no such range"):
            it.it.prepare()

    def test_what_is_not_healthy_is_told(self, bench):
        it = bench(SCANNER)
        answers(it, **{"FUSE?": "BLOWN"})
        with pytest.raises(InstrumentError, match="its fuse is blown"):
            it.it.wrong()

    def test_a_bench_may_read_fewer_channels(self, bench):
        assert bench(SCANNER).it.channels() == ("a", "b")


class TestFrames:
    def test_node_checksum_and_hexadecimal_numbers(self, bench):
        it = bench(NODES, more="node = 7")
        assert it.it.identify().model == "N1"
        it.it.prepare()
        it.it.set(50.0)
        assert it.it.read().setpoint == pytest.approx(50.0)
        assert it.sent[1].startswith("#07SP3E80")
        it.it.make_safe()
        assert it.it.read().safe

    def test_another_nodes_answer_and_a_wrong_checksum_are_refused(self, bench):
        it = bench(NODES)
        for wrong in ("=04N1", "=03N177"):
            it.twin._framed = lambda line, wrong=wrong: wrong
            with pytest.raises(WrongInstrument, match=r"in the frame|the checksum"):
                it.it.identify()


class TestHexadecimal:
    @pytest.mark.parametrize(("degC", "line"), [(25.0, "{M0009C4"), (-40.25, "{M00F047"), (-0.01, "{M00FFFF")])
    def test_negative_numbers_are_twos_complements(self, bench, degC, line):
        it = bench(HUBER)
        it.it.identify()
        it.it.prepare()
        it.it.set(degC)
        assert line in it.sent
        state = it.it.read()
        assert (state.setpoint, state.output) == (pytest.approx(degC), True)
        it.sleep(400.0)
        assert it.it.read().value == pytest.approx(degC, abs=0.02)
        it.it.make_safe()
        assert it.it.read().safe


class TestStates:
    @pytest.mark.parametrize("word", ["ON", "1", "+1"])
    def test_on_and_off_need_no_words(self, bench, word):
        it = bench(BATH)
        it.it.prepare()
        it.it.set(20.0)
        answers(it, in_mode_05=word)
        assert it.it.read().output

    def test_a_word_for_neither_is_refused(self, bench):
        it = bench(BATH)
        answers(it, in_mode_05="MAYBE")
        with pytest.raises(BadReply, match="answered 'MAYBE' to 'in_mode_05'"):
            it.it.read()

    def test_a_text_that_is_right_needs_no_form(self, bench):
        it = bench(SCANNER.replace('answer = "{text}", is = "ON"', 'is = "ON"'))
        it.it.prepare()
        assert it.it.wrong() == ()

    def test_on_off_vent_and_a_bit_that_says_settled(self, bench):
        it = bench(VENTED)
        it.it.identify()
        it.it.prepare()
        it.it.set(5.0)
        assert it.sent[1:] == ["SETP 5.0000", "START", "SETP?", "MODE?", "MODE CTRL", "MODE?"]
        assert not it.it.read().settled
        it.sleep(30.0)
        assert it.it.read().settled
        it.wire.clear()
        it.it.make_safe()
        assert it.sent[:2] == ["MODE MEAS", "MODE VENT"]
        assert it.it.read().safe
        assert not it.it.read().output


MAP = r"""
maker = "ACME"
model = "C3"
prepare = [{ register = 300, value = 0 }]
check = [{ register = 300, is = 0 }, { register = 301, is = 2 }]
[wire]
protocol = "modbus"
word_order = "little"
[identity]
register = 122
is = 1234
[source]
unit = "degC"
low = -50
high = 200
set = { register = 2, decimals = 525 }
setpoint = { register = 2, decimals = 525 }
read = { register = 1, decimals = 525, words = { 32767 = "error: its sensor is broken" } }
on = { register = 273, value = 0 }
off = { register = 273, value = 1 }
output = { register = 273, words = { 0 = "on", 1 = "off" } }
tolerance = 0.2
[reader]
unit = "degC"
reading = { register = 10, table = "input", type = "float32" }
[reader.channels]
a = {}
b = { reading = { register = 20, table = "input", type = "int32", scale = 0.001, words = { 2147483647 = "overload" } } }
"""
COILS = r"""
maker = "ACME"
model = "C4"
[wire]
protocol = "modbus"
first_register = 1
[identity]
register = 5
is = 7
[source]
unit = "pct"
low = 0
high = 100
set = { register = 3, type = "float32" }
setpoint = { register = 3, type = "float32" }
on = { register = 9, table = "coil", value = 1 }
off = { register = 9, table = "coil", value = 0 }
output = { register = 9, table = "coil" }
settled = { register = 2, table = "discrete" }
"""


class TestRegisters:
    @pytest.fixture(params=["modbus-tcp://192.0.2.9/1", "modbus-rtu:///dev/rig/c/1"])
    def controller(self, request, bench, monkeypatch):
        monkeypatch.setattr("declared_bench.ADDRESSES", {"modbus": request.param})
        it = bench(MAP, protocol="modbus")
        it.it.identify()
        it.it.prepare()
        return it

    def test_numbers_have_their_decimals_and_settings_are_read_back(self, controller):
        controller.it.set(25.3)
        state = controller.it.read()
        assert (state.setpoint, state.output) == (25.3, True)
        assert controller.it.wrong() == ()
        assert controller.twin._kept["holding", 2] == 253.0
        controller.it.make_safe()
        assert controller.it.read().safe

    def test_channels_have_types_and_tables(self, controller):
        controller.it.start(2)
        found = controller.it.fetch()
        assert set(found) == {"a", "b"}
        assert all(len(values) == 2 for values in found.values())

    def test_numbers_of_registers_have_no_form_that_could_be_lost(self, controller):
        values = itertools.chain([1.25] * 12, itertools.repeat(1.2345678))
        controller.twin._measured = lambda name, t0: next(values)
        for _ in range(6):
            controller.it.start(1)
            assert len(controller.it.fetch()["a"]) == 1
        assert controller.it.learned() == {}

    def test_a_setting_that_is_changed_at_the_panel_is_told(self, controller):
        controller.twin._kept["holding", 300] = 5.0
        assert controller.it.wrong() == ("register 300 answers 5, not 0.0",)

    def test_a_number_that_means_an_error_is_one(self, controller):
        controller.twin._shown = lambda place, ask, before=controller.twin._shown: (
            32767.0 if place == "source.read" else before(place, ask)
        )
        controller.it.set(20.0)
        with pytest.raises(InstrumentError, match="asked 'register 1': its sensor is broken"):
            controller.it.read()

    def test_coils_and_inputs_that_count_from_one(self, bench):
        it = bench(COILS, protocol="modbus")
        it.it.identify()
        it.it.prepare()
        it.it.set(40.0)
        it.sleep(30.0)
        state = it.it.read()
        assert (state.setpoint, state.output, state.settled) == (40.0, True, True)
        it.it.make_safe()
        assert not it.twin.quantity.on

    def test_another_device_is_refused(self, bench):
        it = bench(MAP.replace("is = 1234", "is = 1235"), protocol="modbus")
        it.twin._shown = lambda place, ask: 1234.0
        with pytest.raises(WrongInstrument, match="it answers '1234' to 'register 122'"):
            it.it.identify()

    def test_every_register_and_value_that_is_missing_is_named(self):
        text = COILS.replace('setpoint = { register = 3, type = "float32" }', 'setpoint = "SP?"')
        with pytest.raises(ValueError, match=r"source\.setpoint has no register, but a line of text") as found:
            parse(text.replace('table = "coil", value = 1', 'table = "coil"'))
        assert "source.on has no value to write" in str(found.value)


PROBE = r"""
maker = "ACME"
model = "RH1"
units = { "%RH" = "pct" }
[wire]
protocol = "stream"
period_s = 2
send_end = "\r\n"
[identity]
answer = "RH={rh} %RH T={t} 'C"
[reader]
reading = { answer = "RH={rh:5.1} %RH T={t:6.2} 'C" }
[reader.channels]
humidity = { field = "rh", unit = "pct" }
air = { field = "t", unit = "degC" }
"""


class TestStreams:
    def test_each_reading_is_a_line_that_begins_after_the_start(self, bench):
        it = bench(PROBE)
        it.it.identify()
        it.it.prepare()
        it.sleep(7.0)
        it.it.start(2)
        began = it.dry.world.now()
        found = it.it.fetch()
        assert {name: len(values) for name, values in found.items()} == {"humidity": 2, "air": 2}
        assert 2.0 < it.dry.world.now() - began < 6.1
        assert not it.sent

    def test_a_line_that_has_begun_is_not_read(self, bench):
        it = bench(PROBE)
        it.it.identify()
        it.it.prepare()
        while it.dry.world.now() % 2.0 > 0.01:  # its lines begin every 2 s, and take 28 ms
            it.sleep(0.005)
        it.sleep(0.01)
        began = it.dry.world.now()
        it.it.start(1)
        it.it.fetch()
        assert it.dry.world.now() - began > 1.9

    def test_its_noise_is_that_of_an_instrument_that_filters(self, bench):
        world = {"sensors": {"air": {"formula": "20", "noise": 0.1}, "humidity": {"formula": "50", "noise": 0.1}}}
        it = bench(PROBE, world={**QUIET, **world})
        it.it.start(20)
        assert 0.1 < stdev(it.it.fetch()["air"]) < 1.0  # 0.1 over a second; over a microsecond it would be 100

    def test_a_torn_line_is_not_read(self, bench):
        it = bench(PROBE)
        it.it.identify()
        before, torn = it.twin._framed, [2]
        it.twin._framed = lambda line: before(line) if not torn or torn.pop() == 1 else before(line)[9:]
        it.it.start(1)
        with pytest.raises(BadReply, match="expected an answer as in"):
            it.it.fetch()

    def test_silence_is_told(self, bench):
        it = bench(PROBE)
        it.it.identify()
        it.twin._session += 1
        with pytest.raises(Exception, match="answered nothing to 'nothing, since it talks by itself'"):
            it.it.identify()

    LOGGER = PROBE.replace("period_s = 2", 'period_s = 2\nskip = ["# {}", "P= {} hPa"]')

    def test_lines_of_other_forms_are_passed_over(self, bench):
        it = bench(self.LOGGER)
        it.it.identify()
        it.it.start(2)
        found = it.it.fetch()
        assert {name: len(values) for name, values in found.items()} == {"humidity": 2, "air": 2}
        assert b"# -\r\n" in b"".join(data for _, data in it.wire)

    def test_a_line_of_no_form_is_refused(self, bench):
        it = bench(self.LOGGER)
        it.it.identify()
        before = it.twin._framed
        it.twin._framed = lambda line: before(line.replace("P= ", "Q= "))
        it.it.start(1)
        with pytest.raises(BadReply, match="expected an answer as in"):
            it.it.fetch()

    def test_an_instrument_that_sends_only_other_lines_is_told(self, bench):
        it = bench(self.LOGGER)
        it.it.identify()
        it.twin._framed = lambda line: "# nothing"
        it.sleep(3.0)
        it.it.start(1)
        with pytest.raises(NoReply, match="only lines that its file skips"):
            it.it.fetch()

    @pytest.mark.parametrize(("skip", "said"), [("{}", "would pass over every line"), ("RH={rh}", "names a field")])
    def test_skipping_must_not_swallow_readings(self, skip, said):
        with pytest.raises(ValueError, match=said):
            parse(PROBE.replace("period_s = 2", f'skip = "{skip}"'))
