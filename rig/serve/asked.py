"""Requests as they are asked: bounded bodies, forms, JSON, and addresses of those who ask."""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import parse_qsl

import anyio
from starlette.exceptions import HTTPException
from starlette.requests import Request

_MOST_BYTES = 64 << 10
_MOST_FIELDS = 100
_MOST_S = 10.0


async def body_of(request: Request, kind: str) -> bytes:
    """The body of a request of this content type. Raises `HTTPException`."""
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if given != kind:
        raise HTTPException(415, f"send {kind}")
    found = bytearray()
    try:
        with anyio.fail_after(_MOST_S):  # a body that trickles would hold its connection for ever
            async for part in request.stream():
                found += part
                if len(found) > _MOST_BYTES:
                    raise HTTPException(413, f"at most {_MOST_BYTES >> 10} kB")
    except TimeoutError:
        raise HTTPException(408, f"send it within {_MOST_S:.0f} s", {"connection": "close"}) from None
    return bytes(found)


async def form_of(request: Request) -> dict[str, str]:
    """Fields of a form, each once. Raises `HTTPException`."""
    body = await body_of(request, "application/x-www-form-urlencoded")
    try:
        pairs = parse_qsl(body.decode("ascii"), keep_blank_values=True, max_num_fields=_MOST_FIELDS, errors="strict")
    except ValueError:
        raise HTTPException(400, "this is no form") from None
    fields = dict(pairs)
    if len(fields) != len(pairs):
        raise HTTPException(400, "a field is there twice")
    return fields


async def json_of(request: Request) -> dict[str, Any]:
    """A JSON object. Raises `HTTPException`."""
    body = await body_of(request, "application/json")
    try:
        found = json.loads(body or b"{}")
    except (ValueError, RecursionError):
        raise HTTPException(400, "this is no JSON") from None
    if not isinstance(found, dict):
        raise HTTPException(400, "send a JSON object")
    return found


def address_of(request: Request) -> str:
    """Address of the client."""
    return request.client.host if request.client is not None else ""


def own_page(request: Request) -> bool:
    """Whether a browser says that a form comes from a page of this server; programs say nothing."""
    site = request.headers.get("sec-fetch-site")
    origin = request.headers.get("origin")
    same = origin is None or origin == f"{request.url.scheme}://{request.headers.get('host', '')}"
    return same and site in (None, "same-origin", "none")
