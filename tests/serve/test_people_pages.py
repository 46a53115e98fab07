"""People in the browser: administrators add, change, disable; everybody has an own password, and passkeys."""

from __future__ import annotations

import hashlib
import html
import json
import re
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from asgi import Answer
from lab_people import QUICK, WORD, typed, with_people
from test_server import FORM, Server, Visitor, logged_in

from rig.lab import Laboratory, people
from rig.run_file.verify.verification import verify_file

cbor2 = pytest.importorskip("cbor2")
from cryptography.hazmat.primitives import hashes  # noqa: E402
from cryptography.hazmat.primitives.asymmetric import ec  # noqa: E402

ORIGIN = "http://localhost:8322"
HOST = {"host": "localhost:8322", "origin": ORIGIN, "sec-fetch-site": "same-origin"}


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    with patch.object(people, "COST", QUICK):
        yield


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_people(tmp_path_factory.mktemp("template") / "lab")


@pytest.fixture
def server(template: Path, tmp_path: Path) -> Server:
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "people.toml").write_bytes((template / "people.toml").read_bytes())
    return Server(folder)


@pytest.fixture
def olga(server: Server) -> Visitor:
    return logged_in(server, "olga")


def does(who: Visitor, act: str, password: str = WORD["olga"], **fields: str) -> Answer:
    return who.acts(act, password=password, **fields)


def shown_once(answer: Answer) -> str:
    assert answer.status == 200, answer.text
    return str(re.findall(r"shown this once: ([^<\s]+)", html.unescape(answer.text))[0])


def log_in(server: Server, login: str, password: str) -> int:
    return Visitor(server).posts("/login", {"login": login, "password": password}).status


def test_an_administrator_adds_a_person_who_logs_in_and_changes_the_password(server: Server, olga: Visitor):
    first = shown_once(does(olga, "add-person", login="carl", full_name="Carl", roles="operator, viewer"))
    carl = Visitor(server)
    answer = carl.posts("/login", {"login": "carl", "password": first})
    carl.cookie = answer.headers["set-cookie"].partition(";")[0]
    carl.csrf = re.findall(r'name="csrf" value="([^"]+)"', carl.gets("/people").text)[0]
    other = logged_in_with(server, "carl", first)
    assert does(carl, "change-password", password=first, new_password="a better one").status == 200
    assert carl.gets("/people").status == 200  # this session goes on
    assert other.gets("/people").status == 303  # the other one of the same person has ended
    assert (log_in(server, "carl", first), log_in(server, "carl", "a better one")) == (401, 303)
    said = [one.sentence() for one in Laboratory(server.folder).log().records]
    assert "people.toml changed, by Olga (olga): rig act add-person login=carl" in said
    assert "people.toml changed, by Carl (carl): rig act change-password login=carl" in said
    assert verify_file(server.folder / "log.sqlite").whole
    for path in server.folder.glob("log.sqlite*"):
        assert first.encode() not in path.read_bytes()
        assert b"a better one" not in path.read_bytes()


def logged_in_with(server: Server, login: str, password: str) -> Visitor:
    browser = Visitor(server)
    answer = browser.posts("/login", {"login": login, "password": password})
    browser.cookie = answer.headers["set-cookie"].partition(";")[0]
    browser.csrf = re.findall(r'name="csrf" value="([^"]+)"', browser.gets("/people").text)[0]
    return browser


def test_who_is_disabled_is_out_at_once_and_comes_back(server: Server, olga: Visitor):
    anna = logged_in(server, "anna")
    assert does(olga, "disable-person", login="anna").status == 200
    assert anna.gets("/queue").status == 303
    assert log_in(server, "anna", WORD["anna"]) == 401
    assert "disabled" in olga.gets("/people").text
    assert does(olga, "enable-person", login="anna").status == 200
    server.clock.now += 1000.0
    assert log_in(server, "anna", WORD["anna"]) == 303


def test_roles_are_changed_and_somebody_stays_administrator(server: Server, olga: Visitor):
    assert 'value="operator"' in olga.gets("/act/change-roles?login=anna").text
    assert does(olga, "change-roles", login="anna", roles="viewer, approver").status == 200
    assert Laboratory(server.folder).people().people["anna"].roles == ("viewer", "approver")
    assert "unknown" in does(olga, "change-roles", login="anna", roles="king").text
    for act, more in (("change-roles", {"roles": "viewer"}), ("disable-person", {})):
        refused = does(olga, act, login="olga", **more)
        assert (refused.status, "nobody would be administrator" in refused.text) == (409, True)


