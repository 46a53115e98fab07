"""Passkeys (WebAuthn): challenges that are used once, and what browsers answer, checked by the library `webauthn`."""

from __future__ import annotations

import hashlib
import ipaddress
import json
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from starlette.requests import Request

from rig.errors import UsageError
from rig.extras import needed
from rig.lab import People, Person, WrongPassword, by_passkey

_MOST_CHALLENGES, _LASTS_S = 2000, 300.0


@dataclass
class Passkeys:
    """Adding and using passkeys.

    Attributes:
        now: stopwatch seconds.
    """

    now: Callable[[], float]
    _asked: OrderedDict[bytes, tuple[str, float]] = field(default_factory=OrderedDict)
    _counts: dict[str, int] = field(default_factory=dict)

    def to_add(self, login: str, person: Person, request: Request) -> str:
        """Options with which a browser makes a passkey for a person, JSON."""
        webauthn, structs = _library()
        known = [structs.PublicKeyCredentialDescriptor(id=_bytes(one.id)) for one in person.passkeys.values()]
        options = webauthn.generate_registration_options(
            rp_id=_host(request),
            rp_name="calibration-rig",
            user_id=hashlib.sha256(f"calibration-rig {login}".encode()).digest(),
            user_name=login,
            user_display_name=person.name,
            exclude_credentials=known,
            authenticator_selection=structs.AuthenticatorSelectionCriteria(
                resident_key=structs.ResidentKeyRequirement.REQUIRED,
                user_verification=structs.UserVerificationRequirement.REQUIRED,
            ),
        )
        self._asks(options.challenge, f"add {login}")
        return str(webauthn.options_to_json(options))

    def added(self, login: str, answer: str, request: Request) -> dict[str, str]:
        """Id and public key of the passkey that a browser made, as `add-passkey` takes them. Raises `UsageError`."""
        webauthn, _ = _library()
        try:
            found = webauthn.verify_registration_response(
                credential=answer,
                expected_challenge=self._answered(answer, f"add {login}"),
                expected_rp_id=_host(request),
                expected_origin=_origin(request),
                require_user_verification=True,
            )
        except _refusals() as error:
            raise UsageError(f"the passkey cannot be used: {error}") from None
        return {"credential": _text(found.credential_id), "public_key": _text(found.credential_public_key)}

    def to_log_in(self, request: Request) -> str:
        """Options with which a browser uses a passkey, JSON."""
        webauthn, structs = _library()
        required = structs.UserVerificationRequirement.REQUIRED
        options = webauthn.generate_authentication_options(rp_id=_host(request), user_verification=required)
        self._asks(options.challenge, "log in")
        return str(webauthn.options_to_json(options))

    def logged_in(self, people: People, answer: str, request: Request) -> tuple[str, Person]:
        """Login and entry of the person whose passkey signed. Raises `WrongPassword`."""
        webauthn, _ = _library()
        try:
            challenge = self._answered(answer, "log in")
            found = by_passkey(people, str(_values(answer).get("id")))
            if found is None:
                raise WrongPassword("this passkey belongs to nobody here")
            login, person, passkey = found
            signed = webauthn.verify_authentication_response(
                credential=answer,
                expected_challenge=challenge,
                expected_rp_id=_host(request),
                expected_origin=_origin(request),
                credential_public_key=_bytes(passkey.key),
                credential_current_sign_count=self._counts.get(passkey.id, 0),
                require_user_verification=True,
            )
        except _refusals() as error:
            raise WrongPassword(f"the passkey was refused: {error}") from None
        self._counts[passkey.id] = signed.new_sign_count
        return login, person

    def _asks(self, challenge: bytes, what: str) -> None:
        while len(self._asked) >= _MOST_CHALLENGES:
            self._asked.popitem(last=False)
        self._asked[challenge] = (what, self.now())

    def _answered(self, answer: str, what: str) -> bytes:
        """The challenge that an answer is to, once and in time. Raises `ValueError`."""
        client = json.loads(_bytes(str(_inner(_values(answer), "response").get("clientDataJSON"))))
        challenge = _bytes(str(client["challenge"]))
        asked, asked_s = self._asked.pop(challenge, ("", 0.0))
        if asked != what or self.now() - asked_s > _LASTS_S:
            raise ValueError("nobody asked for it, or too long ago; try again")
        return challenge


def possible(host: str) -> bool:
    """Whether browsers have passkeys for a host of this name: they have none for IP addresses."""
    try:
        ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return bool(host)
    return False


def _library() -> tuple[Any, Any]:
    return needed("webauthn", "passkeys"), needed("webauthn.helpers.structs", "passkeys")


def _refusals() -> tuple[type[Exception], ...]:
    own: type[Exception] = needed("webauthn.helpers.exceptions", "passkeys").WebAuthnException
    return own, ValueError, TypeError, KeyError, AttributeError, RecursionError


def _host(request: Request) -> str:
    return request.url.hostname or ""


def _origin(request: Request) -> str:
    return f"{request.url.scheme}://{request.headers.get('host', '')}"


def _values(answer: str) -> Mapping[str, Any]:
    found = json.loads(answer)
    if not isinstance(found, dict):
        raise ValueError("it is no credential")
    return found


def _inner(values: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = values.get(key)
    return found if isinstance(found, dict) else {}


def _bytes(text: str) -> bytes:
    return urlsafe_b64decode(text + "=" * (-len(text) % 4))


def _text(some: bytes) -> str:
    return urlsafe_b64encode(some).rstrip(b"=").decode()
