"""The JSON API: the same acts for programs, and what pages show; and its OpenAPI description.

A program has a token, `Authorization: Bearer TOKEN`. Acts that ask for a password take a person's, as HTTP Basic.
Cookies mean nothing here, so that no page of another site can use a session.
"""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Awaitable, Callable
from typing import Any

from anyio import to_thread
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from rig.acts import act_of, acts
from rig.errors import RigError, UsageError
from rig.lab import Person, WrongPassword, by_token, proven
from rig.procedures.present.as_json import finite
from rig.serve.acting import Acting, NotConfirmed
from rig.serve.asked import address_of, json_of
from rig.serve.drift import of_item
from rig.serve.site import TELLS, Site
from rig.version import VERSION
from rig.who import Operator

Who = tuple[str, Person, bool]
"""Login, entry, and whether a password proved it."""


class Api:
    """Routes of the API.

    Args:
        site: what it tells.
        acting: carries out acts.
    """

    def __init__(self, site: Site, acting: Acting) -> None:
        self._site, self._acting = site, acting

    def routes(self) -> list[Route]:
        """All of them."""
        found = [
            Route(f"/api/{name}", self._told(tells), methods=["GET"]) for name, tells in self._site.tells().items()
        ]
        found.append(Route("/api/runs/{name}", self._run, methods=["GET"]))
        found.append(Route("/api/items/{name:path}", self._item, methods=["GET"]))
        found.append(Route("/api/act/{act}", self._act, methods=["POST"]))
        return [*found, Route("/api/openapi.json", lambda _: JSONResponse(openapi()), methods=["GET"])]

    def _told(self, tells: Callable[[], Any]) -> Callable[[Request], Awaitable[Response]]:
        async def answer(request: Request) -> Response:
            await self._who(request)
            return JSONResponse(finite(await to_thread.run_sync(tells)))

        return answer

    async def _item(self, request: Request) -> Response:
        await self._who(request)
        found = await to_thread.run_sync(of_item, self._acting.places.laboratory, request.path_params["name"])
        if found is None:
            raise HTTPException(404, "no certificate is of this item")
        results = [{"what": one["what"], "values": one["values"]} for one in found["results"]]
        due = found["due"]
        told = {"key": found["key"], "certificates": found["certificates"], "results": results}
        return JSONResponse({**told, "due": "" if due is None else due.on, "by": "" if due is None else due.by})

    async def _run(self, request: Request) -> Response:
        await self._who(request)
        found = await to_thread.run_sync(self._site.run, request.path_params["name"])
        if found is None:
            raise HTTPException(404, "there is no such run")
        return JSONResponse(finite(found))

    async def _act(self, request: Request) -> Response:
        login, person, by_word = await self._who(request)
        given = await json_of(request)
        confirmed = given.pop("confirm", False) is True
        name = request.path_params["act"]
        if all(one.name != name for one in acts()):
            raise HTTPException(404, "there is no such act")
        try:
            act = act_of(name, given)
        except UsageError as error:
            raise HTTPException(422, str(error)) from None
        if act.again and not by_word:
            raise HTTPException(403, "this asks for a person's password: HTTP Basic, not a token")
        if act.role and act.role not in person.roles:
            raise HTTPException(403, f"this needs the role {act.role}")
        try:
            await self._acting.checked(act, login, person, confirmed=confirmed)
            by = proven(login, person) if by_word else Operator(f"{person.name} ({login})", "token")
            told = await self._acting.carry_out(act, by)
        except NotConfirmed as error:
            return JSONResponse({"error": "send confirm: true", "confirm": str(error)}, 428)
        except RigError as error:
            raise HTTPException(409, str(error)) from None
        return JSONResponse({"said": told.words, **told.about})

    async def _who(self, request: Request) -> Who:
        """The person or program that asks. Raises `HTTPException`."""
        scheme, _, given = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            people = await to_thread.run_sync(self._acting.places.laboratory.people)
            found = by_token(people, given.strip())
            if found is not None:
                return (*found, False)
        elif scheme.lower() == "basic":
            try:
                login, _, password = b64decode(given, validate=True).decode().partition(":")
                return login, await self._acting.password(login, password, address_of(request)), True
            except (ValueError, WrongPassword):
                pass
        raise HTTPException(401, "a token, Authorization: Bearer TOKEN, or a login and password, Authorization: Basic")


def openapi() -> dict[str, Any]:
    """The API in the words of OpenAPI 3.1, made from the acts."""
    said = {"description": "a sentence, and values", "content": {"application/json": {"schema": {"type": "object"}}}}
    errors = {
        "401": {"description": "no token, or a wrong one"},
        "403": {"description": "another role, or a password is needed"},
        "409": {"description": "it cannot be done: the reason"},
        "422": {"description": "a value is missing or wrong"},
        "428": {"description": "something would move: the sentence to confirm; send it again with confirm: true"},
        "429": {"description": "too many wrong passwords; Retry-After says how long to wait"},
    }
    answers = {"200": said, "401": errors["401"]}
    tells: dict[str, Any] = {
        f"/api/{name}": {"get": {"operationId": name, "summary": words, "responses": answers}}
        for name, words in TELLS.items()
    }
    named = [{"name": "name", "in": "path", "required": True, "schema": {"type": "string"}}]
    for path, name, words in (
        ("runs", "run", "All contents of the page of a run."),
        ("items", "item", "Certificates of an item, its results over time, and when it is due."),
    ):
        about = {"operationId": name, "summary": words, "parameters": named, "responses": answers}
        tells[f"/api/{path}/{{name}}"] = {"get": about}
    return {
        "openapi": "3.1.0",
        "info": {"title": "calibration-rig", "version": VERSION, "summary": "Acts in a laboratory, for programs."},
        "components": {
            "securitySchemes": {
                "token": {"type": "http", "scheme": "bearer"},
                "password": {"type": "http", "scheme": "basic"},
            }
        },
        "security": [{"token": []}, {"password": []}],
        "paths": {**tells, **{f"/api/act/{act.name}": {"post": _described(act, said, errors)} for act in acts()}},
    }


def _described(act: Any, said: dict[str, Any], errors: dict[str, Any]) -> dict[str, Any]:
    schema = act.model_json_schema()
    for part in ("title", "description"):
        schema.pop(part, None)
    for one in schema.get("properties", {}).values():
        one.pop("of", None)
        one.pop("title", None)
    if act.moves:
        confirm = {"type": "boolean", "default": False, "description": "that what moves may move"}
        schema.setdefault("properties", {})["confirm"] = confirm
    needs = f"{f'Role {act.role}' if act.role else 'Everybody'}{'; a password, no token' if act.again else ''}."
    return {
        "operationId": act.name,
        "summary": act.does(),
        "description": needs,
        **({"security": [{"password": []}]} if act.again else {}),
        "requestBody": {"required": True, "content": {"application/json": {"schema": schema}}},
        "responses": {"200": said, **errors},
    }
