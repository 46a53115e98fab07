"""The server of a laboratory, asked in this process: who gets in, who may do what, and attacks."""

from __future__ import annotations

import json
import random
import re
import threading
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date
from difflib import unified_diff
from pathlib import Path
from typing import Any
from unittest.mock import patch
from urllib.parse import quote, urlencode

import anyio
import pytest
from anyio import to_thread
from asgi import Answer, ask
from lab_people import QUICK, WORD, laboratory, typed
from small_run import write_small
from starlette.exceptions import HTTPException

from rig.acts import Act, Places, act_of, acts
from rig.errors import StorageError, UsageError
from rig.lab import Laboratory, people
from rig.lab.proposals import decide, propose
from rig.queue import open_queue
from rig.run_file.events.laboratory import FileChanged, Proposed
from rig.runs.plans import load_plan
from rig.serve import make_app
from rig.serve.acting import Acting
from rig.serve.sessions import IDLE_S, LONGEST_S, Patience
from rig.who import Operator, operator

PAGES = ["/", "/queue", "/runs", "/proposals", "/results", "/certificates", "/equipment", "/log", "/events"]
ENTRY = {"/login", "/login/challenge", "/login/passkey", "/api/openapi.json", "/favicon.ico"}
FORM = "application/x-www-form-urlencoded"
NAMES = {act.name: act for act in acts()}


@dataclass
class Clock:
    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Server:
    """A laboratory's server, and its clock."""

    folder: Path
    clock: Clock = field(default_factory=Clock)
    beat: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        self.app = make_app(Laboratory(self.folder), stopwatch=self.clock, utc=lambda: 1.8e9, pause=self._pause)

    async def _pause(self, seconds: float) -> None:
        self.clock.now += seconds
        await to_thread.run_sync(self.beat)

    def ask(self, address: str, **how: Any) -> Answer:
        return ask(self.app, address, **how)


@dataclass
class Visitor:
    """A browser."""

    server: Server
    cookie: str = ""
    csrf: str = ""

    def gets(self, address: str, **how: Any) -> Answer:
        return self.server.ask(address, headers={"cookie": self.cookie, **how.pop("headers", {})}, **how)

    def posts(self, address: str, fields: Mapping[str, object], headers: Mapping[str, str] | None = None) -> Answer:
        given = {"cookie": self.cookie, "content-type": FORM, **(headers or {})}
        return self.server.ask(address, method="POST", headers=given, body=urlencode(fields).encode())

    def acts(self, act: str, headers: Mapping[str, str] | None = None, **fields: object) -> Answer:
        return self.posts(f"/act/{act}", {"csrf": self.csrf, **fields}, headers)


def logged_in(server: Server, login: str) -> Visitor:
    browser = Visitor(server)
    answer = browser.posts("/login", {"login": login, "password": WORD[login]})
    assert answer.status == 303
    browser.cookie = answer.headers["set-cookie"].partition(";")[0]
    browser.csrf = re.findall(r'name="csrf" value="([^"]+)"', browser.gets("/queue").text)[0]
    return browser


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    with patch.object(people, "COST", QUICK):
        yield


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = laboratory(tmp_path_factory.mktemp("template") / "lab", "attitude-lab")
    write_small(folder)
    return folder


@pytest.fixture
def server(template: Path, tmp_path: Path) -> Server:
    folder = tmp_path / "lab"
    folder.mkdir()
    for path in template.iterdir():
        if path.is_file():
            (folder / path.name).write_bytes(path.read_bytes())
    return Server(folder)


@pytest.fixture
def anna(server: Server) -> Visitor:
    return logged_in(server, "anna")


@pytest.fixture
def ben(server: Server) -> Visitor:
    return logged_in(server, "ben")


def proposed(server: Server, by: str = "anna") -> int:
    folder = server.folder
    plan = load_plan(folder / "small.toml", folder / "bench.toml")
    dry = {"outcome": "complete", "hours": 1.0, "points": 10, "observed": 10, "extremes": {"pitch_deg": [-1, 1]}}
    asked = Proposed(
        number=0,
        procedure="small.toml",
        bench="bench.toml",
        documents=dict(plan.documents),
        run_list=plan.run_list.sha256(),
        dry=dry,
        who=f"{by.title()} ({by})",
        who_by="password",
    )
    return propose(Laboratory(folder), asked).number


# --- who gets in -----------------------------------------------------------------------------------------------


