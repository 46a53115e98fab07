"""Messages to servers that mean harm or are broken: one deadline, one sentence, no address and no token in it."""

from __future__ import annotations

import base64
import contextlib
import json
import logging
import socket
import socketserver
import struct
import sys
import threading
import types
from pathlib import Path

import pytest
from command import rig

from rig.drivers.clock import RealClock
from rig.errors import ConfigurationError
from rig.unattended import Happening, Kind, RunFacts
from rig.unattended.notify import (
    Notifier,
    NotifySettings,
    NotSent,
    compose,
    read_settings,
    secret_files,
    sender,
    senders,
)

FACTS = RunFacts(Path("/runs/night-1.sqlite"), "night-1", "lab", "night", simulated=True)
MESSAGE = compose(Happening(Kind.HOLD, "warning", "held at point 17", 0.0), FACTS, None)
SECRET, TOKEN, PASSWORD = "s3cretpath", "t0kentoken", "pa55word"
TIMEOUT_S = 0.3
PATIENCE_S = 60.0
SLACK_S = 2.0  # for a busy machine; a time-out of single reads would take as long as the servers dribble


class Hostile(socketserver.ThreadingTCPServer):
    """Does to everybody who connects what it was made for."""

    daemon_threads = True
    block_on_close = True

    def __init__(self, act):
        self.act, self.over, self.connections = act, threading.Event(), 0
        super().__init__(("127.0.0.1", 0), Visit)

    @property
    def port(self):
        return self.server_address[1]


class Visit(socketserver.BaseRequestHandler):
    def handle(self):
        self.server.connections += 1
        with contextlib.suppress(OSError):
            self.server.act(self)

    def heard(self):
        return self.request.recv(65536)

    def say(self, data):
        self.request.sendall(data)

    def endlessly(self, data):
        while not self.server.over.is_set():
            self.say(data)

    def dribble(self, data=b"x"):
        while not self.server.over.wait(0.05):
            self.say(data)

    def wait(self):
        self.server.over.wait(30)

    def reset(self):
        self.request.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.request.close()


@contextlib.contextmanager
def hostile(act):
    server = Hostile(act)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.over.set()
        server.shutdown()
        thread.join()
        server.server_close()


def after_request(*acts):
    def act(visit):
        visit.heard()
        for one in acts:
            one(visit)

    return act


def answers(data):
    return after_request(lambda v: v.say(data))


def smtp(steps):
    """A mail server that says each line when it is time for it; a callable acts instead."""

    def act(visit):
        for step in steps:
            if callable(step):
                step(visit)
            else:
                visit.say(step)
                visit.heard()

    return act


GREETED = (b"220 here\r\n", b"250-here\r\n250 AUTH PLAIN\r\n")
OK = b"HTTP/1.1 200 OK\r\n"

NEVER_ENDING_HTTP = {
    "never answers": after_request(Visit.wait),
    "does not even read": Visit.wait,
    "dribbles from the first byte": after_request(Visit.dribble),
    "dribbles a header": after_request(lambda v: v.say(OK + b"X-A: "), Visit.dribble),
    "dribbles headers": after_request(lambda v: v.say(OK), lambda v: v.dribble(b"X-A: b\r\n")),
    "goes on with 100 Continue": after_request(lambda v: v.endlessly(b"HTTP/1.1 100 Continue\r\n\r\n")),
}
NEVER_ENDING_SMTP = {
    "never greets": Visit.wait,
    "dribbles a greeting": Visit.dribble,
    "dribbles lines of a greeting": lambda v: v.dribble(b"220-here\r\n"),
    "dribbles an answer": smtp([b"220 here\r\n", Visit.dribble]),
    "never takes the text": smtp([*GREETED, *[b"250 ok\r\n"] * 2, b"354 go on\r\n", Visit.wait]),
}


