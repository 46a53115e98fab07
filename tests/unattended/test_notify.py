"""Messages to people: over a real mail server, real HTTP and real programs on this machine; limits; failures."""

from __future__ import annotations

import base64
import email.header
import email.policy
import http.server
import json
import socketserver
import sys
import threading
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from command import rig
from dry import LAB
from fake_lines import serving
from small_run import write_small

from rig.engine.session import Progress
from rig.errors import ConfigurationError
from rig.run_file.read.reader import RunReader
from rig.unattended import Happening, Kind, Listeners, RunFacts
from rig.unattended.notify import Failure, Notifier, NotifySettings, NotSent, compose, read_settings, sender

FACTS = RunFacts(Path("/runs/night-1.sqlite"), "night-1", "lab", "night", simulated=True)
NEWS = Progress("holding", 12, 30, 7200.0, 3600.0, "")
HELD = Happening(Kind.HOLD, "warning", "held at point 17: no reply from the head", 1_768_442_580.0, 7200.0)


def channel(**values):
    return NotifySettings.model_validate({"channel": [values]}).channel[0]


class MailServer(socketserver.ThreadingTCPServer):
    """As much of RFC 5321 as smtplib asks for; turns the first `busy` messages away with 451."""

    daemon_threads = True

    def __init__(self, busy=0):
        super().__init__(("127.0.0.1", 0), MailSession)
        self.mails, self.recipients, self.busy = [], [], busy

    @property
    def port(self):
        return self.server_address[1]


class MailSession(socketserver.StreamRequestHandler):
    def handle(self):
        self.say("220 here")
        while line := self.rfile.readline().decode().strip():
            verb = line.split()[0].upper()
            if verb == "RCPT":
                self.server.recipients.append(line.partition(":")[2].strip("<> "))
            if verb == "MAIL" and self.server.busy:
                self.server.busy -= 1
                self.say("451 later")
            elif verb == "DATA":
                self.say("354 go on")
                lines = iter(lambda: self.rfile.readline().decode().rstrip("\r\n"), ".")
                self.server.mails.append("\n".join(lines))
                self.say("250 taken")
            elif verb == "QUIT":
                self.say("221 bye")
                return
            else:
                self.say("250 ok")

    def say(self, text):
        self.wfile.write(text.encode() + b"\r\n")


@dataclass
class Received:
    path: str
    headers: dict
    content: dict


class Hook(http.server.ThreadingHTTPServer):
    """Remembers what is posted; answers with the codes of `answers`, then with 200."""

    def __init__(self, answers=()):
        super().__init__(("127.0.0.1", 0), HookRequest)
        self.received, self.answers = [], list(answers)

    def url(self, path="/rig"):
        return f"http://127.0.0.1:{self.server_port}{path}"


