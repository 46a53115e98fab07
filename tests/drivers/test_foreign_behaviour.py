"""What twelve foreign instruments did that a file took without a word: `proving/notes/foreign_instruments.md`."""

from __future__ import annotations

from contextlib import AbstractContextManager

import pytest
from declared_bench import answers
from fake_lines import served

from rig.contracts.declared.forms import step_of
from rig.contracts.declared.instrument import parse
from rig.drivers.errors import BadReply, InstrumentError
from rig.drivers.roles import is_overload
from rig.verbs.instrument.check import check

SOURCE = r"""
maker = "ACME"
model = "T1"
[identity]
ask = "ID?"
answer = "{maker} {model}"
[source]
unit = "degC"
low = -40
high = 250
set = { tell = "SP {value:.2}", answer = "SP {value:.2}" }
read = "PV?"
safe_value = 20
tolerance = 0.1
dwell_s = 0
"""


class TestSetpoints:
    def test_an_acknowledgement_with_another_value_is_no_acknowledgement(self, bench):
        """A bath beyond its limit answers with the setpoint that stays in force."""
        it = bench(SOURCE)
        it.it.prepare()
        it.it.set(25.0)
        answers(it, SP="SP 20.00")
        with pytest.raises(BadReply, match=r"'SP 20.00' to 'SP 240.00'.* it took 20 and not 240"):
            it.it.set(240.0)

    @pytest.mark.parametrize(("printed", "step"), [("100", 1.0), ("0FA0", 1.0), ("1.25", 0.01), ("+1.250E+02", 0.1)])
    def test_fewer_digits_than_were_sent_are_the_same_value(self, printed, step):
        assert step_of(printed) == pytest.approx(step)

    def test_a_source_that_says_settled_somewhere_else_has_not_arrived(self, bench):
        """A pressure controller drops a setpoint beyond its range, and reports that it has settled at the old one."""
        it = bench(SOURCE + 'settled = "ARRIVED?"\n')
        it.it.prepare()
        it.it.set(200.0)
        answers(it, ARRIVED="1", PV="149.99")
        assert not it.it.read().settled
        answers(it, PV="199.99")
        assert it.it.read().settled

    def test_a_setpoint_that_nothing_compares_is_refused(self):
        text = SOURCE.replace(', answer = "SP {value:.2}"', "").replace("tolerance = 0.1", 'settled = "ARRIVED?"')
        with pytest.raises(ValueError, match=r"setpoint is missing: .* or read with tolerance"):
            parse(text)


BEHIND_AN_ADAPTER = r"""
maker = "ACME"
model = "V1"
prepare = ["RANGE 10"]
[parameters]
node = 7
[wire]
preamble = ["++auto 0", "++addr {node}"]
read = "++read"
[identity]
ask = "WHO"
lines = 3
answer = "{maker} {model} {}"
[errors]
ask = "ERR"
answer = "{code}"
queue = false
[reader]
unit = "V"
reading = { ask = "X?", answer = "{value}" }
"""
HANDSHAKE = r"""
maker = "ACME"
model = "G1"
check = [{ ask = "UNIT", is = 0 }]
[wire]
send_end = ""
request = "{line}\r\u0005"
reply = ["\u0006\r\n{line}\r\n", "\u0015\r\n"]
[identity]
ask = "MODEL"
answer = "{model}"
[reader]
unit = "mbar"
reading = { ask = "PR{channel}", answer = "{state},{value:+.4e2}", words = { 0 = "stable", 4 = "error: it is off" } }
[reader.channels]
pirani = { is = "1" }
cold = { is = "2" }
"""
NO_FRAME = r"""
maker = "ACME"
model = "B1"
[wire]
send_end = ""
reply_end = "\r\n"
[identity]
ask = "\u001bx1_"
answer = "{model} {}"
lines = 2
[reader]
unit = "g"
reading = { ask = "\u001bP", answer = "{value:10.4} {unit}" }
"""
PROBE = r"""
maker = "ACME"
model = "H1"
units = { "%RH" = "pct" }
[wire]
send_end = "\r"
request = "{{F00{line}}}"
reply = "{{F00{line}{checksum}"
checksum = { kind = "sum", modulo = 64, plus = 32, as = "binary" }
[identity]
ask = "RDD"
answer = "rdd {t:6.2};°C;{};{model}; 000"
[reader]
unit = "degC"
reading = { ask = "RDD", answer = "rdd {t:6.2};°C;{};{model}; 000" }
channels = { t = { field = "t" } }
"""
TWO_LANGUAGES = r"""
maker = "ACME"
model = "H2"
[wire]
send_end = ""
request = "{{M{line}\r\n"
reply = ["{{S{line}\r\n", "[S01V12{line}\r"]
[identity]
ask = "[M01V07C6"
frame = "{line}\r"
answer = "{model}A9"
[source]
unit = "degC"
low = -40
high = 200
set = { tell = "00{value:04x}", scale = 0.01, signed = true, answer = "00{value:04x}" }
setpoint = { ask = "00****", answer = "00{value:04x}", scale = 0.01, signed = true }
safe_value = 20
"""
FRAME_OF_ALL = '"{} {m:+.3} {sp:+.3} Air"'
FLOW = rf"""
maker = "ACME"
model = "F1"
[wire]
send_end = "\r"
request = "A{{line}}"
[identity]
ask = "??M"
answer = "{{model}} {{}}"
[source]
unit = "L_per_min"
low = 0
high = 10
set = {{ tell = "S{{value:.3}}", answer = "{{}} {{m:+.3}} Air" }}
setpoint = {{ ask = "", answer = {FRAME_OF_ALL}, field = "sp" }}
read = {{ ask = "", answer = {FRAME_OF_ALL}, field = "m" }}
safe_value = 0
"""


