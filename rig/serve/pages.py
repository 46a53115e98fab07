"""The pages of a laboratory, for people who are logged in."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from functools import cache
from typing import Any
from urllib.parse import quote

import jinja2
from anyio import to_thread
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import Route

from rig.acts import Act, act_of, acts, of_files
from rig.errors import RigError, UsageError
from rig.lab import proven
from rig.serve.acting import Acting, NotConfirmed
from rig.serve.asked import address_of, form_of, own_page
from rig.serve.drift import of_item
from rig.serve.fields import Input, inputs_of
from rig.serve.first_files import FirstFiles
from rig.serve.logging_in import LoggingIn
from rig.serve.passkeys import Passkeys, possible
from rig.serve.sessions import Session, Sessions
from rig.serve.site import Site
from rig.watch.app import Page, Pages, Pause, Streams
from rig.watch.feed import encoded

Handler = Callable[[Request, Session], Awaitable[Response]]
_MOST_STREAMS, _MOST_OF_ONE = 60, 12
_EVERY_S, _BEAT_S = 1.0, 5.0
_REPORT = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; sandbox"
_TYPES = {
    "html": "text/html; charset=utf-8",
    "pdf": "application/pdf",
    "xml": "application/xml",
    "json": "application/json",
}
NAVIGATION = (
    ("/", "Benches"),
    ("/queue", "Queue"),
    ("/runs", "Runs"),
    ("/proposals", "Proposals"),
    ("/results", "Results"),
    ("/equipment", "Equipment"),
    ("/files", "Files"),
    ("/people", "People"),
    ("/log", "Log"),
)


@cache
def _templates() -> jinja2.Environment:
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader("rig.serve"), jinja2.PackageLoader("rig.watch")])
    found = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    found.filters["part"] = lambda text: quote(str(text), safe="")
    found.filters["path"] = lambda text: quote(str(text), safe="/")
    return found


class LaboratoryPages:
    """Routes of the pages.

    Args:
        site: what they show.
        acting: carries out acts.
        sessions: who is logged in.
        pause: waits without blocking other requests.
        encrypted: whether the connection is.
    """

    def __init__(self, site: Site, acting: Acting, sessions: Sessions, pause: Pause, *, encrypted: bool) -> None:
        self._site, self._acting, self._sessions, self._pause = site, acting, sessions, pause
        self._cookie, self._encrypted = ("__Host-rig" if encrypted else "rig_serve"), encrypted
        self._streams = Streams(_MOST_STREAMS, _MOST_OF_ONE)
        self._passkeys = Passkeys(site.stopwatch)
        self._logging_in = LoggingIn(acting, sessions, self._passkeys, self._cookie, encrypted, self._bare)
        self._new = FirstFiles(acting, self._shown)
        self._runs = Pages(
            site.shelf, pause, self._streams, site.acts_of_run, self._lasting, above="/runs", who=self._login
        )

    def routes(self) -> list[Route]:
        """All of them."""
        pages: dict[str, Handler] = {
            "/": self._benches,
            "/events": self._events,
            "/queue": self._queue,
            "/runs": self._list,
            "/proposals": self._proposals,
            "/proposal/{number}": self._proposal,
            "/results": self._results,
            "/certificates": self._results,
            "/equipment": self._equipment,
            "/item/{key:path}": self._item,
            "/files": self._settings,
            "/people": self._people,
            "/log": self._changes,
            "/file/{name:path}": self._file,
            "/run/{name}": lambda request, _: self._runs.run(request),
            "/run/{name}/state.json": lambda request, _: self._runs.state(request),
            "/run/{name}/events": lambda request, _: self._runs.events(request),
        }
        found = [Route(path, self._for_people(handler), methods=["GET"]) for path, handler in pages.items()]
        found.append(Route("/act/{act}", self._for_people(self._act), methods=["GET", "POST"]))
        entry = self._logging_in
        found.append(Route("/passkey", self._for_people(self._passkey), methods=["POST"]))
        found.append(Route("/logout", self._for_people(lambda request, _: entry.logout(request)), methods=["POST"]))
        found.append(Route("/login", entry.login, methods=["GET", "POST"]))
        found.append(Route("/login/challenge", entry.challenge, methods=["POST"]))
        return [*found, Route("/login/passkey", entry.passkey, methods=["POST"])]

    # --- who asks ---------------------------------------------------------------------------------------------

    def _session(self, request: Request, *, seen: bool = True) -> Session | None:
        return self._sessions.of(request.cookies.get(self._cookie, ""), seen=seen)

    def _login(self, request: Request) -> str:
        session = self._session(request, seen=False)
        return "" if session is None else session.login

    def _lasting(self, request: Request) -> bool:
        return self._session(request, seen=False) is not None

    def _for_people(self, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """A handler that only people reach who are logged in; a form must be one of their own pages."""

        async def answer(request: Request) -> Response:
            session = self._session(request)
            if session is None:
                if request.method == "GET" and request.headers.get("accept", "").find("event-stream") < 0:
                    return RedirectResponse(f"/login?next={quote(request.url.path)}", 303)
                raise HTTPException(401, "You are not logged in, or your session has ended.")
            if request.method == "POST":
                request.state.form = form = await form_of(request)
                if not own_page(request) or not session.wrote(form.pop("csrf", "")):
                    raise HTTPException(403, "This form does not belong to a page of your session; go back and reload.")
            return await handler(request, session)

        return answer

    # --- what is shown ----------------------------------------------------------------------------------------

    def _bare(self, template: str, status: int = 200, **values: Any) -> Response:
        return Page(_templates().get_template(template).render(**values), status)

    def _shown(self, template: str, session: Session, here: str, status: int = 200, **values: Any) -> Response:
        about = {"session": session, "here": here, "navigation": NAVIGATION, "lab": self._site.places.folder.name}
        return self._bare(template, status, **about, **values)

    def _live(self, session: Session) -> str:
        """The part of the first page that changes."""
        tasks = self._site.for_person(session.login, session.person.roles)
        template = _templates().get_template("live.html.j2")
        return template.render(benches=self._site.benches(), tasks=tasks, session=session)

    async def _benches(self, _request: Request, session: Session) -> Response:
        live = await to_thread.run_sync(self._live, session)
        return self._shown("benches.html.j2", session, "/", live=live)

    async def _events(self, request: Request, session: Session) -> Response:
        if self._streams.full(session.login):
            return PlainTextResponse("Too many pages are open.\n", 503, {"retry-after": "10"})
        stream = self._stream(request, session)
        return StreamingResponse(stream, media_type="text/event-stream", headers={"x-accel-buffering": "no"})

    async def _stream(self, request: Request, session: Session) -> AsyncIterator[str]:
        sent, quiet_s = "", _BEAT_S
        with self._streams.one(session.login):
            yield "retry: 2000\n\n"
            while self._lasting(request):
                live = await to_thread.run_sync(self._live, session)
                if live != sent:
                    sent, quiet_s = live, 0.0
                    yield f"event: live\ndata: {encoded({'html': live})}\n\n"
                elif quiet_s >= _BEAT_S:
                    quiet_s = 0.0
                    yield "event: beat\ndata: {}\n\n"
                await self._pause(_EVERY_S)
                quiet_s += _EVERY_S
            yield "event: over\ndata: {}\n\n"

    async def _queue(self, _request: Request, session: Session) -> Response:
        queue = await to_thread.run_sync(self._site.queue)
        return self._shown("queue.html.j2", session, "/queue", queue=queue)

    async def _list(self, _request: Request, session: Session) -> Response:
        runs = await to_thread.run_sync(self._site.runs)
        return self._shown("list.html.j2", session, "/runs", runs=runs)

    async def _proposals(self, _request: Request, session: Session) -> Response:
        proposals = await to_thread.run_sync(self._site.proposals)
        return self._shown("proposals.html.j2", session, "/proposals", proposals=proposals)

    async def _proposal(self, request: Request, session: Session) -> Response:
        number = request.path_params["number"]
        proposals = await to_thread.run_sync(self._site.proposals)
        one = next((one for one in proposals if str(one["number"]) == number), None)
        if one is None:
            raise HTTPException(404)
        texts = self._site.log().proposals[one["number"]].asked.documents
        return self._shown("proposal.html.j2", session, "/proposals", one=one, texts=texts)

    async def _results(self, _request: Request, session: Session) -> Response:
        folders = {
            "Reports": [*self._site.documents("reports/", "html"), *self._site.documents("runs/", "html")],
            "Certificates": self._site.documents("certificates/", "pdf", "html", "xml"),
            "Calibrations": [
                *self._site.documents("calibrations/", "json"),
                *(one for one in self._site.documents("runs/", "json") if one["name"].endswith(".calibration.json")),
            ],
        }
        return self._shown("results.html.j2", session, "/results", folders=folders)

    async def _equipment(self, _request: Request, session: Session) -> Response:
        rows = await to_thread.run_sync(self._site.equipment.rows)
        return self._shown("equipment.html.j2", session, "/equipment", rows=rows)

    async def _item(self, request: Request, session: Session) -> Response:
        found = await to_thread.run_sync(of_item, self._site.places.laboratory, request.path_params["key"])
        if found is None:
            raise HTTPException(404)
        return self._shown("item.html.j2", session, "/equipment", item=found)

    async def _settings(self, _request: Request, session: Session) -> Response:
        folders = await to_thread.run_sync(self._site.settings)
        return self._shown("files.html.j2", session, "/files", folders=folders)

    async def _people(self, request: Request, session: Session) -> Response:
        people = await to_thread.run_sync(self._site.people)
        able = possible(request.url.hostname or "")
        return self._shown("people.html.j2", session, "/people", people=people, own=session.person, able=able)

    async def _passkey(self, request: Request, session: Session) -> Response:
        """Options with which a browser makes a passkey."""
        try:
            asked = self._passkeys.to_add(session.login, session.person, request)
        except RigError as error:
            raise HTTPException(409, str(error)) from None
        return Response(asked, media_type="application/json")

    async def _changes(self, _request: Request, session: Session) -> Response:
        changes = await to_thread.run_sync(self._site.changes)
        return self._shown("log.html.j2", session, "/log", changes=changes, problem=self._site.problem)

    async def _file(self, request: Request, _session: Session) -> Response:
        """A report or certificate by its name in the list: a name is looked up, and never used as a path."""
        path = self._site.places.documents().get(request.path_params["name"])
        if path is None:
            raise HTTPException(404)
        kind = _TYPES[path.suffix[1:]]
        headers = {"content-security-policy": _REPORT, "content-disposition": "inline"}
        return Response(await to_thread.run_sync(path.read_bytes), media_type=kind, headers=headers)

    # --- acts -------------------------------------------------------------------------------------------------

    async def _act(self, request: Request, session: Session) -> Response:
        """An act: its form, what will move, and the act itself."""
        name = request.path_params["act"]
        known = next((one for one in acts() if one.name == name), None)
        if known is None:
            raise HTTPException(404)
        if known is of_files.New:
            return await self._new.page(request, session)
        form: dict[str, str] = request.state.form if request.method == "POST" else dict(request.query_params)
        password = form.pop("password", "") if request.method == "POST" else ""
        confirmed = form.pop("confirm", "") == "yes" and request.method == "POST"
        told = await to_thread.run_sync(inputs_of, known, form, self._site.places)
        posted = request.method == "POST"
        try:
            if (answer := form.pop("passkey", "")) and posted:
                form |= self._passkeys.added(session.login, answer, request)
            act = act_of(name, form)
        except UsageError as error:
            why = str(error) if posted else ""
            return self._form(known, session, told, why, status=422 if posted else 200)
        if not posted and any(one.name not in form for one in told):
            return self._form(known, session, told)
        try:
            await self._acting.checked(act, session.login, session.person, confirmed=confirmed)
            if not posted:
                return self._form(known, session, told)
            by = session.operator
            if act.again:
                person = await self._acting.password(session.login, password, address_of(request))
                by = proven(session.login, person)
            done = await self._acting.carry_out(act, by)
            if not act.role:
                self._sessions.keep(request.cookies.get(self._cookie, ""))
        except NotConfirmed as error:
            return self._form(known, session, told, will=str(error))
        except HTTPException as error:
            return self._form(known, session, told, error.detail, status=error.status_code)
        except RigError as error:
            return self._form(known, session, told, str(error), status=409)
        return self._shown("told.html.j2", session, "", told=done)

    def _form(
        self,
        known: type[Act],
        session: Session,
        inputs: list[Input],
        wrong: str = "",
        will: str = "",
        status: int = 200,
    ) -> Response:
        given = {
            "act": known,
            "inputs": inputs,
            "wrong": wrong,
            "will": will,
            "may": not known.role or session.may(known.role),
        }
        return self._shown("act.html.j2", session, "", status, **given)
