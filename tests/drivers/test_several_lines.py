"""An answer of several lines, of which a file expects one: the rest must not become the answer to the next question."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench
from fake_lines import served

from rig.drivers.clock import RealClock
from rig.drivers.declared import driver_of
from rig.drivers.errors import BadReply, DriverError, WrongInstrument
from rig.drivers.wires import Wires

READER = """
maker = "ACME"
model = "L1"
[wire]
timeout_s = 1.0
[identity]
ask = "ID?"
answer = "ACME {model}"
[reader]
unit = "mm"
reading = { ask = "READ?", answer = "{value}"MORE }
"""


def opened(text: str, address: str):
    driver = driver_of(text)
    clock = RealClock()
    return driver("it", address, driver.Options(), Wires(clock), clock)


@pytest.fixture
def gauge():
    """Its second line, the reading of another axis, comes a moment after the first."""
    taken = []

    def answer(line: str) -> bytes | None:
        if line != "READ?":
            return b"ACME L1\n"
        taken.append(1.0 + len(taken))
        return f"{taken[-1]}\n".encode()

    with served(answer, later=lambda line: b"900.5\n" if line == "READ?" else None, after_s=0.03) as address:
        yield address


def test_the_second_line_of_an_answer_is_not_the_next_reading(gauge):
    """Readings were 1, 900.5, 2, 900.5: each second one was of the other axis, and no word was said."""
    it = opened(READER.replace("MORE", ""), gauge)
    assert it.identify().model == "L1"
    it.start(4)
    with pytest.raises(BadReply, match=r"answered '1.0 900.5' to 'READ\?'; .* and more came after it; write lines = 2"):
        it.fetch()
    it.start(1)
    with pytest.raises(BadReply, match="write lines = 2"):
        it.fetch()
    it.close()


def test_with_its_lines_each_reading_is_its_own(gauge):
    text = READER.replace("MORE", ", lines = 2").replace('"{value}"', '"{value} {}"')
    it = opened(text, gauge)
    it.start(3)
    assert it.fetch() == {"input": [1.0, 2.0, 3.0]}
    it.close()


@pytest.mark.parametrize("times", [1, 2])
def test_an_identity_of_several_lines_is_refused_at_once(times):
    with served({"ID?": b"ACME L1\n"}.get, later=lambda line: b"V1.2\n" * times, after_s=0.03) as address:
        it = opened(READER.replace("MORE", ""), address)
        with pytest.raises(WrongInstrument, match=f"write lines = {times + 1}"):
            it.identify()
        it.close()


def test_lines_that_come_together_are_told_too():
    with served({"ID?": b"ACME L1\nV1.2\n"}.get) as address:
        it = opened(READER.replace("MORE", ""), address)
        with pytest.raises(DriverError, match=r"`lines` says how many|write lines = 2"):
            it.identify()
        it.close()


def test_acknowledgements_and_errors_have_no_rest_either():
    text = """
    maker = "ACME"
    model = "S1"
    [identity]
    ask = "ID?"
    answer = "{maker} {model}"
    [errors]
    ask = "ERR?"
    answer = "{code}"
    [source]
    unit = "V"
    low = 0
    high = 10
    set = { tell = "SP {value:.2}", answer = "OK" }
    setpoint = "SP?"
    safe_value = 0
    """
    for line, words in (("SP 5", "'SP {value:.2}'"), ("ERR?", r"'ERR\?'")):
        it = DeclaredBench(text)
        try:
            it.it.prepare()
            before = it.twin._send

            def twice(answer, tx, session, lines=1, line=line, it=it, before=before):
                before(answer, tx, session, lines)
                if it.sent[-1].startswith(line):
                    it.dry.world.call_in(0.05, lambda: tx(b"READY\n"))

            it.twin._send = twice
            it.it._talk._whole_once.clear()
            with pytest.raises(DriverError, match=f"to {words}.* write lines = 2|in its safe state"):
                it.it.set(5.0)
        finally:
            it.close()


def test_an_instrument_that_talks_until_it_is_prepared_is_identified():
    """A flow controller streams from power-on, and its identity is asked before it can be told not to."""
    streams = [True]

    def answer(line: str) -> bytes | None:
        streams[0] &= line != "STREAM OFF"
        return {"ID?": b"ACME L1\n", "READ?": b"1.5\n"}.get(line)

    text = 'prepare = ["STREAM OFF"]\n' + READER.replace("MORE", "")
    with served(answer, later=lambda line: b"0.007\n" if streams[0] else None, after_s=0.03) as address:
        it = opened(text, address)
        assert it.identify().model == "L1"
        it.prepare()
        it.start(2)
        assert it.fetch() == {"input": [1.5, 1.5]}
        streams[0] = True
        it.start(2)
        it._talk._whole_once.clear()
        with pytest.raises(BadReply, match="write lines = 2"):
            it.fetch()
        it.close()


def test_a_question_is_watched_once():
    it = DeclaredBench(READER.replace("MORE", ""))
    try:
        it.it.identify()
        it.it.start(1)
        it.it.fetch()
        began = it.dry.world.now()
        it.it.start(10)
        it.it.fetch()
        assert it.dry.world.now() - began < 0.5
    finally:
        it.close()