def every_route(server: Server) -> list[tuple[str, str]]:
    routes = server.app._app.routes  # type: ignore[attr-defined]
    found = [(re.sub(r"\{[^}]*\}", "1", one.path), method) for one in routes for method in one.methods or ()]
    return [(path, method) for path, method in found if method != "HEAD"]


def test_nothing_is_shown_or_done_without_a_login(server: Server):
    opened = set()
    for path, method in every_route(server):
        answer = server.ask(path, method=method, headers={"content-type": FORM})
        if path in (
            "/login",
            "/login/challenge",
            "/login/passkey",
            "/api/openapi.json",
            "/favicon.ico",
        ) or path.startswith("/static/"):
            opened.add(path)
        elif path.startswith("/api/"):
            assert answer.status == 401, path
        else:
            assert (answer.status, answer.headers.get("location", "/login")[:6]) in ((303, "/login"), (401, "/login"))
    assert opened == {*ENTRY, "/static/1"}


@pytest.mark.parametrize(
    ("login", "password"), [("anna", "wrong one"), ("nobody", "correct horse"), ("", ""), ("anna", "battery staple")]
)
def test_wrong_pairs_get_one_answer(server: Server, login: str, password: str):
    answer = Visitor(server).posts("/login", {"login": login, "password": password})
    assert (answer.status, "set-cookie" in answer.headers) == (401, False)
    assert "belong to nobody" in answer.text
    assert not password or password not in answer.text


def test_a_cookie_is_for_no_script_and_no_other_site(server: Server, template: Path):
    answer = Visitor(server).posts("/login", {"login": "anna", "password": WORD["anna"]})
    said = answer.headers["set-cookie"].lower()
    assert "httponly" in said
    assert "samesite=strict" in said
    safe = make_app(Laboratory(template), stopwatch=Clock(), utc=Clock(), pause=server._pause, encrypted=True)
    answer = ask(
        safe,
        "/login",
        method="POST",
        headers={"content-type": FORM},
        body=urlencode({"login": "anna", "password": WORD["anna"]}).encode(),
    )
    assert answer.headers["set-cookie"].startswith("__Host-rig=")
    assert "secure" in answer.headers["set-cookie"].lower()
    assert "strict-transport-security" in answer.headers


def test_guessing_passwords_takes_longer_and_longer(server: Server):
    fields = {"login": "anna", "password": "guess"}
    browser = Visitor(server)
    assert [browser.posts("/login", fields).status for _ in range(6)] == [401] * 5 + [429]
    refused = browser.posts("/login", {"login": "anna", "password": WORD["anna"]})
    assert (refused.status, refused.headers["retry-after"]) == (429, "3")
    other = server.ask(
        "/login",
        method="POST",
        client="192.0.2.7",
        headers={"content-type": FORM},
        body=urlencode({"login": "anna", "password": WORD["anna"]}).encode(),
    )
    assert other.status == 303  # somebody's guesses keep nobody else out
    server.clock.now += 2.1
    assert browser.posts("/login", fields).status == 401
    assert browser.posts("/login", fields).headers["retry-after"] == "5"
    server.clock.now += 4.1
    assert browser.posts("/login", {"login": "anna", "password": WORD["anna"]}).status == 303


def test_patience_forgets_the_oldest_and_waits_a_quarter_of_an_hour_at_most():
    clock = Clock()
    patience = Patience(clock)

    def fails(key: str) -> None:
        with patience.attempt(key) as attempt:
            attempt.failed = True

    for _ in range(60):
        fails("a")
    assert patience.wait_s("a") == 900.0
    for number in range(6000):
        fails(str(number))
    assert patience.wait_s("a") == 0.0


def test_guesses_at_the_same_time_are_counted_while_they_are_checked(server: Server):
    acting, statuses = Acting(Places(Laboratory(server.folder)), Patience(server.clock)), []

    async def guess(number: int) -> None:
        try:
            await acting.password("anna", f"guess {number}", "192.0.2.1")
        except HTTPException as error:
            statuses.append(error.status_code)
        except people.WrongPassword:
            statuses.append(401)

    async def all_at_once() -> None:
        async with anyio.create_task_group() as group:
            for number in range(15):
                group.start_soon(guess, number)

    anyio.run(all_at_once)
    assert sorted(statuses) == [401] * 5 + [429] * 10
    assert acting.patience.wait_s("from 192.0.2.1") == 2.0


