"""Next commands that are printed can be copied to a shell, whatever characters are in paths, names and formulas."""

from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command import rig

from rig.cli.commands import COMMANDS
from rig.procedures.present.shell import shell_word

ROOT = Path(__file__).parents[2]
NAMES = ["my night", "it's $HOME", 'a "b" `touch hacked`', "x; touch hacked", "-rf", "a&&b (c) #d *"]
QUOTED = ("shell_word(", "shlex.quote(", "len(")
"""Calls whose result may stand in a printed command."""


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command as a person pastes it into a terminal."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path}
    return subprocess.run(
        ["sh", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("name", NAMES)
def test_the_command_after_a_look_at_a_table_runs(tmp_path, name):
    rows = "".join(f"{x},{2 * x + 0.01 * (-1) ** x}\n" for x in range(1, 12))
    (tmp_path / f"{name}.csv").write_text(f'"set; (V)",out_V\n{rows}')
    seen = rig("fit", f"./{name}.csv", cwd=tmp_path)
    (command,) = re.findall(r"rig fit .*--formula.*", seen.stdout + seen.stderr)
    done = shell(command, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "sigma_E" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}.csv"]


@pytest.mark.parametrize("name", NAMES)
def test_the_command_after_a_status_is_of_this_file(tmp_path, name):
    """Interrupted: `rig resume`. Damaged: `rig verify`, which runs, and names what to do next, again for a shell."""
    run = tmp_path / f"{name}.sqlite"
    shutil.copy(ROOT / "tests" / "data" / "pressure-20261123-interrupted.sqlite", run)
    told = rig("status", f"./{run.name}", cwd=tmp_path).stdout
    (command,) = re.findall(r"continue with: (rig resume .*)", told)
    printed = shell("rig() { printf '%s\\n' \"$@\"; }; " + command, tmp_path).stdout.splitlines()
    assert printed[0] == "resume"
    assert [Path(word).name for word in printed[1:]] == [run.name]
    with run.open("r+b") as file:
        file.seek(run.stat().st_size // 2)
        file.write(b"\0" * 4096)
    refused = rig("fit", f"./{run.name}", cwd=tmp_path)
    (command,) = re.findall(r"`(rig verify .*?)` lists", " ".join(refused.stderr.split()))
    verified = shell(command, tmp_path)
    assert "edited or damaged" in verified.stderr, verified.stderr
    further = re.findall(r"`(rig (?:verify|export) .*?)` saves", " ".join(verified.stderr.split()))
    assert [Path(shlex.split(one)[2]).name for one in further] == [run.name] * 2
    assert not (tmp_path / "hacked").exists()


def test_a_word_for_the_shell_is_one_word():
    for name in (*NAMES, "", "plain.csv", "1 + x^2", "two\nlines"):
        (word,) = shlex.split(shell_word(name))
        assert word.removeprefix("./") == name
    assert shell_word("run.sqlite") == "run.sqlite"
    assert shell_word("-x") == "./-x"


def unquoted(source: str) -> list[str]:
    """Values in f-strings behind `rig COMMAND` that are not quoted for a shell."""
    commands = "|".join(map(re.escape, COMMANDS))
    behind = re.compile(rf"\brig (?:{commands})\b(?:(?! says| shows| then|\. |[`;,):]| \.\.\.).)*?\0(\d+)\0")
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.JoinedStr):
            continue
        values = [part.value for part in node.values if isinstance(part, ast.FormattedValue)]
        count = iter(range(len(values)))
        text = "".join(part.value if isinstance(part, ast.Constant) else f"\0{next(count)}\0" for part in node.values)
        for match in behind.finditer(text):
            value = ast.unparse(values[int(match.group(1))])
            if not any(call in value for call in QUOTED) and value not in {"file", "dry"}:
                found.append(f"line {node.lineno}: {value}")
    return found


def test_what_is_not_quoted_is_found():
    assert unquoted('f"then rig resume {path} again"') == ["line 1: path"]
    assert unquoted('f"`rig fit {shell_word(path)}`; {path}"') == []


def test_no_printed_command_has_a_value_that_is_not_quoted():
    found = {}
    for folder in ("rig", "procedures", "fitter"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if values := unquoted(path.read_text()):
                found[str(path.relative_to(ROOT))] = values
    assert found == {}
