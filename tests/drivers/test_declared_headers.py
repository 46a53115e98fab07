"""Answers that repeat the header of their question; models, makers and ends of lines as instruments spell them."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench

from rig.contracts.declared.instrument import parse
from rig.drivers.errors import BadReply, WrongInstrument

METER = """
maker = "ACME"
model = ["P5", "P6"]
check = [{ ask = ":SPAN?", is = 0 }]
prepare = ":SPAN 0"
[wire]
headers = ["LEV:AMPL"]
[identity]
ask = "*IDN?"
answer = "{maker},{model},{serial}"
[errors]
ask = ":ERR?"
[reader]
unit = "V"
reading = ":SENS:VOLT?"
"""


def heard(it, answers):
    asked = it.it._talk.line.query_lines
    it.it._talk.line.query_lines = lambda line, *a, **k: [answers[line]] if line in answers else asked(line, *a, **k)


def test_headers_are_taken_off_identity_settings_errors_and_readings():
    it = DeclaredBench(METER)
    assert it.it.identify().model == "P5"
    it.it.prepare()
    it.it.start(2)
    assert len(it.it.fetch()["input"]) == 2
    said = b"".join(data for direction, data in it.wire if direction == "rx").decode().split("\n")
    assert said[0].startswith("*IDN ACME,P5,")
    assert {":SPAN 0.000000000E+00", ":ERR 0,No error"} <= {
        line.replace('"', "").replace("+0.0", "0.0") for line in said
    }
    assert said[-3].startswith(":SENS:VOLT ")
    it.close()


@pytest.mark.parametrize("answer", [":SENS:VOLT 1.5", ":SENS:VOLT:LEV:AMPL 1.5", ":sens1:volt 1.5", "1.5"])
def test_a_header_may_be_spelt_out_or_left_out(answer):
    it = DeclaredBench(METER)
    heard(it, {":SENS:VOLT?": answer})
    it.it.start(1)
    assert it.it.fetch()["input"] == [1.5]
    it.close()


@pytest.mark.parametrize("answer", [":SENS:CURR 1.5", ":SENS2:VOLT 1.5", ":SENS:VOLT:RANG 10"])
def test_an_answer_to_another_question_is_no_reading(answer):
    it = DeclaredBench(METER)
    heard(it, {":SENS:VOLT?": answer})
    it.it.start(1)
    with pytest.raises(BadReply, match=f"answered '{answer}' to .*; expected :SENS:VOLT and a value"):
        it.it.fetch()
    it.close()


@pytest.mark.parametrize(
    ("answer", "model"), [("GE ACME,p6,1", "P6"), ("Acme Ltd,P5,1", "P5"), ("ACMES,P5,1", ""), ("ACME,P55,1", "")]
)
def test_capitals_of_models_and_words_beside_a_maker_do_not_matter(answer, model):
    it = DeclaredBench(METER)
    heard(it, {"*IDN?": f"*IDN {answer}"})
    if model:
        assert it.it.identify().model == model
    else:
        with pytest.raises(WrongInstrument, match="should be a ACME P5 or P6"):
            it.it.identify()
    it.close()


@pytest.mark.parametrize(("end", "sent"), [("lf", b"\n"), ("cr", b"\r"), ("crlf", b"\r\n")])
def test_answers_end_as_the_lines_of_the_bench(end, sent):
    it = DeclaredBench(METER, more=f'line_end = "{end}"')
    assert it.it.identify().model == "P5"
    every = [data for direction, data in it.wire if direction == "rx"]
    assert b"".join(every).endswith(sent)
    it.close()


def test_a_file_whose_role_is_in_python_needs_none():
    lacking = METER.partition("[reader]")[0]
    with pytest.raises(ValueError, match="a role is missing"):
        parse(lacking)
    assert parse(f"in_python = true\n{lacking}").reader is None