def test_a_session_ends_by_logout_and_its_cookie_is_worth_nothing(anna: Visitor):
    assert anna.gets("/queue").status == 200
    assert anna.posts("/logout", {}).status == 403  # without the token of its pages
    assert anna.posts("/logout", {"csrf": anna.csrf}).status == 303
    assert anna.gets("/queue").status == 303
    assert anna.acts("pause").status == 401
    assert not open_queue(anna.server.folder / "runs" / "queue.sqlite")[1].paused


def test_an_open_page_hears_nothing_more_after_logout(anna: Visitor):
    beats: list[int] = []

    def beat() -> None:
        beats.append(1)
        if len(beats) == 3:
            assert anna.posts("/logout", {"csrf": anna.csrf}).status == 303

    anna.server.beat = beat
    answer = anna.gets("/events")
    assert len(beats) == 3
    assert answer.text.rstrip().endswith("event: over\ndata: {}")


@pytest.mark.parametrize("seconds", [IDLE_S + 1, LONGEST_S + 1])
def test_a_session_ends_by_itself(anna: Visitor, seconds: float):
    steps = 1 if seconds < LONGEST_S else 20
    for _ in range(steps - 1):
        anna.server.clock.now += seconds / steps
        assert anna.gets("/queue").status == 200
    anna.server.clock.now += seconds / steps
    assert anna.gets("/queue").status == 303


@pytest.mark.parametrize("change", ["remove", "password"])
def test_who_is_removed_or_has_another_password_is_logged_out(anna: Visitor, change: str):
    lines = f"{WORD['olga']}\n" if change == "remove" else f"{WORD['anna']}\nanother password\n"
    by = "olga" if change == "remove" else "anna"
    assert typed("person", change, "anna", "--login", by, lines=lines, cwd=anna.server.folder).returncode == 0
    assert anna.gets("/queue").status == 303


def test_a_login_makes_a_new_cookie(anna: Visitor):
    given = anna.posts("/login", {"login": "anna", "password": WORD["anna"]})
    assert given.headers["set-cookie"].partition(";")[0] != anna.cookie
    assert anna.gets("/queue").status == 303  # the one before is over


@pytest.mark.parametrize("following", ["//evil.example/", "https://evil.example/", "/\\evil.example", "javascript:1"])
def test_a_login_leads_nowhere_else(server: Server, following: str):
    fields = {"login": "anna", "password": WORD["anna"], "next": following}
    assert Visitor(server).posts("/login", fields).headers["location"] == "/"


# --- forged and odd requests -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "headers"),
    [
        ({}, {}),
        ({"csrf": ""}, {}),
        ({"csrf": "é"}, {}),
        ({"csrf": "0" * 43}, {}),
        ({"csrf": "own"}, {"origin": "https://evil.example"}),
        ({"csrf": "own"}, {"origin": "null"}),
        ({"csrf": "own"}, {"origin": "http://127.0.0.1:9999"}),
        ({"csrf": "own"}, {"sec-fetch-site": "cross-site"}),
        ({"csrf": "own"}, {"sec-fetch-site": "same-site"}),
    ],
)
def test_a_form_of_another_page_does_nothing(anna: Visitor, fields: dict[str, str], headers: dict[str, str]):
    given = {name: anna.csrf if value == "own" else value for name, value in fields.items()}
    assert anna.posts("/act/pause", given, headers).status == 403
    assert not open_queue(anna.server.folder / "runs" / "queue.sqlite")[1].paused


def test_the_token_of_another_session_is_none_of_mine(anna: Visitor, ben: Visitor):
    assert anna.posts("/act/pause", {"csrf": ben.csrf}).status == 403


def test_an_own_form_acts(anna: Visitor):
    headers = {"origin": "http://127.0.0.1:8321", "sec-fetch-site": "same-origin"}
    assert anna.acts("pause", headers, why="a visitor").status == 200
    queue = open_queue(anna.server.folder / "runs" / "queue.sqlite")[1]
    assert queue.paused


@pytest.mark.parametrize("act", NAMES)
def test_an_address_alone_does_nothing(anna: Visitor, act: str):
    proposed(anna.server)
    before = sorted(path.name for path in anna.server.folder.rglob("*") if not path.name.startswith("log."))
    query = urlencode({"confirm": "yes", "csrf": anna.csrf, "run": "x", "proposal": 1, "item": 1, "priority": 1})
    assert anna.gets(f"/act/{act}?{query}").status in (200, 409)
    after = sorted(path.name for path in anna.server.folder.rglob("*") if not path.name.startswith("log."))
    assert before == after