class TestWires:
    """Each was silent, or unsayable, between the driver and its twin or on the wire."""

    def test_an_adapter_is_told_to_fetch_every_line_of_an_answer(self, bench):
        it = bench(BEHIND_AN_ADAPTER)
        assert it.it.identify().model == "V1"
        assert it.sent == ["++auto 0", "++addr 7", "WHO", "++read", "++read", "++read"]
        it.it.prepare()
        it.it.start(1)
        assert len(it.it.fetch()["input"]) == 1
        assert it.sent[-4:] == ["X?", "++read", "ERR", "++read"]

    def test_a_handshake_is_a_frame_and_its_error_names_the_question_that_was_sent(self, bench):
        it = bench(HANDSHAKE)
        assert it.it.identify().model == "G1"
        it.it.prepare()
        assert it.it.wrong() == ()
        it.it.start(2)
        assert {name: len(found) for name, found in it.it.fetch().items()} == {"pirani": 2, "cold": 2}
        answers(it, PR2="4,+0.0000E+00")
        it.it.start(1)
        with pytest.raises(InstrumentError, match=r"asked 'PR2': it is off$"):
            it.it.fetch()

    def test_commands_without_an_end_have_answers_with_one(self, bench):
        it = bench(NO_FRAME)
        it.twin._count_of_lines = lambda line: 2 if "x1" in line else 1
        assert it.it.identify().model == "B1"
        it.it.prepare()
        it.it.start(2)
        assert len(it.it.fetch()["input"]) == 2

    def test_a_degree_sign_is_one_byte_and_a_sum_may_be_a_printable_character(self, bench):
        it = bench(PROBE)
        assert it.it.identify().model == "H1"
        it.it.prepare()
        it.it.start(1)
        assert len(it.it.fetch()["t"]) == 1
        heard = b"".join(data for way, data in it.wire if way == "rx")
        assert b";\xb0C;" in heard
        body, right = heard.split(b"\r")[0][:-1], heard.split(b"\r")[0][-1]
        assert right == sum(body) % 64 + 32
        it.twin._framed = lambda line: f"{{F00{line}?"
        it.it.start(1)
        with pytest.raises(BadReply, match="right checksum"):
            it.it.fetch()

    def test_two_languages_on_one_wire_have_frames_of_their_own(self, bench):
        it = bench(TWO_LANGUAGES)
        assert it.it.identify().model == "H2"
        it.it.prepare()
        it.it.set(-5.0)
        assert it.it.read().setpoint == -5.0
        answers(it, **{"004E20": "0007D0"})
        with pytest.raises(BadReply, match="it took 2000 and not 20000"):
            it.it.set(200.0)

    def test_one_line_has_reading_and_setpoint(self, bench):
        it = bench(FLOW)
        assert it.it.identify().model == "F1"
        it.it.prepare()
        it.it.set(2.5)
        assert it.it.read().setpoint == 2.5

    def test_a_frame_without_an_end_needs_reply_end(self):
        with pytest.raises(ValueError, match=r"give it an end, or wire\.reply_end"):
            parse(NO_FRAME.replace('reply_end = "\\r\\n"\n', ""))


