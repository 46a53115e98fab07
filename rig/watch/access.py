"""Access to the page: GET only, known host names, a token if required; and the headers of every answer."""

from __future__ import annotations

import hmac
import ipaddress
import platform
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qs, quote, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "rig_watch"

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action {}; frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": _POLICY.format("'none'"),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cache-control": "no-store",
}


@dataclass(frozen=True)
class Access:
    """Conditions for access.

    Attributes:
        token: given once as `?token=`, then kept in a cookie; "" if none is required.
        names: host names of the page, besides IP addresses and localhost.
        methods: what may be asked.
        headers: further headers of every answer that does not have them.
    """

    token: str = ""
    names: frozenset[str] = field(default_factory=lambda: frozenset({platform.node().lower()}))
    methods: tuple[str, ...] = ("GET", "HEAD")
    headers: Mapping[str, str] = field(default_factory=lambda: _HEADERS)

    @classmethod
    def for_acts(cls, names: frozenset[str], *, encrypted: bool) -> Access:
        """Access to a server that also takes forms of its own pages; sessions are its own affair."""
        # browsers send the origin of a form only where they may send a referrer
        headers = {**_HEADERS, "content-security-policy": _POLICY.format("'self'"), "referrer-policy": "same-origin"}
        if encrypted:
            headers["strict-transport-security"] = "max-age=31536000"
        return cls("", cls().names | names, ("GET", "HEAD", "POST"), headers)

    def host_known(self, host: str) -> bool:
        """Whether a Host header names this server.

        A page of another site whose name resolves to this server (DNS rebinding) sends that name. IP addresses and our
        own names are safe; every other name is refused.
        """
        name = _without_port(host)
        if name == "localhost" or name in self.names:
            return bool(name)
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def admits(self, given: str) -> bool:
        """Whether a token is correct; takes equally long for a wrong one."""
        return hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode())


class Guarded:
    """The application behind its checks."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on to the application, or refuse it (ASGI)."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._access.headers.items():
                    headers.setdefault(name, value)
            await send(message)

        refusal = self._refusal(scope)
        await (self._app if refusal is None else refusal)(scope, receive, answer)

    def _refusal(self, scope: Scope) -> Response | None:
        """The answer instead of the page; None to continue."""
        headers = Headers(scope=scope)
        if scope["method"] not in self._access.methods:
            return PlainTextResponse("This page is read-only.\n", 405, {"allow": ", ".join(self._access.methods)})
        if not self._access.host_known(headers.get("host", "")):
            return PlainTextResponse("This host name does not belong to this page's server; use its IP address.\n", 421)
        if not self._access.token:
            return None
        asked = parse_qs(scope["query_string"].decode("latin-1"))
        if "token" in asked:
            if not self._access.admits(asked.pop("token")[0]):
                return _ask_for_token()
            # The token is removed from the address bar at once: addresses are shown, kept and copied.
            query = f"?{urlencode(asked, doseq=True)}" if asked else ""
            here = RedirectResponse("/" + quote(scope["path"].lstrip("/")) + query, 303)
            here.set_cookie(COOKIE, self._access.token, httponly=True, samesite="strict", path="/")
            return here
        cookies = cookie_parser(headers.get("cookie", ""))
        return None if self._access.admits(cookies.get(COOKIE, "")) else _ask_for_token()


def _ask_for_token() -> Response:
    text = "A token is needed: open the address that `rig watch` printed, with ?token=... at its end.\n"
    return PlainTextResponse(text, 401)


def _without_port(host: str) -> str:
    host = host.strip().lower()
    found = re.fullmatch(r"\[([^]]*)](:[0-9]*)?", host)
    if found:
        return found[1]
    return host.rpartition(":")[0] if host.count(":") == 1 else host
