"""What a language model may do in a laboratory: read, and propose."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

import anyio
import pytest
from lab_people import WORD, laboratory, typed
from small_run import write_small

from rig.acts import acts
from rig.acts.act import Act
from rig.lab import Laboratory
from rig.serve.mcp import mcp_server
from rig.serve.site import TELLS

mcp = pytest.importorskip("mcp")


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = laboratory(tmp_path / "lab", "attitude-lab")
    write_small(folder)
    return folder


def token_of(lab: Path, roles: str = "viewer,operator,approver") -> str:
    add = ("person", "add", "model", "--program", "--name", "Model", "--roles", roles, "--login", "olga")
    return typed(*add, lines=f"{WORD['olga']}\n", cwd=lab).stdout.strip()


def asked(lab: Path, token: str, tool: str = "", **values: Any) -> Any:
    """The names of all tools; or the answer of one: its values, or its error as a text."""
    server = mcp_server(Laboratory(lab), token, stopwatch=lambda: 0.0, utc=lambda: 1.8e9)

    async def ask() -> Any:
        async with mcp.Client(server) as client:
            if not tool:
                return {one.name: one for one in (await client.list_tools()).tools}
            found = await client.call_tool(tool, values)
            text = found.content[0].text
            return text if found.is_error else json.loads(text)

    return anyio.run(ask)


def test_it_reads_and_proposes_and_has_no_tool_for_anything_else(lab: Path):
    token = token_of(lab)
    tools = asked(lab, token)
    assert tools.keys() == {*TELLS, "run", "propose"}
    assert tools["propose"].input_schema["required"] == ["procedure", "bench"]
    assert [act.name for act in acts() if act.proposes] == ["propose"]
    for act in ("approve", "start", "hold", "sign"):
        assert "nknown tool" in str(asked(lab, token, act, proposal=1))


def test_an_act_that_moves_or_decides_cannot_be_marked_as_a_proposal():
    with pytest.raises(TypeError, match="more than a proposal"):
        type("Wrong", (Act,), {"__doc__": "Move.", "__module__": __name__}, act="wrong", moves=True, proposes=True)
    assert "wrong" not in [act.name for act in acts()]


def test_what_it_proposes_is_its_own_and_waits_for_a_person(lab: Path):
    token = token_of(lab)
    assert asked(lab, token, "benches")["found"][0]["title"] == "attitude-lab"
    made = asked(lab, token, "propose", procedure="small.toml", bench="bench.toml", why="a new package")
    assert made["proposal"] == 1
    proposal = Laboratory(lab).log().proposals[1]
    assert (proposal.asked.who, proposal.asked.who_by, proposal.state) == ("Model (model)", "token", "waiting")
    assert asked(lab, token, "proposals")["found"][0]["dry"]["outcome"] == "complete"
    assert "there is no" in asked(lab, token, "propose", procedure="/etc/passwd", bench="bench.toml")
    assert "there is no run" in asked(lab, token, "run", name="../people")


def test_a_viewer_reads_and_nobody_does_nothing(lab: Path):
    token = token_of(lab, "viewer")
    assert asked(lab, token, "queue")["found"]["items"] == []
    assert "needs the role operator" in asked(lab, token, "propose", procedure="small.toml", bench="bench.toml")
    with patch.dict(os.environ, {"RIG_TOKEN": "guessed"}):
        done = typed("mcp", lab)
    assert (done.returncode, "the token of no program" in done.stderr) == (2, True)


def test_the_command_speaks_on_its_standard_streams(lab: Path):
    environment = {**os.environ, "RIG_TOKEN": token_of(lab)}
    hello = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "x", "version": "1"}}
    lines = [
        {"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": hello},
        {"jsonrpc": "2.0", "method": "notifications/initialized"},
        {"jsonrpc": "2.0", "id": 2, "method": "tools/list"},
    ]
    command = [sys.executable, "-m", "rig", "mcp", str(lab)]
    with subprocess.Popen(command, env=environment, stdin=-1, stdout=-1, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for line in lines:
            process.stdin.write(json.dumps(line) + "\n")
        process.stdin.flush()
        answers = [json.loads(process.stdout.readline()) for _ in range(2)]
        process.stdin.close()
        assert process.wait(30) == 0
    assert answers[0]["result"]["serverInfo"]["name"] == "calibration-rig"
    assert "propose" in {one["name"] for one in answers[1]["result"]["tools"]}
