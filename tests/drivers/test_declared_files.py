"""Every instrument that is a file of ours: what its manual prints is read, and its twin does what its role demands."""

from __future__ import annotations

import contextlib
import itertools

import pytest
from declared_bench import DeclaredBench

from rig.bench.plugins import declared
from rig.contracts.declared.instrument import parse
from rig.contracts.declared.replay import known, replayed
from rig.drivers.errors import NotReady
from rig.drivers.roles import Reader, Restartable, Source
from rig.sims.declared.behaviour import Refused

FILES = declared()
every = pytest.mark.parametrize("name", FILES)


def test_there_are_twenty_or_more():
    assert len(FILES) >= 20


@every
def test_what_its_manual_prints_is_read_and_every_claim_has_a_source(name):
    table = parse(FILES[name])
    assert list(replayed(table)) == []
    assert table.examples
    assert table.sources
    assert table.tried
    assert table.about
    assert len(FILES[name].splitlines()) <= 70


@every
def test_it_does_what_its_role_demands(name):
    table = parse(FILES[name])
    it = DeclaredBench(FILES[name], protocol=table.wire.protocol)
    try:
        driver = it.it
        assert driver.identify().model in table.model
        driver.prepare()
        assert driver.wrong() == ()
        if isinstance(driver, Reader):
            for _ in range(2):
                driver.start(2)
                assert all(len(values) == 2 for values in driver.fetch().values())
        if isinstance(driver, Source):
            low, high = driver.limits()
            aim = low + 0.6 * (high - low)
            driver.set(aim)
            for _ in range(400):
                it.sleep(30.0)
                if (state := driver.read()).settled:
                    break
            assert state.settled
            assert state.output
            assert abs(state.setpoint - aim) <= table.source.nearness
            driver.stop()
        with contextlib.suppress(NotReady if table.source is not None and table.source.rest is not None else ()):
            driver.make_safe()  # a vent takes time
        it.sleep(5.0)
        driver.make_safe()
        if isinstance(driver, Source):
            assert driver.read().safe
        if isinstance(driver, Restartable):
            assert not driver.restarted()
            it.twin.power_cycle()
            assert driver.restarted()
            driver.prepare()
            assert not driver.restarted()
    finally:
        it.close()


@every
def test_its_twin_answers_in_the_forms_of_the_examples(name):
    table = parse(FILES[name])
    if table.wire.protocol != "text":
        return
    it = DeclaredBench(FILES[name])
    try:
        for question, _ in table.examples:
            found = known(table, question)
            if found is None or found[0] == "reader.fetch":  # which needs its start
                continue
            place, one = found
            try:
                answer = it.twin._carried_out(question)
            except Refused:  # an example of a refusal
                assert table.errors.replies
                continue
            if answer is not None:
                said = answer[0] if isinstance(answer[0], str) else answer[0]()
                forms = one.forms if hasattr(one, "forms") else one.answer
                assert any(it.twin._form(form).read(said.strip(), strict=False) is not None for form in forms), place
    finally:
        it.close()


def test_readings_with_a_step_may_repeat():
    coarse = {name for name, text in FILES.items() if parse(text).coarse}
    assert {"mettler-sics", "vaisala-hmt310", "bronkhorst-modbus", "fluke-7341"} <= coarse
    assert not coarse & {"keysight-34461a", "keithley-2000", "hp-3458a"}


def test_no_two_answer_alike():
    """A file takes no other file's instrument for its own."""
    texts = {name: parse(text) for name, text in FILES.items() if parse(text).identity.ask is not None}
    alike = []
    for (one, a), (other, b) in itertools.permutations(texts.items(), 2):
        if a.identity.ask != b.identity.ask:
            continue
        if a.identity.forms == b.identity.forms and a.maker == b.maker and set(a.model) & set(b.model):
            alike.append((one, other))
    assert alike == []


RUNS = {"espec-scp220": ("MODE?", "RUN"), "thermotron-8800": ("MODE?", "1"), "eurotherm-3200": (23, 1.0)}
RUNS["watlow-f4"] = (200, 2.0)
"""The question by which a chamber tells that a program of its own runs, and that answer."""
ALARM = {"espec-scp220": ("ALARM?", "2,1,18"), "thermotron-8800": ("ALRM1?", "32"), "eurotherm-3200": (75, 32.0)}


def answering(it, question, answer):
    """Have the twin answer a question, or show a register, so."""
    if isinstance(question, str):
        before = it.twin._carried_out
        it.twin._carried_out = lambda line: (answer, 0.0) if line == question else before(line)
    else:
        shown = it.twin._shown
        it.twin._shown = lambda place, ask: answer if ask.register_ == question else shown(place, ask)


@pytest.mark.parametrize("name", RUNS)
def test_a_chamber_whose_program_runs_is_not_set(name):
    it = DeclaredBench(FILES[name], protocol=parse(FILES[name]).wire.protocol)
    try:
        it.it.prepare()
        it.it.set(30.0)
        before = it.twin._setpoint
        answering(it, *RUNS[name])
        (said,) = it.it.wrong()
        assert "runs, " in said
        actions = [lambda: it.it.set(40.0), it.it.prepare]
        if it.it.read().output:  # the Thermotron reads as off, and is left alone
            actions.append(it.it.stop)
        for action in actions:
            with pytest.raises(NotReady, match=r"(program|profile) runs, .*; end it at its panel \("):
                action()
        assert it.twin._setpoint == before
    finally:
        it.close()


@pytest.mark.parametrize("name", ALARM)
def test_an_alarm_of_a_chamber_is_a_fault_in_words(name):
    it = DeclaredBench(FILES[name], protocol=parse(FILES[name]).wire.protocol)
    try:
        it.it.prepare()
        it.it.set(30.0)
        assert it.it.read().faults == ()
        answering(it, *ALARM[name])
        assert it.it.read().faults
        assert all("alarm" in said or "sensor is broken" in said for said in it.it.read().faults)
        it.it.make_safe()
    finally:
        it.close()