@pytest.mark.parametrize(
    ("body", "kind", "status"),
    [
        (b"{}", "application/json", 415),
        (b"csrf=1", "text/plain", 415),
        (b"a" * 70000, FORM, 413),
        (b"csrf=1&csrf=2", FORM, 400),
        (b"&".join(b"a%d=1" % n for n in range(120)), FORM, 400),
        (b"csrf=%ff", FORM, 400),
        (b"\xff", FORM, 400),
    ],
)
def test_odd_bodies_are_refused(anna: Visitor, body: bytes, kind: str, status: int):
    headers = {"cookie": anna.cookie, "content-type": kind}
    assert anna.server.ask("/act/pause", method="POST", headers=headers, body=body).status == status


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_no_other_site_is_let_in(anna: Visitor, method: str):
    assert anna.gets("/", method=method).status == 405
    headers = {"origin": "https://evil.example", "access-control-request-method": "POST"}
    for address in ("/", "/api/benches", "/login"):
        assert not [name for name in anna.gets(address, headers=headers).headers if name.startswith("access-control")]
    assert anna.gets("/", host="evil.example").status == 421


def test_headers_of_every_page(anna: Visitor):
    for address in (*PAGES[:-1], "/login", "/nothing", "/act/pause", "/static/serve.js"):
        headers = anna.gets(address).headers
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "form-action 'self'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"


TRAVERSALS = [
    "people.toml",
    "log.sqlite",
    "../lab/people.toml",
    "..%2fpeople.toml",
    "%2e%2e/people.toml",
    "reports/../people.toml",
    "reports/%2e%2e/people.toml",
    "/etc/passwd",
    "%2fetc%2fpasswd",
    "runs/queue.sqlite",
    "reports/..%5cpeople.toml",
    "reports/x.html%00.pdf",
]


@pytest.mark.parametrize("name", TRAVERSALS)
def test_no_name_leads_out_of_the_lists(anna: Visitor, name: str):
    (anna.server.folder / "reports").mkdir()
    (anna.server.folder / "reports" / "x.html").write_text("<p>a report")
    for address in ("/file/", "/run/", "/static/", "/proposal/"):
        answer = anna.gets(address + name)
        assert answer.status in (404, 307), (address, answer.status)
        assert b"argon2" not in answer.body
    assert anna.gets("/file/reports/x.html").text == "<p>a report"


@pytest.mark.parametrize("act", ["dry-run", "propose", "hold", "report", "sign"])
@pytest.mark.parametrize("name", ["../lab/bench.toml", "/etc/passwd", "runs/../bench.toml", "people.toml", "a\nb"])
def test_an_act_takes_names_and_no_paths(server: Server, act: str, name: str):
    visitor = logged_in(server, "ben")
    fields: dict[str, object] = (
        {"run": name} if act in ("hold", "report", "sign") else {"procedure": name, "bench": name}
    )
    answer = visitor.acts(act, **fields, **({"password": WORD["ben"]} if NAMES[act].again else {}))
    refused = (409, "there is no") if name.isprintable() else (422, "one line of printable characters")
    assert answer.status == refused[0]
    assert refused[1] in answer.text


def test_a_link_is_no_report(anna: Visitor):
    folder = anna.server.folder
    (folder / "reports").mkdir()
    (folder / "reports" / "people.html").symlink_to(folder / "people.toml")
    assert b"argon2" not in anna.gets("/file/reports/people.html").body
    elsewhere = folder.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "x.html").write_text("not ours")
    (folder / "certificates").symlink_to(elsewhere)
    assert anna.gets("/file/certificates/x.html").status == 404


SCRIPT = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>"