OLD_FIRST = r"""
maker = "ACME"
model = "C1"
[identity]
ask = "I"
answer = "{maker} {model}"
[reader]
unit = "degC"
reading = { ask = "A{channel}", answer = "{value:8.3}C{channel}" }
[reader.channels]
p16 = { is = "16" }
p18 = { is = "18" }
"""


def switched() -> AbstractContextManager[str]:
    """A bridge whose first reading after a change of channel is that of the channel before, in psi until told."""
    said, state = {"16": 21.3, "18": 21.291}, ["16", 21.3, 0]

    def answer(line: str) -> bytes | None:
        channel, (last, value, n) = line.strip()[1:], state
        if channel not in said:
            return {"I": b"ACME C1\n", "UNIT?": b"1\n"}.get(line.strip())
        state[:] = channel, said[channel], n + 1
        return f"{(value if channel != last else said[channel]) + 0.0005 * (n % 3):8.3f}C{channel}\n".encode()

    return served(answer)


class TestCheck:
    def test_it_finds_a_first_reading_that_is_the_channels_before(self):
        with switched() as address:
            found = {step.what: step for step in check(OLD_FIRST, "c", address, {}, None, 1.0).steps}
            step = found["first reading after choosing"]
            assert not step.ok
            assert "write discard = 1" in step.found
            text = OLD_FIRST.replace('unit = "degC"', 'unit = "degC"\ndiscard = 1')
            assert check(text, "c", address, {}, None, 1.0).ok

    def test_readings_of_other_settings_are_said_to_be_of_no_known_unit_and_it_may_be_prepared(self):
        text = 'prepare = ["UNIT 4"]\ncheck = [{ ask = "UNIT?", is = 4 }]\n' + OLD_FIRST
        with switched() as address:
            found = {step.what: step for step in check(text, "c", address, {}, None, 1.0).steps}
            assert found["settings"].word == "DIFFERS"
            assert "unit and range of this are not known" in found["three readings of each channel"].found
            found = {step.what: step for step in check(text, "c", address, {}, None, 1.0, prepare=True).steps}
            assert not found["prepare"].ok
            assert "UNIT? answers 1, not 4" in found["prepare"].found


def test_an_overload_in_another_makers_number_is_no_reading(bench):
    """A voltmeter prints +200.0000E+33 where others print 9.9E37."""
    it = bench(OLD_FIRST.replace("{value:8.3}", "{value}"))
    it.it.prepare()
    it.twin._carried_out = lambda line: (f"+200.0000E+33C{line[1:]}", 0.0)
    it.it.start(1)
    assert is_overload(it.it.fetch()["p16"][0])


STATUS = r"""
maker = "ACME"
model = "S1"
[identity]
ask = "ID?"
answer = "{maker} {model}"
[errors]
ask = "OC"
answer = "STS1={code}"
bits = { 2 = "error in the last command" }
queue = false
[source]
unit = "V"
low = -12
high = 12
set = "S{value:+.4}E"
setpoint = "OD"
on = "O1E"
off = "O0E"
output = { ask = "OC", answer = "STS1={value}", bit = 4 }
settled = { ask = "OC", answer = "STS1={state}", words = { 16 = "stable", 24 = "unstable", 0 = "unstable" } }
"""


def test_one_status_word_has_errors_output_and_arrival(bench):
    it = bench(STATUS)
    it.it.prepare()
    it.it.set(5.0)
    assert it.it.read().output
    assert not it.it.read().settled
    it.sleep(60)
    assert it.it.read().settled
    it.it.make_safe()
    assert not it.it.read().output
    it.twin.queue.append("unknown")
    with pytest.raises(InstrumentError, match="error in the last command"):
        it.it._talk.raise_errors()
