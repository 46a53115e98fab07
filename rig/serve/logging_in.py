"""Logging in and out: by password, or by a passkey."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from anyio import to_thread
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from rig.errors import RigError
from rig.lab import Person, WrongPassword
from rig.serve.acting import Acting
from rig.serve.asked import address_of, form_of, own_page
from rig.serve.passkeys import Passkeys, possible
from rig.serve.sessions import Sessions


@dataclass(frozen=True)
class LoggingIn:
    """The pages.

    Attributes:
        acting: checks passwords.
        sessions: who is logged in.
        passkeys: checks passkeys.
        cookie: name of the cookie.
        encrypted: whether the connection is.
        bare: draws a template without a session.
    """

    acting: Acting
    sessions: Sessions
    passkeys: Passkeys
    cookie: str
    encrypted: bool
    bare: Callable[..., Response]

    async def login(self, request: Request) -> Response:
        """The form, and its answer. The same message for every wrong pair."""
        if request.method == "GET":
            return self._form(request, following=_own(request.query_params.get("next", "/")))
        form = await _form_of(request)
        login, following = form.get("login", ""), _own(form.get("next", "/"))
        try:
            person = await self.acting.password(login, form.get("password", ""), address_of(request))
        except WrongPassword as error:
            return self._form(request, 401, wrong=str(error), login=login, following=following)
        except HTTPException as error:
            page = self._form(request, error.status_code, wrong=error.detail, login=login, following=following)
            page.headers.update(error.headers or {})
            return page
        return self._begun(request, login, person, "password", following)

    async def challenge(self, request: Request) -> Response:
        """Options with which a browser uses a passkey."""
        if not own_page(request):
            raise HTTPException(403, "This form does not come from this server.")
        return Response(_asked(self.passkeys.to_log_in, request), media_type="application/json")

    async def passkey(self, request: Request) -> Response:
        """The answer of a passkey."""
        form = await _form_of(request)
        following = _own(form.get("next", "/"))
        people = await to_thread.run_sync(self.acting.places.laboratory.people)
        with self.acting.patient(address_of(request)) as attempt:
            try:
                login, person = await to_thread.run_sync(
                    self.passkeys.logged_in, people, form.get("credential", ""), request
                )
            except RigError as error:
                attempt.failed = True
                return self._form(request, 401, wrong=str(error), following=following)
        return self._begun(request, login, person, "passkey", following)

    async def logout(self, request: Request) -> Response:
        """End the session of a request."""
        self.sessions.end(request.cookies.get(self.cookie, ""))
        answer = RedirectResponse("/login", 303)
        answer.delete_cookie(self.cookie, path="/", httponly=True, samesite="strict", secure=self.encrypted)
        return answer

    def _form(
        self, request: Request, status: int = 200, *, wrong: str = "", login: str = "", following: str = "/"
    ) -> Response:
        passkeys = possible(request.url.hostname or "")
        page = {"wrong": wrong, "login": login, "following": following, "passkeys": passkeys}
        return self.bare("login.html.j2", status, **page)

    def _begun(
        self, request: Request, login: str, person: Person, by: Literal["password", "passkey"], following: str
    ) -> Response:
        self.sessions.end(request.cookies.get(self.cookie, ""))
        answer = RedirectResponse(following, 303)
        cookie = self.sessions.begin(login, person, by)
        answer.set_cookie(self.cookie, cookie, httponly=True, samesite="strict", path="/", secure=self.encrypted)
        return answer


async def _form_of(request: Request) -> dict[str, str]:
    form = await form_of(request)
    if not own_page(request):
        raise HTTPException(403, "This form does not come from this server.")
    return form


def _asked(options: Callable[[Request], str], request: Request) -> str:
    try:
        return options(request)
    except RigError as error:
        raise HTTPException(409, str(error)) from None


def _own(address: str) -> str:
    """An address of this server; "/" for any other."""
    plain = address.startswith("/") and not address.startswith(("//", "/\\")) and address.isprintable()
    return address if plain and "\\" not in address else "/"