def webhook(port, scheme="http", **more):
    return {"kind": "webhook", "url": f"{scheme}://127.0.0.1:{port}/{SECRET}", "token_env": "HOOK_TOKEN", **more}


def mail(port, **more):
    people = {"to": ["a@lab.example"], "sender": "rig@lab.example"}
    return {"kind": "mail", **people, "host": "127.0.0.1", "port": port, "security": "none", **more}


def channel(values):
    return NotifySettings.model_validate({"channel": [values]}).channel[0]


@pytest.fixture(autouse=True)
def token(monkeypatch):
    monkeypatch.setenv("HOOK_TOKEN", TOKEN)
    monkeypatch.setenv("MAIL_PASSWORD", PASSWORD)


def assert_plain(text):
    assert text
    assert "\n" not in text
    assert len(text) <= 300
    for secret in (SECRET, TOKEN, PASSWORD, base64.b64encode(PASSWORD.encode()).decode().strip("=")):
        assert secret not in text


def test_servers_that_never_come_to_an_end_are_given_up_in_time_and_hold_nobody_up():
    clock, failures = RealClock(), []
    with contextlib.ExitStack() as stack:
        channels = []
        for acts, settings in ((NEVER_ENDING_HTTP, webhook), (NEVER_ENDING_SMTP, mail)):
            for name, act in acts.items():
                server = stack.enter_context(hostile(act))
                channels.append(settings(server.port, name=f"{name} {settings.__name__}", timeout_s=TIMEOUT_S))
        for name in ("never greets", "dribbles a greeting"):  # where encryption should begin
            server = stack.enter_context(hostile(NEVER_ENDING_SMTP[name]))
            channels.append(webhook(server.port, "https", name=f"{name} https", timeout_s=TIMEOUT_S))
            channels.append(mail(server.port, name=f"{name} ssl", security="ssl", timeout_s=TIMEOUT_S))
        settings = NotifySettings.model_validate({"channel": channels})
        sends, wrong = senders(settings, "notify.toml")
        assert wrong == []
        notes = Notifier(settings, sends, failed=failures.append, pauses_s=())
        began = clock.now()
        notes.happened(Happening(Kind.HOLD, "warning", "held", 0.0), FACTS)
        handed_over = clock.now()
        notes.close(PATIENCE_S)
        ended = clock.now()
    assert handed_over - began < TIMEOUT_S
    assert ended - began < TIMEOUT_S + SLACK_S
    assert {f.channel for f in failures} == {c["name"] for c in channels}
    for failure in failures:
        assert_plain(failure.why)
        if not failure.channel.endswith((" https", " ssl")):  # there a first byte may already show that it is no TLS
            assert "no complete answer within 0.3 s" in failure.why, failure


HTTP = {
    "a line without end": (after_request(lambda v: v.endlessly(b"x" * 65536)), "cannot be understood"),
    "a header without end": (
        after_request(lambda v: v.say(OK + b"X-A: "), lambda v: v.endlessly(b"x" * 65536)),
        "cannot be understood",
    ),
    "10,000 headers": (answers(OK + b"".join(b"X-%d: 1\r\n" % n for n in range(10_000)) + b"\r\n"), "be understood"),
    "another protocol": (answers(b"SSH-2.0-OpenSSH_9.6\r\n"), "cannot be understood"),
    "a reset": (after_request(Visit.reset), "reset|closed"),
    "a reset in the middle": (after_request(lambda v: v.say(OK + b"X-"), Visit.reset), "reset|closed|understood"),
    "the end in the middle": (answers(b"HTTP/1.1 "), "closed|understood"),
    "an error that repeats the address": (
        answers(f"HTTP/1.1 403 {SECRET} {TOKEN}\r\nContent-Length: 0\r\n\r\n".encode()),
        "answers HTTP 403 Forbidden",
    ),
    "an error in bad chunks": (
        answers(b"HTTP/1.1 500 x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nzz\r\n"),
        "answers HTTP 500 Internal",
    ),
}


