"""An identity whose text can be split in two ways is refused, and said how to write it."""

from __future__ import annotations

import pytest
from fake_lines import served

from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import parse
from rig.contracts.declared.replay import replayed
from rig.verbs.instrument.check import check

METER = """
maker = "DH ACME"
model = "T1"
[identity]
ask = "ID?"
answer = "FORM"
[reader]
unit = "V"
reading = "READ?"
"""


def identity(form: str, says: bytes) -> tuple[bool, str]:
    with served({"ID?": says + b"\n", "READ?": b"1\n"}.get) as address:
        steps = {step.what: step for step in check(METER.replace("FORM", form), "m", address, {}, None, 1.0).steps}
    return steps["identity"].ok, steps["identity"].found


def test_a_model_with_a_space_is_not_cut_in_two():
    """A T1 XL was taken for a T1 with the firmware XL 1.2."""
    ok, said = identity("{model} {firmware}", b"T1 XL 1.2")
    assert not ok
    assert "answered 'T1 XL 1.2' to 'ID?'" in said
    assert "model 'T1' and firmware 'XL 1.2', or model 'T1 XL' and firmware '1.2'" in said
    assert "such as answer = 'T1 {firmware}'" in said
    assert identity("T1 {firmware}", b"T1 2.0") == (True, "DH ACME T1, no serial number, firmware 2.0")


@pytest.mark.parametrize(
    ("form", "says"),
    [
        ("{maker} {model} V{firmware}", b"DH ACME T1 V1.2"),  # its maker is known, and has a space, too
        ("{model} {firmware}", b"T1 1.2"),
        ("{maker},{model},{serial},{firmware}", b"DH ACME,T1,12,1.0 of 5 May"),
        ("{model}, {text}", b"T1, rev 5, of May"),
    ],
)
def test_an_identity_with_one_way_to_read_it_is_read(form, says):
    ok, said = identity(form, says)
    assert ok, said
    assert said.startswith("DH ACME T1, ")


@pytest.mark.parametrize(
    ("form", "line", "other"),
    [
        ("{model}{firmware}", "AB", {"model": "AB", "firmware": ""}),
        ("{text} V{firmware}", "a V1 V2", {"text": "a V1", "firmware": "2"}),
        ("{} {serial}", "a b c", {"serial": "c"}),
        ("{text} {value:d}", "a 1 2", None),
        ("{model} {firmware}", "T1 1.2", None),
    ],
)
def test_every_other_split_is_found(form, line, other):
    assert Form(form).otherwise(line) == other


def test_an_example_in_the_file_with_two_ways_is_a_finding():
    table = parse('examples = [["ID?", "T1 XL 1.2"]]' + METER.replace("FORM", "{model} {firmware}"))
    assert [said.partition(":")[0] for said in replayed(table)] == [
        "'T1 XL 1.2' can be split by its form in identity in two ways"
    ]
