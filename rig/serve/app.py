"""The server of a laboratory: pages for people, the JSON API for programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import jinja2
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp

import rig.watch
from rig.acts import Places
from rig.errors import ConfigurationError
from rig.lab import Laboratory
from rig.serve.acting import Acting
from rig.serve.api import Api
from rig.serve.pages import LaboratoryPages
from rig.serve.sessions import Patience, Sessions
from rig.serve.site import Site
from rig.watch.access import Access, Guarded
from rig.watch.app import Page, Pause, static

_PROBLEM = jinja2.Environment(loader=jinja2.PackageLoader("rig.serve"), autoescape=True).get_template("problem.html.j2")


def make_app(
    laboratory: Laboratory,
    *,
    stopwatch: Callable[[], float],
    utc: Callable[[], float],
    pause: Pause,
    names: frozenset[str] = frozenset(),
    encrypted: bool = False,
) -> ASGIApp:
    """The application.

    Args:
        laboratory: the laboratory.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.
        pause: waits this many seconds without blocking other requests.
        names: host names of the server, besides IP addresses and localhost.
        encrypted: whether connections are.
    """
    places = Places(laboratory)
    site = Site(places, stopwatch, utc)
    acting = Acting(places, Patience(stopwatch))
    sessions = Sessions(laboratory.people, stopwatch)
    pages = LaboratoryPages(site, acting, sessions, pause, encrypted=encrypted)
    files = [Path(module.__path__[0]) / "static" for module in (rig.watch, rig.serve)]
    handlers = {HTTPException: _problem, ConfigurationError: _defect}
    app = Starlette(
        routes=[*pages.routes(), *Api(site, acting).routes(), *static(*files)],
        exception_handlers=handlers,  # type: ignore[arg-type]  # of these exceptions, each its own
    )
    return Guarded(app, Access.for_acts(names, encrypted=encrypted))


async def _problem(request: Request, error: HTTPException) -> Response:
    words = error.detail if error.status_code != 404 else "There is no such page here."
    if request.url.path.startswith("/api/"):
        return JSONResponse({"error": words}, error.status_code, error.headers)
    return Page(_PROBLEM.render(status=error.status_code, words=words), error.status_code, error.headers)


async def _defect(request: Request, error: ConfigurationError) -> Response:
    return await _problem(request, HTTPException(500, str(error)))