@pytest.mark.parametrize("name", HTTP)
def test_a_webhook_that_answers_nonsense_fails_in_a_sentence(name):
    act, says = HTTP[name]
    with hostile(act) as server, pytest.raises(NotSent, match=says) as caught:
        sender(channel(webhook(server.port, timeout_s=PATIENCE_S)))(MESSAGE)
    assert_plain(str(caught.value))
    assert server.connections == 1


def test_a_redirect_is_not_followed_and_its_target_not_told():
    def act(visit):
        visit.heard()
        where = f"http://127.0.0.1:{visit.server.port}/{SECRET}"
        visit.say(f"HTTP/1.1 307 {where}\r\nLocation: {where}\r\nContent-Length: 0\r\n\r\n".encode())

    with hostile(act) as server, pytest.raises(NotSent, match="answers HTTP 307 Temporary Redirect") as caught:
        sender(channel(webhook(server.port, timeout_s=PATIENCE_S)))(MESSAGE)
    assert_plain(str(caught.value))
    assert caught.value.permanent
    assert server.connections == 1


@pytest.mark.parametrize("rest", [b"Transfer-Encoding: chunked\r\n\r\nzz\r\n", b"Content-Length: 99999\r\n\r\nx"])
def test_a_webhook_that_took_the_message_has_it_whatever_follows(rest):
    with hostile(after_request(lambda v: v.say(OK + rest), Visit.dribble)) as server:
        sender(channel(webhook(server.port, timeout_s=PATIENCE_S)))(MESSAGE)
    assert server.connections == 1


SMTP = {
    "a line without end": (lambda v: v.endlessly(b"x" * 65536), "answers 500"),
    "lines without end": (lambda v: v.endlessly(b"220-here\r\n" * 1000), "no end"),
    "an answer without end": (smtp([b"220 here\r\n", lambda v: v.endlessly(b"250-here\r\n" * 1000)]), "no end"),
    "a reset": (Visit.reset, "reset|closed"),
    "a reset in the middle": (smtp([*GREETED, b"250 ok\r\n", Visit.reset]), "reset|closed"),
    "an answer that is no number": (lambda v: v.say(b"hello\r\n" * 2), "does not speak SMTP"),
}


@pytest.mark.parametrize("name", SMTP)
def test_a_mail_server_that_answers_nonsense_fails_in_a_sentence(name):
    act, says = SMTP[name]
    with hostile(act) as server, pytest.raises(NotSent, match=says) as caught:
        sender(channel(mail(server.port, timeout_s=PATIENCE_S)))(MESSAGE)
    assert_plain(str(caught.value))


def test_a_mail_that_was_taken_is_sent_though_the_server_never_says_goodbye():
    steps = [*GREETED, *[b"250 ok\r\n"] * 2, b"354 go on\r\n", b"250 taken\r\n", Visit.wait]
    with hostile(smtp(steps)) as server:
        sender(channel(mail(server.port, timeout_s=TIMEOUT_S * 3)))(MESSAGE)
    assert server.connections == 1


def test_a_mail_server_that_repeats_the_password_is_not_repeated(monkeypatch):
    def act(visit):
        visit.say(b"220 here\r\n")
        visit.heard()
        visit.say(b"250-here\r\n250 AUTH PLAIN\r\n")
        words = visit.heard().strip()
        visit.say(b"535 no: " + words + b" " + PASSWORD.encode() + b"\r\n")

    monkeypatch.setattr("smtplib.SMTP.starttls", lambda self, **_: None)  # a certificate would be needed
    secured = {"security": "starttls", "user": "rig", "password_env": "MAIL_PASSWORD", "timeout_s": PATIENCE_S}
    with hostile(act) as server, pytest.raises(NotSent, match=r"answers 535 no: AUTH PLAIN \*\*\* \*\*\*") as caught:
        sender(channel(mail(server.port, **secured)))(MESSAGE)
    assert_plain(str(caught.value))


