"""`rig instrument check` at a real address, without preparing: what is read is told one by one."""

from __future__ import annotations

import json

from command import rig
from declared_bench import DeclaredBench
from fake_lines import served

from rig.verbs.instrument.check import check

SET_UP = r"""
maker = "ACME"
model = "M1"
prepare = ["RANGE 10", "FILTER ON", "AUTO 0", "ZERO"]
check = [{ ask = "RANGE?", is = 10 }, { ask = "FILTER?", is = "ON" }, { ask = "RATE?", is = 5, timeout_s = 0.05 }]
healthy = [{ ask = "FUSE?", is = 1 }]
[identity]
ask = "ID?"
[reader]
unit = "V"
reading = "READ?"
"""
SAID = {"ID?": b"ACME M1\n", "RANGE?": b"1\n", "FILTER?": b"ON\n", "FUSE?": b"1\n", "READ?": b"1.25\n"}
SAID["ID?"] = b"ACME,M1,1,2\n"


def test_each_setting_is_the_same_or_differs_or_was_not_read(tmp_path):
    heard = []
    (tmp_path / "m.toml").write_text(SET_UP)

    def answer(line: str) -> bytes | None:
        heard.append(line)
        return SAID.get(line)

    with served(answer) as address:
        done = rig("instrument", "check", "m.toml", "--address", address, "--json", cwd=tmp_path)
        shown = rig("instrument", "check", "m.toml", "--address", address, cwd=tmp_path)
    assert not {"RANGE 10", "FILTER ON", "AUTO 0", "ZERO"} & set(heard)
    (found,) = json.loads(done.stdout)
    said = {step["what"]: step for step in found["steps"]}["settings"]["found"].split("; ")
    assert said[0] == "RANGE? answers 1: differs, 10 is declared"
    assert said[1] == "FILTER? answers ON: same"
    assert said[2].startswith("RATE?: not read, ")
    assert "answered nothing to 'RATE?'" in said[2]
    assert said[-3:] == [
        "AUTO 0: not read, no question of `check` asks for it",
        "ZERO: not read, no question of `check` asks for it",
        "FUSE? answers 1: same",
    ]
    assert (done.returncode, found["ok"]) == (0, True)
    verdict = "as its file says, but 1 setting differs: it is not prepared (--prepare prepares it)"
    assert found["verdict"] == verdict
    assert verdict in " ".join(shown.stderr.split())
    assert "DIFFERS" in shown.stdout


def test_settings_that_are_all_the_same_need_no_doubt():
    said = SAID | {"RANGE?": b"10\n"}
    text = SET_UP.replace(', "AUTO 0", "ZERO"', "").replace(', { ask = "RATE?", is = 5, timeout_s = 0.05 }', "")
    with served(said.get) as address:
        found = check(text, "m", address, {}, None, 1.0)
    assert found.verdict == "as its file says"
    assert {step.what: step for step in found.steps}["three readings"].found == "input: 1.25, 1.25, 1.25 V"


def test_a_register_that_preparing_writes_is_read():
    text = """
    maker = "ACME"
    model = "C1"
    prepare = [{ register = 15, value = 3 }, { register = 9, table = "coil", value = 1 }]
    check = [{ register = 9, table = "discrete", is = 1 }]
    [wire]
    protocol = "modbus"
    [identity]
    register = 122
    is = 532
    [reader]
    unit = "degC"
    reading = { register = 1, type = "float32" }
    """
    it = DeclaredBench(text, protocol="modbus")
    try:
        assert [(one.asked, one.found, one.declared, one.same) for one in it.it.compared()] == [
            ("register 9", "0", "1", False),
            ("register 15", "0", "3", False),
        ]
        it.it.prepare()
        assert all(one.same for one in it.it.compared())
    finally:
        it.close()