def test_a_token_is_issued_works_and_is_revoked(server: Server, olga: Visitor):
    first = shown_once(does(olga, "add-person", login="planner", full_name="Planner", roles="viewer", program="yes"))
    second = shown_once(does(olga, "new-token", login="planner"))

    def status(token: str) -> int:
        return server.ask("/api/people", headers={"authorization": f"Bearer {token}"}).status

    assert (status(first), status(second)) == (401, 200)
    told = server.ask("/api/people", headers={"authorization": f"Bearer {second}"}).text
    assert "argon2" not in told
    assert does(olga, "disable-person", login="planner").status == 200
    assert status(second) == 401
    assert does(olga, "enable-person", login="planner").status == 200
    assert does(olga, "revoke-token", login="planner").status == 200
    assert status(second) == 401


@pytest.mark.parametrize(
    "act", ["add-person", "change-roles", "disable-person", "enable-person", "new-password", "new-token"]
)
def test_only_an_administrator_with_the_password_changes_people(act: str, server: Server, olga: Visitor):
    before = (server.folder / "people.toml").read_bytes()
    fields = {"login": "ben" if act != "add-person" else "carl", "roles": "viewer", "full_name": "Carl"}
    wanted = {key: value for key, value in fields.items() if key == "login" or (key, act) in _NEEDS}
    assert does(logged_in(server, "anna"), act, password=WORD["anna"], **wanted).status == 409
    assert does(olga, act, password="not mine at all", **wanted).status == 409
    assert (server.folder / "people.toml").read_bytes() == before


_NEEDS = {("roles", "add-person"), ("full_name", "add-person"), ("roles", "change-roles")}


def test_others_see_no_list_of_people(server: Server):
    page = logged_in(server, "vera").gets("/people").text
    assert ("Vera" in page, "Olga" in page) == (True, False)


def test_the_command_line_asks_for_a_new_password(server: Server):
    lines = f"a better one\n{WORD['anna']}\n"
    done = typed("act", "change-password", "--login", "anna", lines=lines, cwd=server.folder)
    assert (done.returncode, "is changed" in done.stdout) == (0, True), done.stderr
    assert log_in(server, "anna", "a better one") == 303


# --- passkeys --------------------------------------------------------------------------------------------------


def _text(some: bytes) -> str:
    return urlsafe_b64encode(some).rstrip(b"=").decode()


def _bytes(text: str) -> bytes:
    return urlsafe_b64decode(text + "=" * (-len(text) % 4))


@dataclass
class Device:
    """A device with a passkey: what a browser and an authenticator do together, written from the standard."""

    origin: str = ORIGIN
    host: str = "localhost"
    flags: int = 0x05  # a person is present, and verified
    count: int = 0
    key: ec.EllipticCurvePrivateKey = field(default_factory=lambda: ec.generate_private_key(ec.SECP256R1()))
    id: bytes = b"credential-1"

    def _client(self, sort: str, challenge: str) -> bytes:
        told = {"type": f"webauthn.{sort}", "challenge": challenge, "origin": self.origin, "crossOrigin": False}
        return json.dumps(told).encode()

    def _data(self, more: bytes = b"", flags: int = 0) -> bytes:
        start = hashlib.sha256(self.host.encode()).digest() + bytes([self.flags | flags])
        return start + self.count.to_bytes(4, "big") + more

    def creates(self, options: Any) -> dict[str, Any]:
        numbers = self.key.public_key().public_numbers()
        x, y = numbers.x.to_bytes(32, "big"), numbers.y.to_bytes(32, "big")
        cose = cbor2.dumps({1: 2, 3: -7, -1: 1, -2: x, -3: y})
        data = self._data(bytes(16) + len(self.id).to_bytes(2, "big") + self.id + cose, 0x40)
        made = cbor2.dumps({"fmt": "none", "attStmt": {}, "authData": data})
        client = self._client("create", options["challenge"])
        return self._answer({"attestationObject": _text(made)}, client)

    def signs(self, options: Any) -> dict[str, Any]:
        client, data = self._client("get", options["challenge"]), self._data()
        signed = self.key.sign(data + hashlib.sha256(client).digest(), ec.ECDSA(hashes.SHA256()))
        return self._answer({"authenticatorData": _text(data), "signature": _text(signed)}, client)

    def _answer(self, response: dict[str, str], client: bytes) -> dict[str, Any]:
        named = {"id": _text(self.id), "rawId": _text(self.id), "type": "public-key", "clientExtensionResults": {}}
        return {**named, "response": {"clientDataJSON": _text(client), **response}}


