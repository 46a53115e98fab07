"""The pages and their stream of events."""

from __future__ import annotations

from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
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
Acts = Callable[[str, Mapping[str, Any]], list[tuple[str, str]]]

_EVERY_S = 1.0
_BEAT_S = 3.0
_MOST_STREAMS = 60
_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


def make_app(shelf: Shelf, access: Access, pause: Pause, *, streams: int = _MOST_STREAMS) -> ASGIApp:
    """The application.

    Args:
        shelf: the runs it shows.
        access: conditions for access.
        pause: waits this many seconds without blocking other requests.
        streams: maximum number of pages open at once.
    """
    pages = Pages(shelf, pause, Streams(streams))
    routes = [Route("/", pages.start), *pages.of_runs(), *static(Path(__file__).parent / "static")]
    return Guarded(Starlette(routes=routes, exception_handlers={404: not_found}), access)


def static(*folders: Path) -> list[Route]:
    """Routes of the files that pages need, from these folders."""
    files = {path.name: path for folder in folders for path in folder.iterdir() if path.suffix in _TYPES}

    async def file(request: Request) -> Response:
        path = files.get(request.path_params["name"])
        if path is None:
            return await not_found(request, None)
        return Response(path.read_bytes(), media_type=_TYPES[path.suffix])

    return [Route("/static/{name}", file), Route("/favicon.ico", lambda _: RedirectResponse("/static/icon.svg", 307))]


class Page(HTMLResponse):
    """A page."""

    def render(self, content: Any) -> bytes:
        """As in Starlette; lone surrogates, which texts of run files may contain, are escaped."""
        return str(content).encode("utf-8", "backslashreplace")


class Streams:
    """How many pages may be open at once, in all and of one visitor.

    Args:
        most: in all.
        of_one: of one visitor; None for as many as in all.
    """

    def __init__(self, most: int, of_one: int | None = None) -> None:
        self._most, self._of_one = most, most if of_one is None else of_one
        self._open: Counter[str] = Counter()

    def full(self, who: str) -> bool:
        """Whether a visitor may open no further one now."""
        return self._open.total() >= self._most or self._open[who] >= self._of_one

    @contextmanager
    def one(self, who: str) -> Iterator[None]:
        """One open page of a visitor."""
        self._open[who] += 1
        try:
            yield
        finally:
            self._open[who] -= 1
            self._open += Counter()  # those of zero go


class Pages:
    """The pages of runs.

    Args:
        shelf: the runs.
        pause: waits this many seconds without blocking other requests.
        streams: how many pages are open at once.
        acts: what a visitor may do with a run, for its page: (address, words), by name of the run and its view.
        lasting: whether the visitor of a request may still look, asked while its stream is open.
        above: address of the list of runs, if people may act here; "" for pages that only look.
        who: the visitor of a request, of whom there is a number of open pages.
    """

    def __init__(
        self,
        shelf: Shelf,
        pause: Pause,
        streams: Streams,
        acts: Acts = lambda _name, _view: [],
        lasting: Callable[[Request], bool] = lambda _: True,
        above: str = "",
        who: Callable[[Request], str] = lambda _: "",
    ) -> None:
        self._shelf, self._pause, self._streams, self._acts, self._lasting = shelf, pause, streams, acts, lasting
        self._above, self._who = above, who

    def of_runs(self) -> list[Route]:
        """Routes of the page of a run, of its contents, and of its stream."""
        return [
            Route("/run/{name}", self.run),
            Route("/run/{name}/state.json", self.state),
            Route("/run/{name}/events", self.events),
        ]

    async def start(self, _request: Request) -> Response:
        """The one run, or the list of runs."""
        if self._shelf.only is not None:
            return RedirectResponse(f"/run/{quote(self._shelf.only, safe='')}", 307)
        entries = await to_thread.run_sync(self._shelf.entries)
        return Page(_templates().get_template("runs.html.j2").render(entries=entries))

    async def run(self, request: Request) -> Response:
        """The page of one run; its contents come with the stream."""
        name = request.path_params["name"]
        if self._shelf.feed(name) is None:
            return await not_found(request, None)
        alone = self._shelf.only is not None
        return Page(_templates().get_template("run.html.j2").render(name=name, alone=alone, above=self._above))

    async def state(self, request: Request) -> Response:
        """All contents of the page, once, as JSON."""
        feed = self._shelf.feed(request.path_params["name"])
        if feed is None:
            return await not_found(request, None)
        await to_thread.run_sync(feed.refresh)
        content = {**self._view(feed, request.path_params["name"]), "story": feed.lines(0)}
        return Response(encoded(content), media_type="application/json")

    async def events(self, request: Request) -> Response:
        """The state of the run as server-sent events; `Last-Event-ID` names the last record that the page has."""
        feed = self._shelf.feed(request.path_params["name"])
        if feed is None:
            return await not_found(request, None)
        if self._streams.full(self._who(request)):
            return PlainTextResponse("Too many pages are open.\n", 503, {"retry-after": "10"})
        given = request.headers.get("last-event-id", "")
        after = int(given) if given.isascii() and given.isdigit() and len(given) < 16 else 0
        headers = {"x-accel-buffering": "no"}
        stream = self._stream(feed, after, request)
        return StreamingResponse(stream, media_type="text/event-stream", headers=headers)

    def _view(self, feed: RunFeed, name: str) -> dict[str, Any]:
        view = feed.view()
        return {**view, "acts": self._acts(name, view)}

    async def _stream(self, feed: RunFeed, after: int, request: Request) -> AsyncIterator[str]:
        sent: dict[str, Any] = {}
        quiet_s = _BEAT_S
        with self._streams.one(self._who(request)):
            yield "retry: 2000\n\n"
            while self._lasting(request):
                await to_thread.run_sync(feed.refresh)
                view = self._view(feed, request.path_params["name"])
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


async def not_found(_request: Request, _error: Exception | None) -> Response:
    """The answer to an unknown address."""
    return PlainTextResponse("There is no such page here; see / for the existing ones.\n", 404)


@cache
def _templates() -> jinja2.Environment:
    found = jinja2.Environment(
        loader=jinja2.PackageLoader("rig.watch"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    found.filters["utc"] = _utc
    return found


def _utc(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC") if seconds else ""