def test_names_are_shown_as_text(server: Server):
    folder = server.folder
    bench = folder / "bench.toml"
    bench.write_text(bench.read_text().replace('name = "attitude-lab"', f"name = '''{SCRIPT}'''", 1))
    (folder / "<img src=x>.toml").write_text("kind = 1")
    (folder / "reports").mkdir()
    (folder / "reports" / "<script>x.html").write_text("x")
    add = ("person", "add", "mallory", "--name", SCRIPT, "--roles", "viewer,operator,approver", "--login", "olga")
    assert typed(*add, lines=f"{WORD['olga']}\nxss xss xss\n", cwd=folder).returncode == 0
    with patch.dict(WORD, {"mallory": "xss xss xss"}):
        visitor = logged_in(server, "mallory")
    number = proposed(server, "anna")
    decide(Laboratory(folder), number, "declined", SCRIPT, Operator(f"{SCRIPT} (mallory)", "password"))
    visitor.acts("pause", why=SCRIPT)
    query = quote(SCRIPT)
    addresses = [*PAGES[:-1], "/proposal/1", f"/act/hold?run={query}", f"/act/{query}", f"/login?next={query}"]
    for address in addresses:
        text = visitor.gets(address).text
        assert "<script>alert" not in text, address
        assert "<img src" not in text, address
        assert "<script>x" not in text, address
    text = visitor.acts("dry-run", procedure=SCRIPT, bench=SCRIPT).text
    assert "&lt;script&gt;" in text
    assert "<script>alert" not in text
    stream = visitor.gets("/events", until=lambda answer: "event: live" in answer.text)
    assert "<script>alert" not in json.loads(stream.text.split("data: ")[1].split("\n")[0])["html"]


def test_a_report_runs_nothing(anna: Visitor):
    (anna.server.folder / "reports").mkdir()
    (anna.server.folder / "reports" / "x.html").write_text("<script>alert(1)</script>")
    policy = anna.gets("/file/reports/x.html").headers["content-security-policy"]
    assert "sandbox" in policy
    assert "default-src 'none'" in policy
    assert "script" not in policy


# --- who may do what -------------------------------------------------------------------------------------------


def given(act: type[Act]) -> dict[str, object]:
    """Values for every needed field of an act."""
    words = {"procedure": "small.toml", "bench": "bench.toml", "run": "none", "login": "ben", "roles": "viewer"}
    return {name: words.get(name, 1) for name, one in act.model_fields.items() if one.is_required()}


@pytest.mark.parametrize("act", [name for name, one in NAMES.items() if one.role])
def test_an_act_needs_its_role(server: Server, act: str):
    vera = logged_in(server, "vera")
    number = proposed(server)
    assert number == 1
    answer = vera.acts(act, **given(NAMES[act]), password=WORD["vera"], confirm="yes")
    assert (answer.status, f"needs the role {NAMES[act].role}" in answer.text) == (409, True)


@pytest.mark.parametrize("act", [name for name, one in NAMES.items() if one.again])
@pytest.mark.parametrize("password", ["", "battery stapl", WORD["anna"]])
def test_what_decides_asks_for_the_password_again(server: Server, act: str, password: str):
    ben = logged_in(server, "olga" if NAMES[act].role == "administrator" else "ben")
    proposed(ben.server)
    (ben.server.folder / "runs").mkdir()
    (ben.server.folder / "runs" / "none.sqlite").touch()
    answer = ben.acts(act, **given(NAMES[act]), password=password, confirm="yes")
    assert (answer.status, "belong to nobody" in answer.text) == (409, True)
    assert Laboratory(ben.server.folder).log().proposals[1].state == "waiting"


def test_what_moves_is_confirmed_once_more(anna: Visitor):
    anna.acts("dry-run", procedure="small.toml", bench="bench.toml")
    anna.acts("pause")
    asked = anna.acts("go-on")
    assert (asked.status, "Are you sure?" in asked.text) == (200, True)
    assert open_queue(anna.server.folder / "runs" / "queue.sqlite")[1].paused
    assert "goes on" in anna.acts("go-on", confirm="yes").text
    assert not open_queue(anna.server.folder / "runs" / "queue.sqlite")[1].paused


def test_a_change_by_an_editor_is_found_by_the_next_act_which_a_full_disk_does_not_stop(anna: Visitor):
    folder = anna.server.folder
    (folder / "bench.toml").write_text((folder / "bench.toml").read_text() + "\n# changed\n")
    assert anna.acts("pause").status == 200
    said = [one.sentence() for one in Laboratory(folder).log().records if one.kind == "laboratory"]
    assert "bench.toml changed, by an editor, found by Anna (anna)" in said
    (folder / "bench.toml").write_text((folder / "bench.toml").read_text() + "\n# again\n")
    with patch("rig.lab.laboratory.Laboratory.note_changes", side_effect=StorageError("the disk is full")):
        assert anna.acts("go-on", confirm="yes").status == 200