def adds(who: Visitor, device: Device, label: str = "phone", **more: Any) -> Answer:
    options = json.loads(who.posts("/passkey", {"csrf": who.csrf}, HOST).text)
    given = {"csrf": who.csrf, "label": label, "passkey": json.dumps(device.creates(options) | more)}
    login = who.gets("/people").text.partition("You: ")[2].partition("(")[2].partition(")")[0]
    return who.posts("/act/add-passkey", {**given, "password": WORD[login]}, HOST)


def asked(server: Server) -> Any:
    headers = {"content-type": FORM, **HOST}
    return json.loads(server.ask("/login/challenge", method="POST", headers=headers).text)


def sends(server: Server, answer: Any) -> Answer:
    return Visitor(server).posts("/login/passkey", {"credential": json.dumps(answer), "next": "/queue"}, HOST)


def test_a_passkey_is_added_with_the_password_and_logs_in(server: Server):
    anna, device = logged_in(server, "anna"), Device()
    assert "was added" in adds(anna, device).text
    assert "phone" in anna.gets("/people").text
    device.count = 1
    answer = sends(server, device.signs(asked(server)))
    assert (answer.status, answer.headers["location"]) == (303, "/queue")
    again = Visitor(server, answer.headers["set-cookie"].partition(";")[0])
    page = again.gets("/people").text
    assert "logged in by passkey" in page
    again.csrf = re.findall(r'name="csrf" value="([^"]+)"', page)[0]
    assert does(again, "remove-passkey", password=WORD["anna"], label="phone").status == 200
    assert sends(server, device.signs(asked(server))).status == 401


@pytest.mark.parametrize(
    "change",
    [
        {"origin": "https://evil.example"},
        {"host": "evil.example"},
        {"flags": 0x01},
        {"flags": 0x00},
        {"key": ec.generate_private_key(ec.SECP256R1())},
        {"id": b"credential-2"},
        {"count": 4},
    ],
    ids=["origin", "host", "not verified", "not present", "key", "id", "a copy that is behind"],
)
def test_no_other_passkey_logs_in(server: Server, change: dict[str, Any]):
    own = Device(count=5)
    assert "was added" in adds(logged_in(server, "anna"), own).text
    assert sends(server, own.signs(asked(server))).status == 303
    own.count = 6
    answer = sends(server, replace(own, **change).signs(asked(server)))
    assert (answer.status, "set-cookie" in answer.headers) == (401, False)


def test_an_answer_is_used_once_in_time_and_for_what_it_was_asked(server: Server):
    anna, device = logged_in(server, "anna"), Device()
    assert adds(anna, device).status == 200
    answer = device.signs(asked(server))
    assert sends(server, answer).status == 303
    assert sends(server, answer).status == 401
    late = device.signs(asked(server))
    server.clock.now += 301.0
    assert sends(server, late).status == 401
    own = json.loads(anna.posts("/passkey", {"csrf": anna.csrf}, HOST).text)
    assert sends(server, device.signs(own)).status == 401
    assert sends(server, device.signs({"challenge": _text(b"made up by myself")})).status == 401


@pytest.mark.parametrize(
    "answer",
    ["", "[]", "{}", "null", '{"id": 1, "response": 3}', '{"response": {"clientDataJSON": "e30"}}', "[" * 5000],
)
def test_odd_answers_are_refused(server: Server, answer: str):
    refused = Visitor(server).posts("/login/passkey", {"credential": answer}, HOST)
    assert refused.status == 401


def test_a_disabled_person_has_no_passkey(server: Server, olga: Visitor):
    device = Device()
    assert adds(logged_in(server, "anna"), device).status == 200
    assert does(olga, "disable-person", login="anna").status == 200
    assert sends(server, device.signs(asked(server))).status == 401


def test_a_passkey_of_another_person_s_challenge_is_not_added(server: Server):
    anna, ben = logged_in(server, "anna"), logged_in(server, "ben")
    options = json.loads(anna.posts("/passkey", {"csrf": anna.csrf}, HOST).text)
    given = {"csrf": ben.csrf, "label": "phone", "passkey": json.dumps(Device().creates(options))}
    answer = ben.posts("/act/add-passkey", {**given, "password": WORD["ben"]}, HOST)
    assert "nobody asked for it" in answer.text
    assert not Laboratory(server.folder).people().people["ben"].passkeys
    assert ben.posts("/passkey", {"csrf": "0"}, HOST).status == 403