# --- what is wrong with notify.toml is said without repeating it ------------------------------------------------------

HOOK = '[[channel]]\nkind = "webhook"\n'
WRONG_FILES = [
    HOOK + f'url = ["https://h/{SECRET}"]\n',
    HOOK + f'url = "https://user:{SECRET}@h/"\n',
    HOOK + f'url = "https://h:{SECRET}/"\n',
    HOOK + f'url = "http://[{SECRET}/"\n',
    HOOK + f'url = "http://h\u2100{SECRET}/"\n',
    HOOK + f'url = "ftp://h/{SECRET}"\n',
    HOOK + f'url = "http://h/{SECRET} x"\n',
    HOOK + f'url = "http://{"h" * 64}.example/{SECRET}"\n',
    HOOK + f"url = https://h/{SECRET}\n",
    HOOK + f'url = "http://h/"\nshape = "{SECRET}"\n',
    HOOK + f'url = "http://h/"\ntoken_env = ["{SECRET}"]\n',
    HOOK + f'url = "http://h/"\nsimulated = "{SECRET}"\n',
    f'[[channel]]\nkind = "https://h/{SECRET}"\n',
    f'channel = ["https://h/{SECRET}"]\n',
    f'[[channel]]\nkind = "mail"\nhost = "https://h/{SECRET}"\nsender = "a@b"\nto = ["a@b"]\n',
    f'[[channel]]\nkind = "mail"\nhost = "h"\nsender = "https://h/{SECRET}"\nto = ["a@b"]\n',
]
WRONG_PLACES = [
    {"url_env": f"https://h/{SECRET}"},
    {"url_file": f"https://h/{SECRET}"},
    {"url_file": f"x\0{SECRET}"},
    {"url": "http://h/", "token_env": SECRET},
    {"url": "http://h/", "token_file": SECRET},
    {"url": "http://h/", "token_file": SECRET * 500},  # longer than a file's name may be
    {"url": "http://h/", "token_file": f"~{SECRET}"},
    {"url": "http://h/", "shape": "ntfy"},
]


@pytest.mark.parametrize("text", WRONG_FILES)
def test_a_wrong_file_is_refused_without_its_secrets(tmp_path, text):
    path = tmp_path / "notify.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        read_settings(path)
    assert str(path) in str(caught.value)
    assert SECRET not in str(caught.value)
    assert caught.value.__cause__ is None or SECRET not in str(caught.value.__cause__)


@pytest.mark.parametrize("values", WRONG_PLACES)
def test_a_secret_where_its_place_belongs_is_not_repeated(values):
    settings = NotifySettings.model_validate({"channel": [{"kind": "webhook", **values}]})
    assert secret_files(settings) == []
    with pytest.raises(ConfigurationError) as caught:
        sender(settings.channel[0])
    assert_plain(str(caught.value))


@pytest.mark.parametrize("value", [f"{TOKEN}\nX-A: b", f"{TOKEN}\u00e4", f"{TOKEN}\x7f"])
def test_a_token_that_no_header_takes_is_refused_without_repeating_it(monkeypatch, value):
    monkeypatch.setenv("HOOK_TOKEN", value)
    with pytest.raises(ConfigurationError, match="one line of plain ASCII") as caught:
        sender(channel(webhook(9)))
    assert_plain(str(caught.value))


@pytest.mark.parametrize("address", [f"http://h/{SECRET}\n", f"https://u:{SECRET}@h/", f"http://h:{SECRET}/", SECRET])
def test_an_address_in_the_environment_is_refused_without_repeating_it(monkeypatch, address):
    monkeypatch.setenv("HOOK_URL", f"{address}\u00e4" if address.endswith("\n") else address)
    with pytest.raises(ConfigurationError) as caught:
        sender(channel({"kind": "webhook", "url_env": "HOOK_URL"}))
    assert_plain(str(caught.value))


