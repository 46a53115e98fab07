"""Left over of an attack on the server: streams and slow acts of one person, secrets, an edited log, TLS."""

from __future__ import annotations

import asyncio
import socket
import ssl
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import anyio
import apsw
import pytest
from lab_people import QUICK, WORD, laboratory, typed
from small_run import write_small
from test_served import _certificate
from test_server import Server, logged_in, proposed

from rig.acts import Places, Told, act_of
from rig.errors import RunFileError, UsageError
from rig.lab import Laboratory, people, without_secrets
from rig.lab.proposals import decide
from rig.runs.plans import load_plan
from rig.serve import acting as acting_module
from rig.serve.acting import Acting
from rig.serve.sessions import Patience
from rig.watch import server as watch_server
from rig.watch.app import Streams
from rig.who import Operator

ANNA, BEN = Operator("Anna (anna)", "password"), Operator("Ben (ben)", "password")


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    with patch.object(people, "COST", QUICK):
        yield


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = laboratory(tmp_path / "lab", "attitude-lab")
    write_small(folder)
    return folder


def test_one_person_opens_twelve_pages_and_others_still_theirs(lab: Path):
    server = Server(lab)
    anna, ben = logged_in(server, "anna"), logged_in(server, "ben")
    streams = _streams(server)
    opened = [streams.one("anna") for _ in range(12)]
    for one in opened:
        one.__enter__()
    assert anna.gets("/events").status == 503
    server.beat = lambda: ben.posts("/logout", {"csrf": ben.csrf})  # which ends the stream
    assert ben.gets("/events").status == 200
    for one in opened:
        one.__exit__(None, None, None)
    server.beat = lambda: anna.posts("/logout", {"csrf": anna.csrf})
    assert anna.gets("/events").status == 200


def _streams(server: Server) -> Streams:
    """The streams of a server's pages."""
    for route in server.app._app.routes:  # type: ignore[attr-defined]
        for cell in getattr(route.endpoint, "__closure__", None) or ():
            owner = getattr(cell.cell_contents, "__self__", None)
            if hasattr(owner, "_streams"):
                return owner._streams  # type: ignore[no-any-return]
    raise AssertionError("no page has streams")


def test_a_second_slow_act_of_one_person_is_refused_and_another_person_s_is_done(lab: Path):
    acting = Acting(Places(Laboratory(lab)), Patience(lambda: 0.0))
    act = act_of("propose", {"procedure": "small.toml", "bench": "bench.toml"})
    entered, go_on = anyio.Event(), anyio.Event()
    refused: list[str] = []

    def slow(_act: Any, _lab: Any, by: Operator) -> Told:
        if by is ANNA:
            anyio.from_thread.run_sync(entered.set)
            anyio.from_thread.run(go_on.wait)
        return Told(by.name)

    async def both() -> None:
        async with anyio.create_task_group() as group:
            group.start_soon(acting.carry_out, act, ANNA)
            await entered.wait()
            try:
                await acting.carry_out(act, ANNA)
            except UsageError as error:
                refused.append(str(error))
            assert (await acting.carry_out(act, BEN)).words == BEN.name
            go_on.set()
        assert (await acting.carry_out(act, BEN)).words == BEN.name

    with patch.object(acting_module, "apart", slow):
        anyio.run(both)
    assert "still at work" in refused[0]


@pytest.mark.parametrize(
    "line",
    [
        'passphrase = "abc-xyz"',
        "token = ['abc-xyz', 'other']",
        'secret = { name = "n", value = "abc-xyz" }',
        "pwd = abcxyz-abc-xyz",
        'mail = { user = "u", password = "abc-xyz" }',
        'url = "https://hook/abc-xyz"',
        'address = "socket://anna:abc-xyz@host:5025"',
        '[secrets]\nmine = "abc-xyz"',
        '[channel.webhook]\nto = """\nabc-xyz\n"""',
        '"api key" = 1\n"my token" = "abc-xyz"',
        'a.password = "abc-xyz"',
        'password = "ab\\"c-xyz abc-xyz"',
    ],
)
def test_no_secret_is_in_the_log(line: str, lab: Path):
    (lab / "other.toml").write_text(f'name = "n"\n{line}\n')
    log = Laboratory(lab).note_changes(ANNA)
    assert "c-xyz" not in log.texts["other.toml"]
    assert 'name = "n"' in log.texts["other.toml"]


def test_files_without_secrets_are_logged_as_they_are_and_masked_ones_are_still_toml(lab: Path):
    for path in lab.glob("*.toml"):
        if path.name != "people.toml":
            assert without_secrets(path.read_text()) == path.read_text(), path.name
    tomllib.loads(without_secrets((lab / "people.toml").read_text()))
    assert without_secrets("a" * 200_000) == "a" * 200_000  # and takes no time for it


def _forged(lab: Path) -> None:
    """An approval written into the log by somebody with a tool for databases."""
    with_triggers = apsw.Connection(str(lab / "log.sqlite"))
    for (name,) in list(with_triggers.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'")):
        with_triggers.execute(f'DROP TRIGGER "{name}"')
    tables = [row[0] for row in with_triggers.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    changed = 0
    for table in tables:
        columns = [row[1] for row in with_triggers.execute(f'PRAGMA table_info("{table}")')]
        for column in columns:
            with_triggers.execute(
                f'UPDATE "{table}" SET "{column}" = replace("{column}", ?, ?) WHERE typeof("{column}") = \'text\'',
                ("declined", "approved"),
            )
            changed += with_triggers.changes()
    with_triggers.close()
    assert changed


def test_an_edited_log_shows_no_approval_and_permits_no_run(lab: Path):
    bench = lab / "bench.toml"
    bench.write_text("approval = true\n" + bench.read_text())
    server = Server(lab)
    number = proposed(server)
    decide(Laboratory(lab), number, "declined", "", BEN)
    _forged(lab)
    shown = typed("approve", number, cwd=lab)
    assert ("approved by" in shown.stdout, "was edited or damaged" in shown.stderr) == (False, True), shown.stdout
    with pytest.raises(RunFileError, match="was edited or damaged"):
        load_plan(lab / "small.toml", bench).permission()
    anna = logged_in(server, "anna")
    page = anna.gets("/").text
    assert ("was edited or damaged" in page, "is approved, and not started" in page) == (True, False)
    assert anna.gets(f"/proposal/{number}").status == 404
    assert "was edited or damaged" in anna.gets("/log").text
    assert WORD["anna"] not in page


def test_a_tls_handshake_that_never_ends_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    chain, key = _certificate(tmp_path)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(chain, key)
    monkeypatch.setattr(asyncio.constants, "SSL_HANDSHAKE_TIMEOUT", asyncio.constants.SSL_HANDSHAKE_TIMEOUT)
    monkeypatch.setattr(watch_server, "HEADERS_S", 0.2)
    watch_server.bound_handshakes()

    async def half() -> bytes:
        server = await asyncio.start_server(lambda _r, _w: None, "127.0.0.1", 0, ssl=context)
        port = server.sockets[0].getsockname()[1]
        with socket.socket() as silent:
            silent.setblocking(False)
            await asyncio.get_running_loop().sock_connect(silent, ("127.0.0.1", port))
            try:
                return await asyncio.wait_for(asyncio.get_running_loop().sock_recv(silent, 1), 10)
            except ConnectionResetError:
                return b""
            finally:
                server.close()

    assert asyncio.run(half()) == b""