class HookRequest(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        content = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.received.append(Received(self.path, dict(self.headers), content))
        self.send_response(self.server.answers.pop(0) if self.server.answers else 200)
        self.send_header("Location", self.server.url("/elsewhere"))
        self.end_headers()

    do_GET = do_POST

    def log_message(self, *_):
        pass


def mail_channel(server, **more):
    values = {"kind": "mail", "to": ["a@lab.example", "b@lab.example"], "sender": "rig@lab.example"}
    return channel(**values, host="127.0.0.1", port=server.port, **{"security": "none", **more})


def test_a_mail_says_what_where_when_how_far_and_what_next():
    with serving(MailServer()) as server:
        sender(mail_channel(server))(compose(HELD, FACTS, NEWS))
    (mail,) = server.mails
    assert server.recipients == ["a@lab.example", "b@lab.example"]
    assert "Subject: SIMULATED lab: held\n" in mail
    assert "Auto-Submitted: auto-generated\n" in mail
    for words in (
        "held at point 17: no reply from the head",
        "bench lab, procedure night, machine ",
        "2026-01-15 02:03 UTC",
        "12 of 30 points in 2 h 00 min, about 60 min left",
        "rig release /runs/night-1.sqlite",
    ):
        assert words in mail


@pytest.mark.parametrize(
    "bench",
    [
        "=?utf-8?q?x=0D=0AReply-To=3A_evil=40example.com=0D=0A=0D=0AA_body?=",
        "=?utf-8?b?" + base64.b64encode(b"x\r\nBcc: evil@example.com\r\n\r\nA body").decode() + "?=",
        "x\r\nBcc: evil@example.com",
        "Prüfstand 7 – Übertemperatur, äöü, \u0394p und noch ein langer Name",
        "\ud800 half a character",
    ],
)
def test_a_benchs_name_never_becomes_a_header(bench):
    with serving(MailServer()) as server:
        sender(mail_channel(server))(compose(HELD, replace(FACTS, bench=bench), NEWS))
    (raw,) = server.mails
    head = raw.partition("\n\n")[0]
    assert head.isascii()
    names = [line.partition(":")[0] for line in head.splitlines() if not line.startswith((" ", "\t"))]
    assert set(names) <= {
        *("Content-Type", "MIME-Version", "Content-Transfer-Encoding", "Subject", "From", "To", "Date"),
        *("Message-ID", "Auto-Submitted", "X-Priority"),
    }
    assert len(names) == len(set(names))
    read = email.message_from_string(raw, policy=email.policy.default)
    assert "Reply-To" not in read
    assert "Bcc" not in read
    said = "".join(
        text if isinstance(text, str) else text.decode(of or "ascii")
        for text, of in email.header.decode_header(email.message_from_string(raw)["Subject"])
    )
    headline = compose(HELD, replace(FACTS, bench=bench), NEWS).headline
    assert said.replace("\n", "") == " ".join("".join(c if c.isprintable() else " " for c in headline).split())


def test_a_mail_server_without_encryption_gets_nothing_unless_that_was_asked_for():
    with serving(MailServer()) as server, pytest.raises(NotSent, match="STARTTLS"):
        sender(mail_channel(server, security="starttls"))(compose(HELD, FACTS, NEWS))
    assert server.mails == []


def test_a_mail_server_that_is_not_there_is_named():
    with serving(MailServer()) as server:
        gone = mail_channel(server)
    with pytest.raises(NotSent, match=f"127.0.0.1 port {gone.port}"):
        sender(gone)(compose(HELD, FACTS, NEWS))


def test_names_from_files_cannot_add_headers_or_lines():
    facts = RunFacts(Path("/r/x\nBcc: z@z.example.sqlite"), "x", "lab\r\nBcc: z@z.example", "night", simulated=False)
    message = compose(HELD, facts, None)
    with serving(MailServer()) as server:
        sender(mail_channel(server))(message)
    assert server.recipients == ["a@lab.example", "b@lab.example"]
    assert not any(line.startswith("Bcc") for line in server.mails[0].splitlines())


SHAPES = {
    "json": lambda p, c: c["event"] == "hold" and c["urgent"] is True and c["run"] == "/runs/night-1.sqlite",
    "ntfy": lambda p, c: p == "/" and c["topic"] == "rig" and c["priority"] == 5 and "What next" in c["message"],
    "slack": lambda p, c: c["text"].startswith("*SIMULATED lab: held*") and "&lt;b&gt;" in c["text"],
    "teams": lambda p, c: c["attachments"][0]["content"]["body"][0]["text"] == "SIMULATED lab: held",
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_webhook_gets_the_shape_it_expects(shape):
    happening = Happening(Kind.HOLD, "warning", "held: <b> & more", 0.0)
    with serving(Hook()) as hook:
        sender(channel(kind="webhook", url=hook.url(), shape=shape))(compose(happening, FACTS, NEWS))
    (got,) = hook.received
    assert SHAPES[shape](got.path, got.content), got.content


def test_a_webhook_may_have_a_body_of_its_own_and_a_token(monkeypatch):
    monkeypatch.setenv("HOOK_TOKEN", "s3cret")
    body = {"title": "{headline}", "deep": [{"n": 1, "text": "{event} {{event}}"}]}
    with serving(Hook()) as hook:
        sender(channel(kind="webhook", url=hook.url(), body=body, token_env="HOOK_TOKEN"))(compose(HELD, FACTS, NEWS))
    (got,) = hook.received
    assert got.content == {"title": "SIMULATED lab: held", "deep": [{"n": 1, "text": "hold {event}"}]}
    assert got.headers["Authorization"] == "Bearer s3cret"


@pytest.mark.parametrize(("answer", "permanent"), [(404, True), (302, True), (503, False), (429, False)])
def test_a_webhook_that_refuses_is_a_failure_and_its_address_stays_secret(monkeypatch, answer, permanent):
    with serving(Hook([answer])) as hook:
        monkeypatch.setenv("HOOK_URL", hook.url("/T0/s3cret"))
        with pytest.raises(NotSent, match=f"the webhook answers HTTP {answer}") as caught:
            sender(channel(kind="webhook", url_env="HOOK_URL"))(compose(HELD, FACTS, NEWS))
    assert caught.value.permanent is permanent
    assert "s3cret" not in str(caught.value)
    assert len(hook.received) == 1


def test_a_command_is_run_without_a_shell(tmp_path):
    script = "import os, sys; open(sys.argv[1], 'w').write(sys.argv[2] + os.environ['RIG_EVENT'] + sys.stdin.read())"
    out = tmp_path / "told; rm -rf x"
    facts = RunFacts(None, "", "$(reboot)", "night", simulated=False)
    sender(channel(kind="command", argv=[sys.executable, "-c", script, str(out), "{headline}"]))(
        compose(HELD, facts, NEWS)
    )
    assert out.read_text().startswith("$(reboot): heldholdWhat:")


def test_a_command_that_hangs_is_ended_and_one_that_fails_says_why():
    hanging = channel(kind="command", argv=[sys.executable, "-c", "while True: pass"], timeout_s=0.2)
    with pytest.raises(NotSent, match=r"longer than 0.2 s"):
        sender(hanging)(compose(HELD, FACTS, NEWS))
    failing = channel(kind="command", argv=[sys.executable, "-c", "import sys; sys.exit('no modem')"])
    with pytest.raises(NotSent, match="ended with 1 no modem"):
        sender(failing)(compose(HELD, FACTS, NEWS))


# --- how often, and what becomes of failures --------------------------------------------------------------------------


class Watch:
    """A clock that stands still unless it is told otherwise."""

    def __init__(self):
        self.seconds = 0.0

    def now(self):
        return self.seconds


@dataclass
class Told:
    messages: list = field(default_factory=list)
    failures: list = field(default_factory=list)
    refusals: list = field(default_factory=list)

    def send(self, message):
        if self.refusals:
            raise self.refusals.pop(0)
        self.messages.append(message)


def notifier(told, clock=None, **settings):
    values = {"channel": [{"kind": "command", "argv": ["x"], "on": list(ALL)}], **settings}
    settings = NotifySettings.model_validate(values)
    sends = {"command": told.send}
    return Notifier(settings, sends, failed=told.failures.append, clock=clock or Watch(), pauses_s=(0.0, 0.0))


ALL = ("start", "crash", "hold", "fault", "warning", "ended-by-fault", "stop", "interrupt", "finish")


def happening(kind, text="it happened"):
    return Happening(kind, "warning", text, 0.0)


def test_repeated_faults_are_told_together_and_never_more_than_so_many_an_hour():
    told, clock = Told(), Watch()
    notes = notifier(told, clock, most_per_hour=6, repeats_s=600)
    for minute in range(120):
        clock.seconds = 60.0 * minute
        notes.happened(happening(Kind.FAULT, f"fault {minute}"), FACTS)
        notes.progress(NEWS, FACTS, 0.0)
    notes.happened(happening(Kind.FINISH), FACTS)
    notes.close(5.0)
    faults = [m for m in told.messages if m.kind is Kind.FAULT]
    assert 4 <= len(faults) <= 6, [m.also for m in faults]  # three an hour: half of six, the rest is for people
    assert sum(int(m.also.partition(" x fault")[0].rpartition(" ")[2] or 0) for m in told.messages if m.also) >= 110
    assert told.messages[-1].kind is Kind.FINISH
    assert "the latest: fault 119" in told.messages[-1].also


def test_what_a_person_is_waited_for_is_told_even_when_much_goes_wrong_and_the_end_always():
    told = Told()
    notes = notifier(told, most_per_hour=4, repeats_s=0)
    for kind in (*[Kind.FAULT] * 9, *[Kind.HOLD] * 5, Kind.ENDED_BY_FAULT):
        notes.happened(happening(kind), FACTS)
    notes.close(5.0)
    assert [m.kind for m in told.messages] == [Kind.FAULT] * 2 + [Kind.HOLD] * 2 + [Kind.ENDED_BY_FAULT]
    assert told.messages[-1].also.startswith("not sent one by one: 7 x fault, 3 x hold") or told.messages[2].also


def test_only_what_was_asked_for_and_only_of_these_benches():
    told = Told()
    only = {"kind": "command", "argv": ["x"], "on": ["finish"], "benches": ["lab"], "simulated": False}
    notes = Notifier(NotifySettings.model_validate({"channel": [only]}), {"command": told.send})
    real = RunFacts(None, "", "lab", "night", simulated=False)
    for facts in (FACTS, real, RunFacts(None, "", "other", "night", simulated=False)):
        notes.happened(happening(Kind.FINISH), facts)
        notes.happened(happening(Kind.HOLD), facts)
    notes.close(5.0)
    assert [m.headline for m in told.messages] == ["lab: finished"]


@pytest.mark.parametrize(
    ("refusals", "sent", "failed"),
    [
        ([NotSent("busy"), NotSent("busy")], 1, 0),
        ([NotSent("busy")] * 3, 0, 1),
        ([NotSent("no such address", permanent=True)], 0, 1),
        ([RuntimeError("a library's surprise")], 1, 0),
    ],
)
def test_attempts_are_bounded(refusals, sent, failed):
    told = Told(refusals=list(refusals))
    notes = notifier(told)
    notes.happened(happening(Kind.HOLD), FACTS)
    notes.close(5.0)
    assert (len(told.messages), len(told.failures)) == (sent, failed)


def test_a_server_that_never_answers_delays_nobody_and_is_reported():
    released, told = threading.Event(), Told()

    def hangs(_message):
        released.wait(20)

    settings = NotifySettings.model_validate({"channel": [{"kind": "command", "argv": ["x"]}]})
    notes = Notifier(settings, {"command": hangs}, failed=told.failures.append)
    for kind in (Kind.HOLD, Kind.CRASH):
        notes.happened(happening(kind), FACTS)
    notes.close(0.1)
    released.set()
    assert [(f.about, f.why) for f in told.failures] == [
        (Kind.HOLD, "the session ended before it could be sent"),
        (Kind.CRASH, "the session ended before it could be sent"),
    ]


# --- the file ---------------------------------------------------------------------------------------------------------

COMMAND = '[[channel]]\nkind = "command"\nargv = ["x"]\n'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[channel]]\nkind = "pigeon"\n', "pigeon"),
        (COMMAND + COMMAND, "two channels are called command"),
        (COMMAND.replace("argv", "arv"), "channel.0.command.arv is unknown here; did you mean argv"),
        (COMMAND.replace('"command"', '"comand"'), "channel.0.kind = 'comand' is unknown; did you mean 'command'"),
        (COMMAND.replace('kind = "command"', ""), "channel.0.kind is missing"),
        (COMMAND + 'on = ["party"]\n', "party"),
        (COMMAND + 'on = ["finsh"]\n', "'finsh' is unknown; did you mean 'finish'"),
        (COMMAND + 'simulated = "no"\n', "channel.0.command.simulated: should be true or false"),
        (COMMAND.replace('"x"', '"x", "{haedline}"'), r"argv.0: there is no {haedline}; did you mean {headline}"),
        ("most_per_hour = 10.5", "most_per_hour: should be a whole number"),
        ("[[chanel]]", "chanel is unknown here; did you mean channel"),
        (
            '[[channel]]\nkind = "webhook"\nurl = "http://x/"\nbody = { a = [{ b = "{mesage}" }] }\n',
            r"body.a.0.b: there is no {mesage}; did you mean {message}\?.*write {{mesage}}",
        ),
        ('[[channel]]\nkind = "webhook"\nurl = "file:///etc/passwd"\n', "must begin with http"),
        ('[[channel]]\nkind = "webhook"\nurl = "http://x/"\nurl_env = "X"\n', "give one of url, url_env, url_file"),
        (
            '[[channel]]\nkind = "mail"\nto = ["a@b"]\nsender = "c@d"\nhost = "h"\nuser = "u"\npassword_env = "P"\n'
            'security = "none"\n',
            "would send the password in clear",
        ),
        ('[[channel]]\nkind = "mail"\nto = ["a@b\\nBcc: x@y"]\nsender = "c@d"\nhost = "h"\n', "not a plain e-mail"),
    ],
)
def test_a_wrong_file_is_refused_with_what_is_wrong(tmp_path, text, says):
    path = tmp_path / "notify.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=says):
        read_settings(path)