def test_of_an_address_that_is_a_secret_not_even_the_host_is_told(monkeypatch):
    monkeypatch.setenv("HOOK_URL", f"http://{SECRET}.invalid/x")
    with pytest.raises(NotSent, match=r"the webhook: its name cannot be looked up|the webhook: no complete") as caught:
        sender(channel({"kind": "webhook", "url_env": "HOOK_URL", "timeout_s": 5}))(MESSAGE)
    assert_plain(str(caught.value))


def test_a_password_that_smtp_does_not_take_is_refused_without_repeating_it(monkeypatch):
    monkeypatch.setenv("MAIL_PASSWORD", PASSWORD + "ä")
    with pytest.raises(ConfigurationError, match="not ASCII") as caught:
        sender(channel(mail(9, security="ssl", user="rig", password_env="MAIL_PASSWORD")))
    assert_plain(str(caught.value))


def test_what_a_library_says_of_its_addresses_is_told_nobody(monkeypatch, caplog):
    class Library:
        def add(self, address):
            logging.getLogger("apprise").error("Unsupported URL: %s", address)
            return True

        def notify(self, **_):
            raise TypeError(f"cannot post to json://h/{SECRET}")

    module = types.ModuleType("apprise")
    module.Apprise, module.__spec__ = Library, types.SimpleNamespace()
    monkeypatch.setitem(sys.modules, "apprise", module)
    monkeypatch.setenv("ADDRESSES", f"json://h/{SECRET}")
    try:
        with pytest.raises(NotSent, match="TypeError") as caught:
            sender(channel({"kind": "apprise", "url_env": "ADDRESSES"}))(MESSAGE)
    finally:
        logging.getLogger("apprise").disabled = False
    assert_plain(str(caught.value))
    assert SECRET not in caplog.text


def test_a_program_that_repeats_an_address_from_its_arguments_is_not_repeated():
    said = [sys.executable, "-c", "import sys; sys.exit('cannot reach ' + sys.argv[1])", f"https://h/{SECRET}"]
    with pytest.raises(NotSent, match=r"cannot reach \*\*\*") as caught:
        sender(channel({"kind": "command", "argv": said}))(MESSAGE)
    assert_plain(str(caught.value))


@pytest.mark.parametrize("before", [150, 290, 5000])
def test_nor_where_half_of_the_address_would_be_cut_off(before):
    script = f"import sys; sys.stderr.write('x' * {before} + sys.argv[1]); sys.exit(1)"
    values = {
        "kind": "command",
        "argv": [sys.executable, "-c", script, f"https://hooks.example/{SECRET}?pad={'a' * 120}"],
    }
    with pytest.raises(NotSent) as caught:
        sender(channel(values))(MESSAGE)
    assert "ended with 1 xxx" in str(caught.value)
    for part in (SECRET[:6], "hooks"):
        assert part not in str(caught.value)


def test_the_doctor_tells_of_a_dribbling_webhook_in_time_and_without_its_address(tmp_path):
    clock = RealClock()
    with hostile(NEVER_ENDING_HTTP["dribbles headers"]) as server:
        path, address = tmp_path / "notify.toml", tmp_path / "address"
        address.write_text(f"http://127.0.0.1:{server.port}/{SECRET}")
        address.chmod(0o600)
        path.write_text(f'[[channel]]\nkind = "webhook"\nurl_file = "{address}"\ntimeout_s = {TIMEOUT_S}\n')
        began = clock.now()
        tried = rig("doctor", "--notify-file", path, "--out", tmp_path, "--notify", "--json")
        assert clock.now() - began < 30
    found = next(f for f in json.loads(tried.stdout)["findings"] if f["check"] == "notifications: webhook")
    assert found["found"] == f"the webhook: no complete answer within {TIMEOUT_S:g} s"
    assert SECRET not in tried.stdout + tried.stderr