def test_the_page_of_the_log_compares_the_last_records_once_and_in_no_time_of_others(anna: Visitor):
    laboratory, compared = Laboratory(anna.server.folder), list[threading.Thread]()

    def compare(*texts: Any, **how: Any) -> list[str]:
        compared.append(threading.current_thread())
        return list(unified_diff(*texts, **how))

    about = {"file": "x.toml", "before": "a", "after": "b", "why": "", "who": "Anna", "who_by": "login"}
    laboratory.append(lambda _: [FileChanged(text=f"x = {number}", **about) for number in range(300)])
    with patch("rig.lab.laboratory.unified_diff", compare):
        page = anna.gets("/log").text
        assert anna.gets("/log").text == page
    assert len(compared) == 200
    assert threading.current_thread() not in compared
    assert (page.count('<li class="card"'), "x = 299" in page, "-x = 99<" in page, "+x = 99<" in page) == (
        200,
        True,
        True,
        False,
    )


def test_two_keys_and_no_replay(server: Server, anna: Visitor, ben: Visitor):
    bench = server.folder / "bench.toml"
    bench.write_text("approval = true\n" + bench.read_text())
    number = proposed(server)
    assert "is waiting" in anna.acts("start", proposal=number, confirm="yes").text
    own = ben.acts("approve", proposal=proposed(server, "ben"), password=WORD["ben"])
    assert (own.status, "somebody else approves it" in own.text) == (409, True)
    assert ben.acts("approve", proposal=number, password=WORD["ben"]).status == 200
    again = ben.acts("approve", proposal=number, password=WORD["ben"])
    assert (again.status, "is approved: propose it again" in again.text) == (409, True)
    asked = anna.acts("start", proposal=number)
    assert "they move" in asked.text
    assert "was added" in anna.acts("start", proposal=number, confirm="yes").text
    plan = load_plan(server.folder / "small.toml", bench)
    permission = plan.permission()
    assert permission is not None
    permission.use("the-run", "Anna (anna)")
    used = anna.acts("start", proposal=number, confirm="yes")
    assert (used.status, "is used" in used.text) == (409, True)
    bench.write_text(bench.read_text() + "\n")
    changed = anna.acts("start", proposal=number, confirm="yes")
    assert (changed.status, "changed after its dry run" in changed.text) == (409, True)


def test_a_proposal_waits_in_the_queue_once(server: Server, anna: Visitor):
    number = proposed(server)
    assert "was added" in anna.acts("start", proposal=number, confirm="yes").text
    again = anna.acts("start", proposal=number, confirm="yes")
    assert (again.status, "item 1 of the queue is the same run, and is waiting" in again.text) == (409, True)
    assert anna.acts("remove", item=1).status == 200
    assert "was added" in anna.acts("start", proposal=number, confirm="yes").text


def test_the_longest_name_of_a_person_is_one_of_an_operator(server: Server):
    longest = f"{'x' * 80} ({'a' * 32})"
    assert operator(longest).name == longest


def test_no_number_is_too_long_for_a_page(anna: Visitor):
    for number in ("9" * 5000, "0", "01", "x", "-1"):
        assert anna.gets(f"/proposal/{number}").status == 404
    assert anna.gets(f"/proposal/{proposed(anna.server)}").status == 200


def test_a_loop_is_started_as_a_run_is_but_never_on_a_bench_with_two_keys(server: Server, anna: Visitor, ben: Visitor):
    anna.acts("dry-run", procedure="small.toml", bench="bench.toml", hours="2.5")
    number = proposed(server)
    asked = anna.acts("start", proposal=number, hours=3)
    assert "up to 3 h, as a loop" in asked.text
    assert "was added" in anna.acts("start", proposal=number, hours=3, confirm="yes").text
    items = open_queue(server.folder / "runs" / "queue.sqlite")[1].items.values()
    assert [one.asked.command for one in items] == ["loop", "loop"]
    assert [list(one.asked.options)[-2:] for one in items] == [["--hours", "2.5"], ["--hours", "3"]]
    bench = server.folder / "bench.toml"
    bench.write_text("approval = true\n" + bench.read_text())
    number = proposed(server)
    ben.acts("approve", proposal=number, password=WORD["ben"])
    assert "approved by nobody" in anna.acts("start", proposal=number, hours=3, confirm="yes").text
    queue = ("queue", "add", "small.toml", "--bench", "bench.toml")
    assert typed(*queue, cwd=server.folder).returncode == 0  # approved
    bench.write_text(bench.read_text() + "\n")
    assert "is of another bench.toml" in typed(*queue, cwd=server.folder).stderr


