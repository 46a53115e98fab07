"""`rig instrument`: a file held against its twin and against an instrument of others, begun, shown, looked for."""

from __future__ import annotations

import contextlib
import json
import signal
import socketserver
import subprocess
import sys
from pathlib import Path

import pytest
from command import rig
from fake_lines import answering
from test_declared import BATH

from rig.contracts.declared.beside import with_dbc
from rig.verbs.instrument.new import asked, form_of, lacking
from rig.verbs.instrument.scan import SCPI

EXAMPLES = 'examples = [["in_sp_00", "25.00"], ["out_mode_05 1", ""], ["version", "ACME B1 V2"]]\n'


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "bath.toml"
    path.write_text(EXAMPLES + BATH)
    return path


@pytest.fixture
def stranger():
    """A bath that this project did not write, by its manual: its answers have spaces, it does not obey at once."""
    state = {"sp": 25.0, "pv": 21.0, "on": 0}
    heard: list[str] = []

    class Lines(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            text = b""
            while data := self.request.recv(100):
                *lines, text = (text + data).split(b"\r")
                for line in lines:
                    heard.append(line.decode())
                    word, _, value = heard[-1].partition(" ")
                    if value:
                        state["sp" if word == "out_sp_00" else "on"] = float(value)
                        continue
                    state["pv"] = state["sp"] if state["on"] else state["pv"]
                    said = {
                        "version": "ACME B1 V3",
                        "in_sp_00": f" {state['sp']:6.2f}",
                        "in_pv_00": f"{state['pv']:6.2f}",
                    }
                    self.wfile.write(f"{said.get(word, f'{state[chr(111) + chr(110)]:.0f}')}\r\n".encode())

    with answering(Lines) as port:
        yield f"socket://127.0.0.1:{port}", heard


def test_a_file_is_held_against_its_twin_with_a_report(file, tmp_path):
    done = rig("instrument", "check", file, "--set", "40", "--report", tmp_path / "report.md")
    assert done.returncode == 0, done.stderr
    report = (tmp_path / "report.md").read_text()
    for words in (
        "- result: as its file says",
        "- asked: its twin",
        "## settle: ok",
        "> out_sp_00 40.00\\r",
        "SHA-256",
    ):
        assert words in report
    assert len(report.splitlines()) < 150


def test_a_real_one_is_asked_and_not_told_unless_that_is_wanted(file, stranger):
    address, heard = stranger
    done = rig("instrument", "check", file, "--address", address, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    (found,) = json.loads(done.stdout)
    assert [step["what"] for step in found["steps"]] == ["examples in the file", "identity", "state", "not watched"]
    assert found["steps"][-1]["found"] == (
        "nothing shows whether a command was refused (errors); a setting that is changed at its panel (check); that "
        "its power was off (mark)"
    )
    assert heard == ["version", "in_sp_00", "in_mode_05", "in_pv_00"]
    heard.clear()
    done = rig("instrument", "check", file, "--address", address, "--option", "dwell_s = 0", "--set", "30")
    assert done.returncode == 0, done.stdout + done.stderr
    assert [line for line in heard if line.startswith("out")] == ["out_sp_00 30.00", "out_mode_05 1", "out_mode_05 0"]


def test_a_value_that_is_refused_is_not_waited_for(file):
    done = rig("instrument", "check", file, "--set", "999", "--json")
    assert done.returncode == 1
    *_, last, safe = json.loads(done.stdout)[0]["steps"]
    assert (last["what"], last["ok"]) == ("set 999 degC", False)
    assert (safe["what"], safe["ok"]) == ("safe state", True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_instrument_is_left_safe_when_its_check_is_ended_while_it_settles(file, stranger, number):
    address, heard = stranger
    words = ["instrument", "check", str(file), "--address", address, "--set", "30"]
    process = subprocess.Popen([sys.executable, "-m", "rig", *words], stdout=subprocess.DEVNULL)
    while heard.count("in_pv_00") < 3:  # before it is set, after that, and settling
        with contextlib.suppress(subprocess.TimeoutExpired):
            raise AssertionError(f"it ended with {process.wait(0.05)}")
    process.send_signal(number)
    assert process.wait(20) == 130
    assert [line for line in heard if line.startswith("out")] == ["out_sp_00 30.00", "out_mode_05 1", "out_mode_05 0"]


def test_another_instrument_is_told_from_it_with_its_bytes(file, stranger):
    file.write_text(BATH.replace('"{maker} {model} V{firmware}"', '"OTHER {model}"'))
    done = rig("instrument", "check", file, "--address", stranger[0], "--json")
    assert done.returncode == 1
    step = json.loads(done.stdout)[0]["steps"][-1]
    assert (step["what"], step["ok"]) == ("identity", False)
    assert "answered 'ACME B1 V3' to 'version'" in step["found"]


def test_an_example_that_the_file_does_not_read_is_named(file):
    file.write_text('examples = [["in_sp_00", "25,00"], ["in_sp_99", "1"]]\n' + BATH)
    done = rig("instrument", "check", file, "--json")
    assert done.returncode == 1
    found = json.loads(done.stdout)[0]["steps"][0]["found"]
    assert "'25,00' is no answer to 'in_sp_00' as in source.setpoint; 'in_sp_99' is not in the file" in found


def test_a_wrong_file_says_all_that_it_lacks_and_ends_with_78(tmp_path):
    (tmp_path / "x.toml").write_text('[source]\nset = "SP {value}"\n')
    done = rig("instrument", "check", tmp_path / "x.toml")
    assert done.returncode == 78
    said = " ".join(done.stderr.split())
    assert all(word in said for word in ("model is missing", "identity is missing", "source.low", "source.high"))


@pytest.mark.parametrize(
    ("answer", "form"),
    [("S S     100.00 g", "S S {value} {unit}"), ("PV=25.0", "PV={value}"), ("OK", "OK"), ("+1.5E+00,V", "{value},V")],
)
def test_a_form_is_made_of_an_answer(answer, form):
    assert form_of(answer) == form


@pytest.mark.parametrize("address", ["/dev/ttyUSB99", "socket://127.0.0.1:1"])
def test_an_address_that_cannot_be_opened_is_a_finding_and_no_defect_of_the_program(tmp_path, address):
    (tmp_path / "b.toml").write_text(BATH)
    done = rig("instrument", "check", "b.toml", "--address", address, "--json", cwd=tmp_path)
    assert done.returncode == 1
    step = json.loads(done.stdout)[0]["steps"][-1]
    assert (step["what"], step["ok"]) == ("connection", False)
    assert "cannot be opened" in step["found"]


NEW = [("text", "reader"), ("text", "source"), ("stream", "reader"), ("modbus", "reader"), ("modbus", "source")]


@pytest.mark.parametrize(("wire", "role"), NEW)
def test_a_new_file_is_whole(wire, role):
    said = {"Does it take": wire, "Does it measure": role}
    text = asked(lambda question, assumed: next((a for q, a in said.items() if question.startswith(q)), assumed))
    assert lacking(text) == ""


CHANNELS = {"Does it measure": "reader", "Unit of": "V", "Its channels": "101 103"}


@pytest.mark.parametrize(
    ("more", "first"),
    [
        ({"Command that chooses channel 101": "ROUT:CLOS (@101)"}, "> ROUT:CLOS (@101)\\r\\nREAD?\\r\\n"),
        ({"Question for a reading of channel 101": "MEAS? (@101)"}, "> MEAS? (@101)\\r\\n"),
    ],
    ids=["a command chooses it", "the question names it"],
)
def test_channels_are_asked_for_and_a_check_reads_each(tmp_path, more, first):
    """No question was of channels, and a check of a file with channels read none of them: all was ok."""
    said = {**more, **CHANNELS}
    text = asked(lambda question, assumed: next((a for q, a in said.items() if question.startswith(q)), assumed))
    assert lacking(text) == ""
    (tmp_path / "m.toml").write_text(text)
    done = rig("instrument", "check", tmp_path / "m.toml", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    steps = {one["what"]: one for one in json.loads(done.stdout)[0]["steps"]}
    assert steps["examples in the file"]["found"] == "the file has none"
    read = steps["three readings of each channel"]
    channels = dict(one.split(": ") for one in read["found"].split("; "))
    assert set(channels) == {"101", "103"}
    assert all(len(one.removesuffix(" V").split(", ")) == 3 for one in channels.values())
    assert read["wire"][0] == first
    assert any("103" in one for one in read["wire"])


def test_registers_have_channels_too(tmp_path):
    """Only lines of text were asked for channels."""
    said = {"Does it take": "modbus", "Does it measure": "reader", "Its channels and their reg": "inlet=1 outlet=3"}
    text = asked(lambda question, assumed: next((a for q, a in said.items() if question.startswith(q)), assumed))
    (tmp_path / "m.toml").write_text(text)
    done = rig("instrument", "check", tmp_path / "m.toml", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    steps = {one["what"]: one for one in json.loads(done.stdout)[0]["steps"]}
    channels = dict(one.split(": ") for one in steps["three readings of each channel"]["found"].split("; "))
    assert set(channels) == {"inlet", "outlet"}


def test_a_real_meter_that_has_to_be_started_is_not_and_its_check_says_so(file, stranger):
    reader = (
        '[reader]\nunit = "degC"\nstart = "GO {count:d}"\nfetch = { ask = "in_pv_00", answer = "{value}" }\nmost = 1\n'
    )
    file.write_text(f"{BATH.partition('[source]')[0]}{reader}")
    done = rig("instrument", "check", file, "--address", stranger[0], "--json")
    step, unseen = json.loads(done.stdout)[0]["steps"][-2:]
    assert step["found"] == "none: reader.start is a command, and only questions are sent", done.stdout + done.stderr
    assert unseen["found"].endswith("an answer to an earlier question for a reading (reader.number, reader.confirm)")
    assert "GO 3" not in stranger[1]


@pytest.mark.parametrize(
    ("role", "more"),
    [
        ("reader", {"Signal of the reading": "State.Actual"}),
        ("reader", {"Its channels and their signals": "is=State.Actual was=State.Setpoint"}),
        ("source", {}),
    ],
)
def test_a_new_file_with_messages_is_whole_beside_its_dbc(role, more):
    dbc = (Path(__file__).parents[2] / "docs" / "how_to" / "can.md").read_text().split("```text my_chamber.dbc\n")[1]
    dbc = (
        dbc.split("```")[0]
        .replace("SG_ Mode", "SG_ Enabled")
        .replace('VAL_ 512 Mode 0 "Idle" 1 "Running" 2 "Defrosting" ;', "")
    )
    said = {"Does it take": "can", "Does it measure": role, **more}
    text = asked(lambda question, assumed: next((a for q, a in said.items() if question.startswith(q)), assumed))
    assert lacking(with_dbc(text, lambda name: dbc.encode())) == ""
    assert "was not read" in lacking(text)


def test_a_scan_asks_who_is_there_and_nothing_else(stranger, monkeypatch):
    address, heard = stranger
    quick = BATH.replace("[wire]", "[wire]\ntimeout_s = 2")
    other = BATH.replace("[wire]", "[wire]\ntimeout_s = 0.05").replace('ask = "version"', 'ask = "*ver"')
    monkeypatch.setattr("rig.verbs.instrument.scan.SCPI", SCPI.replace("timeout_s = 1", "timeout_s = 0.05"))
    monkeypatch.setattr("rig.verbs.instrument.scan.declared", lambda: {"acme-b1": quick, "other": other})
    done = rig("instrument", "scan", address, "--json")
    assert [one["driver"] for one in json.loads(done.stdout)] == ["acme-b1"]
    assert not [line for line in heard if line.startswith("out")]


def test_a_silent_address_is_said_after_each_question_was_sent_once(monkeypatch):
    """Each of a dozen questions was waited for twice, which took half a minute, and nothing said why."""
    heard = bytearray()

    class Silent(socketserver.BaseRequestHandler):
        def handle(self):
            while data := self.request.recv(999):
                heard.extend(data)

    monkeypatch.setattr("rig.verbs.instrument.scan.LISTENS_S", 0.05)
    with answering(Silent) as port:
        done = rig("instrument", "scan", f"socket://127.0.0.1:{port}")
    assert done.returncode == 1
    assert "is silent: nothing came back to" in done.stderr
    assert "nobody answers who is known" not in done.stderr
    assert [heard.count(one) for one in (b"*IDN?\n", b"*IDN?\r\n", b"version\r", b"I4\r\n")] == [1, 1, 1, 1]


def test_all_are_listed_and_one_is_shown(file):
    listed = rig("instrument", "list", "--json")
    assert {
        "driver": "person",
        "is": "in Python",
        "roles": "reader, person",
        "wire": "none",
        "tried": "see its page",
    } in (json.loads(listed.stdout))
    shown = rig("instrument", "show", file).stdout
    assert "| source.set | `out_sp_00 {value:.2}` |" in shown
    assert rig("instrument", "show", "nothing").returncode == 2