def test_the_example_in_the_docs_is_a_file_that_works(tmp_path):
    document = (Path(__file__).parents[2] / "docs" / "how_to" / "unattended.md").read_text()
    path = tmp_path / "notify.toml"
    path.write_text(document.partition("```toml\n")[2].partition("```")[0])
    settings = read_settings(path)
    assert [c.label for c in settings.channel] == ["mail", "phone", "house", "command", "apprise"]
    assert (settings.most_per_hour, settings.repeats_s) == (10, 900.0)
    assert all(f"`{about}`" in document for about in ALL)


def test_a_missing_secret_is_named_before_anything_moves_but_does_not_end_a_resumed_night(tmp_path):
    path = tmp_path / "notify.toml"
    path.write_text('[[channel]]\nkind = "webhook"\nurl_env = "RIG_NO_SUCH_SECRET"\n')
    arguments = (write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path)
    refused = rig("run", *arguments, "--notify", "--notify-file", path)
    assert refused.returncode == 78
    assert "channel webhook: the environment variable RIG_NO_SUCH_SECRET is not set" in refused.stderr
    made = rig("run", *arguments, "--create-only")
    assert made.returncode == 0, made.stderr
    resumed = rig("resume", made.stdout.strip(), "--notify", "--notify-file", path)
    assert resumed.returncode == 0, resumed.stderr
    assert "nobody will be notified" in resumed.stderr