def test_a_body_that_trickles_is_given_up(anna: Visitor):
    with patch("rig.serve.asked._MOST_S", 0.05):
        headers = {"cookie": anna.cookie, "content-type": FORM}
        answer = anna.server.ask("/act/pause", method="POST", headers=headers, body=b"csrf=", more=True)
    assert answer.status == 408


def test_an_item_of_the_queue_has_the_person_who_added_it(anna: Visitor):
    assert "item 1" in anna.acts("dry-run", procedure="small.toml", bench="bench.toml").text
    (item,) = open_queue(anna.server.folder / "runs" / "queue.sqlite")[1].items.values()
    assert (item.asked.who, item.asked.who_by) == ("Anna (anna)", "password")
    assert "--dry" in item.asked.options
    assert "has priority 7" in anna.acts("move", item=1, priority=7).text
    assert "was removed" in anna.acts("remove", item=1).text
    assert anna.acts("remove", item=1).status == 409


# --- programs --------------------------------------------------------------------------------------------------


@pytest.fixture
def token(server: Server) -> str:
    add = ("person", "add", "planner", "--program", "--name", "Planner", "--roles", "viewer,operator,approver")
    done = typed(*add, "--login", "olga", lines=f"{WORD['olga']}\n", cwd=server.folder)
    return done.stdout.strip()


def called(server: Server, act: str, authorization: str, **fields: object) -> Answer:
    headers = {"authorization": authorization, "content-type": "application/json"}
    return server.ask(f"/api/act/{act}", method="POST", headers=headers, body=json.dumps(fields).encode())


def basic(login: str) -> str:
    return "Basic " + b64encode(f"{login}:{WORD[login]}".encode()).decode()


def test_a_program_sees_and_acts_with_its_token(server: Server, token: str):
    bearer = f"Bearer {token}"
    benches = json.loads(server.ask("/api/benches", headers={"authorization": bearer}).text)
    assert benches[0]["title"] == "attitude-lab"
    for name in ("queue", "runs", "proposals", "equipment"):
        assert server.ask(f"/api/{name}", headers={"authorization": bearer}).status == 200
    assert json.loads(called(server, "dry-run", bearer, procedure="small.toml", bench="bench.toml").text)["item"] == 1
    (item,) = open_queue(server.folder / "runs" / "queue.sqlite")[1].items.values()
    assert (item.asked.who, item.asked.who_by) == ("Planner (planner)", "token")


def test_a_program_never_approves_or_signs(server: Server, token: str):
    number = proposed(server)
    for act in ("approve", "decline", "sign"):
        answer = called(server, act, f"Bearer {token}", **given(NAMES[act]))
        assert (answer.status, "person's password" in answer.text) == (403, True)
    assert called(server, "approve", basic("ben"), proposal=number).status == 200
    assert Laboratory(server.folder).log().proposals[number].state == "approved"


def test_a_program_confirms_what_moves(server: Server, token: str):
    number = proposed(server)
    asked = called(server, "start", f"Bearer {token}", proposal=number)
    assert (asked.status, "they move" in json.loads(asked.text)["confirm"]) == (428, True)
    assert called(server, "start", f"Bearer {token}", proposal=number, confirm="yes").status == 428
    assert called(server, "start", f"Bearer {token}", proposal=number, confirm=True).status == 200


@pytest.mark.parametrize("given_", ["", "Bearer", "Bearer x", "Basic x", "Basic YTpi", "Token abc", "Bearer é"])
def test_wrong_tokens(server: Server, anna: Visitor, given_: str):
    assert server.ask("/api/queue", headers={"authorization": given_, "cookie": anna.cookie}).status == 401


@pytest.mark.parametrize(
    ("fields", "status"),
    [({"why": 3}, 422), ({"unknown": 1}, 422), ({"why": "x" * 300}, 422), ({"why": "\ud800"}, 200), ({}, 200)],
)
def test_values_of_a_program_are_checked(server: Server, token: str, fields: dict[str, Any], status: int):
    assert called(server, "pause", f"Bearer {token}", **fields).status in (status, 422)


