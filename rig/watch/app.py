"""The pages and their stream of events."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from rig.watch.access import Access, Guarded
from rig.watch.feed import RunFeed, encoded
from rig.watch.shelf import Shelf

Pause = Callable[[float], Awaitable[None]]

_EVERY_S = 1.0
_BEAT_S = 3.0
_MOST_STREAMS = 60
_STATIC = {
    "watch.css": "text/css; charset=utf-8",
    "watch.js": "text/javascript; charset=utf-8",
    "chart.js": "text/javascript; charset=utf-8",
    "icon.svg": "image/svg+xml",
}


def make_app(shelf: Shelf, access: Access, pause: Pause, *, streams: int = _MOST_STREAMS) -> ASGIApp:
    """The application.

    Args:
        shelf: the runs it shows.
        access: conditions for access.
        pause: waits this many seconds without blocking other requests.
        streams: maximum number of pages open at once.
    """
    pages = _Pages(shelf, pause, streams)
    routes = [
        Route("/", pages.start),
        Route("/run/{name}", pages.run),
        Route("/run/{name}/state.json", pages.state),
        Route("/run/{name}/events", pages.events),
        Route("/static/{name}", _static),
        Route("/favicon.ico", lambda _: RedirectResponse("/static/icon.svg", 307)),
    ]
    return Guarded(Starlette(routes=routes, exception_handlers={404: _not_found}), access)


class _Page(HTMLResponse):
    def render(self, content: Any) -> bytes:
        """As in Starlette; lone surrogates, which texts of run files may contain, are escaped."""
        return str(content).encode("utf-8", "backslashreplace")


class _Pages:
    def __init__(self, shelf: Shelf, pause: Pause, streams: int) -> None:
        self._shelf, self._pause, self._most = shelf, pause, streams
        self._open = 0
        self._templates = jinja2.Environment(
            loader=jinja2.PackageLoader("rig.watch"), autoescape=True, undefined=jinja2.StrictUndefined
        )
        self._templates.filters["utc"] = _utc

    async def start(self, _request: Request) -> Response:
        """The one run, or the list of runs."""
        if self._shelf.only is not None:
            return RedirectResponse(f"/run/{quote(self._shelf.only, safe='')}", 307)
        entries = await to_thread.run_sync(self._shelf.entries)
        return _Page(self._templates.get_template("runs.html.j2").render(entries=entries))

    async def run(self, request: Request) -> Response:
        """The page of one run; its contents come with the stream."""
        name = request.path_params["name"]
        if self._shelf.feed(name) is None:
            return await _not_found(request, None)
        alone = self._shelf.only is not None
        return _Page(self._templates.get_template("run.html.j2").render(name=name, alone=alone))

    async def state(self, request: Request) -> Response:
        """All contents of the page, once, as JSON."""
        feed = self._shelf.feed(request.path_params["name"])
        if feed is None:
            return await _not_found(request, None)
        await to_thread.run_sync(feed.refresh)
        content = {**feed.view(), "story": feed.lines(0)}
        return Response(encoded(content), media_type="application/json")

    async def events(self, request: Request) -> Response:
        """The state of the run as server-sent events; `Last-Event-ID` names the last record that the page has."""
        feed = self._shelf.feed(request.path_params["name"])
        if feed is None:
            return await _not_found(request, None)
        if self._open >= self._most:
            return PlainTextResponse("Too many pages are open.\n", 503, {"retry-after": "10"})
        given = request.headers.get("last-event-id", "")
        after = int(given) if given.isascii() and given.isdigit() and len(given) < 16 else 0
        headers = {"x-accel-buffering": "no"}
        return StreamingResponse(self._stream(feed, after), media_type="text/event-stream", headers=headers)

    async def _stream(self, feed: RunFeed, after: int) -> AsyncIterator[str]:
        sent: dict[str, Any] = {}
        quiet_s = _BEAT_S
        self._open += 1
        try:
            yield "retry: 2000\n\n"
            while True:
                await to_thread.run_sync(feed.refresh)
                view = feed.view()
                news = {name: content for name, content in view.items() if name not in sent or sent[name] != content}
                story = feed.lines(after)
                after = max(after, story["seq"])
                if story["lines"] or "story" not in sent:
                    news["story"] = sent["story"] = story
                sent |= {name: view[name] for name in view if name in news}
                if news:
                    quiet_s = 0.0
                    yield f"id: {after}\nevent: news\ndata: {encoded(news)}\n\n"
                elif quiet_s >= _BEAT_S:
                    quiet_s = 0.0
                    yield "event: beat\ndata: {}\n\n"
                await self._pause(_EVERY_S)
                quiet_s += _EVERY_S
        finally:
            self._open -= 1


async def _static(request: Request) -> Response:
    name = request.path_params["name"]
    if name not in _STATIC:
        return await _not_found(request, None)
    return Response((Path(__file__).parent / "static" / name).read_bytes(), media_type=_STATIC[name])


async def _not_found(_request: Request, _error: Exception | None) -> Response:
    return PlainTextResponse("There is no such page here; see / for the existing ones.\n", 404)


def _utc(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC") if seconds else ""
