"""The page of first files: the questions of `rig new` as a form, their plan, and the files before they are written."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from anyio import to_thread
from starlette.requests import Request
from starlette.responses import Response

from rig.acts import Act, Places, Told, of_files
from rig.acts.act import act_of
from rig.errors import RigError
from rig.lab import check_role
from rig.serve.acting import Acting
from rig.serve.sessions import Session

Shown = Callable[..., Response]


@dataclass(frozen=True)
class FirstFiles:
    """The page.

    Attributes:
        acting: carries out acts.
        shown: draws a template for a session.
    """

    acting: Acting
    shown: Shown

    async def page(self, request: Request, session: Session) -> Response:
        """The form; its plan and files, once all answers are right; and what came of writing them."""
        form: dict[str, str] = request.state.form if request.method == "POST" else {}
        folder, do, part = (form.pop(key, "") for key in ("folder", "do", "part"))
        assumed, digest = _texts(form.pop("assumed", "{}")), form.pop("sha256", "")
        places = self.acting.places
        asked, answers = await to_thread.run_sync(_asked, form, assumed, places)
        page: dict[str, Any] = {"asked": asked, "folder": folder, "left": [], "may": session.may(of_files.New.role)}
        page["left"] = [one for one in form.items() if one[0] not in {each["key"] for each in asked}]
        page |= {"told": None, "wrong": "", "ports": {}, "part": part}
        right = not any(one["wrong"] for one in asked)
        if request.method == "GET" or part == "questions":
            return self._drawn(session, page)
        try:
            check_role(session.login, session.person, of_files.New.role)
            if do.startswith("ports:"):
                key = do.removeprefix("ports:")
                told = await self._done("ports", {"address": form.get(key, "")}, session)
                page["ports"] = {key: told.about["found"]}
            elif right:
                named = {"folder": folder or "new-bench", "answers": answers}
                write = do == "write" and bool(folder)
                more = {"sha256": digest or "not shown"} if write else {"show": True}
                told = await self._done("new", {**named, **more}, session)
                if write:
                    return self.shown("told.html.j2", session, "/files", told=told)
                page["told"] = told.about
        except RigError as error:
            page["wrong"] = str(error)
        return self._drawn(session, page, 409 if page["wrong"] else 200)

    def _drawn(self, session: Session, page: Mapping[str, Any], status: int = 200) -> Response:
        return self.shown("new.html.j2", session, "/files", status, **page)

    async def _done(self, name: str, values: Mapping[str, Any], session: Session) -> Told:
        act: Act = act_of(name, values)
        await self.acting.checked(act, session.login, session.person, confirmed=False)
        return await self.acting.carry_out(act, session.operator)


def _asked(form: Mapping[str, str], assumed: Mapping[str, str], places: Places) -> tuple[list[dict[str, Any]], Any]:
    """Questions for the template, and the answers by names that an act takes; own instruments are offered, too."""
    from rig.new import instruments  # noqa: PLC0415 - loads all drivers
    from rig.new.asked import asked  # noqa: PLC0415
    from rig.new.instruments import PARTS  # noqa: PLC0415
    from rig.new.questions import with_key  # noqa: PLC0415

    own = places.instruments()
    names = {str(path): name for name, path in own.items()}
    parts = {with_key(part): part for part in PARTS}
    given: dict[str, str] = {}
    wrong: dict[str, str] = {}
    for key, value in form.items():
        try:
            given |= of_files.located({key: value}, places)
        except RigError as error:
            wrong[key] = str(error)
    found, answers = asked(given, assumed)
    rows = []
    for one in found:
        key, choices = one.question.key, dict(one.choices)
        if key in parts:
            for name, path in own.items():
                try:
                    if not instruments.unsuitable(parts[key], str(path), answers):
                        choices[name] = "an instrument of your own"
                except RigError:
                    continue  # a file that is no instrument yet
        shown = replace(one, value=names.get(one.value, one.value))
        value = form.get(key, "") if one.wrong else shown.value
        rows.append(
            {
                "key": key,
                "ask": one.question.ask,
                "why": one.question.why,
                "port": one.question.port,
                "value": value,
                "assumed": one.assumed,
                "choices": choices if choices and (key in parts or key == "order") else {},
                "hints": choices if choices and key not in parts and key != "order" else {},
                "wrong": wrong.get(key) or one.wrong,
            }
        )
    return rows, {key: names.get(value, value) if isinstance(value, str) else value for key, value in answers.items()}


def _texts(given: str) -> dict[str, str]:
    try:
        found = json.loads(given)
    except (ValueError, RecursionError):
        return {}
    return {str(key): str(value) for key, value in found.items()} if isinstance(found, dict) else {}