@pytest.mark.parametrize("why", ["fine\n  approved by Ben (ben)", "\x1b[2K", "\u202etxt"])
@pytest.mark.parametrize("act", ["pause", "propose", "approve", "decline", "sign"])
def test_a_text_of_an_act_is_one_printable_line(act: str, why: str):
    field = "because" if act == "sign" else "why"
    with pytest.raises(UsageError, match="one line of printable characters"):
        act_of(act, {**given(NAMES[act]), field: why})


def test_a_program_sends_json_only(server: Server, token: str):
    for kind, body in (("text/plain", b"{}"), ("application/json", b"["), ("application/json", b"[1]")):
        headers = {"authorization": f"Bearer {token}", "content-type": kind}
        assert server.ask("/api/act/pause", method="POST", headers=headers, body=body).status in (400, 415)


ODD = [
    "",
    "0",
    "-1",
    "1e999",
    "NaN",
    "9" * 400,
    "\x00",
    "\ud800",
    "é",
    "../..",
    "%00",
    "null",
    "true",
    "[]",
    "{}",
    SCRIPT,
]


def test_whatever_is_asked_nothing_unforeseen_happens(server: Server, ben: Visitor, token: str):
    """Random addresses, fields and bodies by somebody who may nearly everything; any exception fails."""
    rng = random.Random(20261129)
    number = proposed(server)
    known = ["small.toml", "bench.toml", "1", str(number), "none"]
    paths = [path for path, _ in every_route(server)] + [f"/act/{name}" for name in NAMES]
    statuses = set()
    for _ in range(600):
        path, name = rng.choice(paths), rng.choice(sorted(NAMES))
        if rng.random() < 0.6:
            path, fields = f"{rng.choice(['', '/api'])}/act/{name}", dict.fromkeys(NAMES[name].model_fields, "")
        else:
            path, fields = path.replace("1", quote(rng.choice([*ODD, *known]), errors="replace")), {"odd": ""}
        fields = {one: rng.choice(rng.choice([ODD, known])) for one in fields if rng.random() < 0.9}
        if NAMES[name].slow or path in ("/logout", "/login"):
            continue
        if rng.random() < 0.3:
            fields["confirm"] = rng.choice(["yes", "no"])
        method = rng.choice(["GET", "POST"])
        if path.startswith("/api/"):
            typed_ = {
                one: rng.choice([value, 1, 1.5, None, [], {}, True, "small.toml"]) for one, value in fields.items()
            }
            body = json.dumps(typed_)
            headers = {"authorization": f"Bearer {token}", "content-type": "application/json"}
            answer = server.ask(path, method=method, headers=headers, body=body.encode("utf-8", "replace"))
        else:
            body = urlencode({**fields, "csrf": ben.csrf, "password": WORD["ben"]}, errors="replace")
            address = path if method == "POST" else f"{path}?{body}"
            headers = {"cookie": ben.cookie, "content-type": FORM}
            how: dict[str, Any] = {"until": lambda answer: "event: live" in answer.text}
            answer = server.ask(address, method=method, headers=headers, body=body.encode(), **how)
        statuses.add(answer.status)
        assert answer.status < 500, (method, path, fields)
        assert "<script>alert" not in answer.text or path.startswith("/api/"), (method, path)
    assert {200, 404, 405, 409, 422} <= statuses


def test_an_item_is_due_by_its_certificates(server: Server, anna: Visitor):
    from tests.archive.test_archive import write  # noqa: PLC0415

    folder = server.folder / "certificates"
    folder.mkdir(exist_ok=True)
    write(folder, "C-1", date(2025, 1, 10), next_due=date(2025, 6, 10), serial="S-77")
    shown = anna.gets("/equipment").text
    assert "EXAMPLE 10 kN S-77" in shown
    assert "2025-06-10" in shown
    assert "C-1 of 2025-01-10; due by its cycle" in shown


def test_an_item_whose_forecast_has_ended_is_not_called_overdue(server: Server, anna: Visitor):
    from tests.archive.test_archive import write  # noqa: PLC0415

    folder = server.folder / "certificates"
    folder.mkdir(exist_ok=True)
    for year in (2020, 2021, 2022):
        write(folder, f"C-{year}", date(year, 1, 10), serial="S-77")
    assert "after 2024-01-" in anna.gets("/equipment").text
    assert "S-77 was due" not in anna.gets("/").text