def test_what_could_not_be_told_is_in_the_run_file_and_in_the_log(tmp_path):
    path, log = tmp_path / "notify.toml", tmp_path / "night.log"
    bell = no_program(tmp_path)
    path.write_text(f'[[channel]]\nkind = "command"\nargv = ["{bell}"]\non = ["start", "finish"]\n')
    arguments = (write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path, "--log", log)
    done = rig("run", *arguments, "--notify", "--notify-file", path)
    assert done.returncode == 0, done.stderr
    with RunReader.open(Path(done.stdout.strip())) as reader:
        reader.verify()
        noted = [r.data for r in reader.records("event") if r.status == "not-notified"]
    assert [n["about"] for n in noted] == ["start"]
    assert str(bell) in noted[0]["why"]
    text = log.read_text()
    assert "command did not receive the message about start" in text
    assert "command did not receive the message about finish" in text
    assert f"command did not receive the message about start, finish: {bell}" in " ".join(done.stderr.split())


def no_program(folder):
    """A file that looks like a program until it is started."""
    bell = folder / "bell"
    bell.write_bytes(b"\0no program")
    bell.chmod(0o755)
    return bell


def test_messages_that_fail_when_the_run_is_over_are_told_at_the_terminal_and_the_run_is_done_all_the_same(tmp_path):
    path = tmp_path / "notify.toml"
    path.write_text(f'[[channel]]\nname = "bell"\nkind = "command"\nargv = ["{no_program(tmp_path)}"]\n')
    arguments = (write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path)
    done = rig("run", *arguments, "--notify", "--notify-file", path)
    assert done.returncode == 0, done.stderr
    assert "bell did not receive the message about finish" in done.stderr
    with RunReader.open(Path(done.stdout.strip())) as reader:
        reader.verify()
        assert [r.kind for r in reader.records()][-1] == "end"


