"""A server for language models, by the Model Context Protocol: it reads and proposes, and starts nothing."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field

from rig.acts import Act, Places, act_of, acts
from rig.errors import RigError, UsageError
from rig.extras import needed
from rig.lab import Laboratory, by_token, check_role
from rig.procedures.errors import DataError
from rig.procedures.present.as_json import finite
from rig.serve.apart import apart
from rig.serve.site import TELLS, Site
from rig.version import VERSION
from rig.who import Operator

_ABOUT = (
    "A calibration laboratory. You see benches, queue, runs, proposals and equipment, and may propose runs: each "
    "proposal is rehearsed on simulated instruments, and a person decides on it. You cannot start or approve any."
)


def mcp_server(laboratory: Laboratory, token: str, *, stopwatch: Callable[[], float], utc: Callable[[], float]) -> Any:
    """The server, with a tool for each thing that it may read, and for each act that only proposes.

    Args:
        laboratory: the laboratory.
        token: of the program in `people.toml` that the model acts as.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.

    Raises:
        UsageError: the extra `mcp` is not installed, or the token belongs to nobody.
    """
    module = needed("mcp.server.mcpserver", "mcp")
    server = module.MCPServer("calibration-rig", instructions=_ABOUT, version=VERSION, log_level="ERROR")

    def add(tool: Callable[..., Any], name: str, description: str) -> None:
        server.add_tool(_explained(tool, module.exceptions.ToolError), name=name, description=description)

    _who(laboratory, token, "viewer")
    site = Site(Places(laboratory), stopwatch, utc)
    for name, tell in site.tells().items():
        add(_reading(laboratory, token, tell), name, TELLS[name])

    def run(name: Annotated[str, Field(description="name of the run")]) -> Any:
        _who(laboratory, token, "viewer")
        found = site.run(name)
        if found is None:
            raise UsageError(f"there is no run {name!r:.100}")
        return finite(found)

    add(run, "run", "State, last readings, warnings and events of a run.")
    for act in acts():
        if act.proposes:
            add(_acting(laboratory, token, act), act.name, act.does())
    return server


def _who(laboratory: Laboratory, token: str, role: str) -> Operator:
    """The program with this token, as it is now. Raises `UsageError` if there is none, or it has not got the role."""
    found = by_token(laboratory.people(), token)
    if found is None:
        raise UsageError("RIG_TOKEN is the token of no program here: rig person add LOGIN --program")
    check_role(*found, role)
    return Operator(f"{found[1].name} ({found[0]})", "token")


def _explained(tool: Callable[..., Any], error: type[Exception]) -> Callable[..., Any]:
    """A tool whose errors for people are told to the model as they are."""

    @functools.wraps(tool)
    def told(**values: Any) -> Any:
        try:
            return tool(**values)
        except (RigError, DataError) as problem:
            raise error(str(problem)) from None

    return told


def _reading(laboratory: Laboratory, token: str, tell: Callable[[], Any]) -> Callable[[], Any]:
    def read() -> Any:
        _who(laboratory, token, "viewer")
        return {"found": finite(tell())}

    return read


def _acting(laboratory: Laboratory, token: str, act: type[Act]) -> Callable[..., Any]:
    """A function with the fields of an act as its parameters."""

    def call(**values: Any) -> Any:
        by, places = _who(laboratory, token, act.role), Places(laboratory)
        asked = act_of(act.name, values)
        asked.will(places)
        told = apart(asked, laboratory, by)
        return {"said": told.words, **told.about}

    named = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=Annotated[field.annotation, Field(description=field.description)],
            default=inspect.Parameter.empty if field.is_required() else field.default,
        )
        for name, field in act.model_fields.items()
    ]
    call.__signature__ = inspect.Signature(named)  # type: ignore[attr-defined]  # of functions
    call.__annotations__ = {one.name: one.annotation for one in named}
    return call


def serve_mcp(laboratory: Laboratory, token: str) -> None:
    """Serve on standard input and output until they are closed. Raises as `mcp_server`."""
    from rig.drivers.clock import RealClock  # noqa: PLC0415

    clock = RealClock()
    mcp_server(laboratory, token, stopwatch=clock.stopwatch, utc=clock.utc).run("stdio")
