"""docs/how_to/can.md: its files and its commands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from command import rig

from rig.contracts.declared.instrument import Instrument

TEXT = (Path(__file__).parents[2] / "docs" / "how_to" / "can.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"^```\w+ ([\w.]+)\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE))


def test_its_commands_run_on_its_files(tmp_path):
    for name, text in BLOCKS.items():
        (tmp_path / name).write_text(text)
    for command in BLOCKS["run"].splitlines():
        done = rig(*shlex.split(command)[1:], cwd=tmp_path)
        assert done.returncode == 0, (command, done.stdout[-1500:], done.stderr[-1500:])
    assert "complete: 6 of 6 points" in done.stderr
    (run,) = (tmp_path / "runs").glob("*.sqlite")
    (tmp_path / "my_chamber.dbc").unlink()  # the run file has its text
    assert rig("verify", run, cwd=tmp_path).returncode == 0


def test_the_keys_that_it_names_are_keys():
    named = set(re.findall(r"`(\w+) =", TEXT)) | set(re.findall(r"^(\w+) =", BLOCKS["my_chamber.toml"], re.MULTILINE))
    known = set(re.findall(r"'(\w+)'", str(Instrument.model_json_schema(by_alias=True))))
    assert named - known == {"a", "node"}  # the name of a channel, and of a parameter