def test_why_messages_fail_is_told_once_for_each_reason_and_of_many_reasons_not_all():
    listeners = Listeners(FACTS)
    for n in range(100):
        listeners.not_told(Failure("bell", Kind.FAULT, "no modem" if n % 2 else f"reason {n}"))
    said = listeners.close()
    assert "bell did not receive the message about fault (50 times): no modem" in said
    assert len(said) <= 21


@pytest.mark.parametrize(
    ("program", "says"),
    [
        ("no-such-program-of-ours", "there is no program no-such-program-of-ours in PATH"),
        ("/no/such/program", "there is no program /no/such/program"),
        ("./bell", "give its whole path"),
        ("{folder}/notify.toml", "chmod"),
    ],
)
def test_a_program_that_cannot_be_started_is_refused_before_anything_moves(tmp_path, program, says):
    path = tmp_path / "notify.toml"
    path.write_text(f'[[channel]]\nkind = "command"\nargv = ["{program.format(folder=tmp_path)}"]\n')
    arguments = (write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path / "runs")
    refused = rig("run", *arguments, "--notify", "--notify-file", path)
    assert refused.returncode == 78
    assert f"{path}: channel command: " in refused.stderr
    assert says in refused.stderr
    assert not (tmp_path / "runs").exists()
    seen = rig("doctor", "--notify-file", path, "--out", tmp_path, "--json")
    assert seen.returncode == 1
    assert says in seen.stdout


def test_a_resumed_run_leaves_out_the_channel_that_is_out_of_order_and_tells_the_others(tmp_path):
    path, log = tmp_path / "notify.toml", tmp_path / "night.log"
    told = '[[channel]]\nkind = "command"\nargv = ["true"]\n[[channel]]\nname = "bell"\nkind = "command"\n'
    path.write_text(told + 'argv = ["/no/such/program"]\n')
    made = rig("run", write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path, "--create-only")
    resumed = rig("resume", made.stdout.strip(), "--notify", "--notify-file", path, "--log", log)
    assert resumed.returncode == 0, resumed.stderr
    assert "nobody will be notified there" in resumed.stderr
    assert "channel bell: there is no program" in resumed.stderr
    assert "command was told: SIMULATED attitude-lab: finished" in log.read_text()
