"""docs/how_to/own_instrument.md: its files, its commands, its forms, and its length."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from command import rig

from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import Instrument
from rig.drivers.scpi_meter import DescribedMeter

TEXT = (Path(__file__).parents[2] / "docs" / "how_to" / "own_instrument.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"^```\w+ ([\w.]+)\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE))


def test_it_is_short():
    prose = re.sub(r"^```.*?^```", "", TEXT, flags=re.DOTALL | re.MULTILINE)
    of_files, of_benches = prose.split("## In the bench file itself")
    assert len(of_files.split()) < 900
    assert len(of_benches.split()) < 1100
    assert all(len(text.splitlines()) <= 60 for text in BLOCKS.values())


def test_its_commands_run_on_its_files(tmp_path):
    for name, text in BLOCKS.items():
        if name.endswith(".toml"):
            (tmp_path / name).write_text(text)
    for command in BLOCKS["run"].splitlines():
        done = rig(*shlex.split(command)[1:], cwd=tmp_path)
        assert done.returncode == 0, (command, done.stdout[-1500:], done.stderr[-1500:])
    assert "complete: 6 of 6 points" in done.stderr


def test_its_run_is_verified_and_resumed_without_its_files(tmp_path):
    """The text of an instrument's file is in the run file."""
    for name, text in BLOCKS.items():
        if name.endswith(".toml"):
            (tmp_path / name).write_text(text)
    rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--create-only", cwd=tmp_path)
    for name in BLOCKS:
        (tmp_path / name).unlink(missing_ok=True)
    (run,) = (tmp_path / "runs").glob("*.sqlite")
    assert rig("service", run, "--user", cwd=tmp_path).returncode == 0
    done = rig("resume", run, cwd=tmp_path)
    assert "complete: 6 of 6 points" in done.stderr
    for command in ("verify", "status", "export"):
        done = rig(command, run, *(["--out", "table.csv"] if command == "export" else []), cwd=tmp_path)
        assert done.returncode == 0, (command, done.stdout, done.stderr)


@pytest.mark.parametrize("form", re.findall(r"`(\{[^`]*\})` \|", TEXT))
def test_its_forms_are_forms(form):
    assert Form(form).parts


def test_the_keys_that_it_names_are_keys():
    named = set(re.findall(r"`(?:\[)?(\w+)(?:\])? =", TEXT)) | set(
        re.findall(r"^(\w+) =", BLOCKS["my_bath.toml"], re.M)
    )
    known = set(re.findall(r'"(\w+)"', str(Instrument.model_json_schema())))
    known |= set(re.findall(r"'(\w+)'", str(Instrument.model_json_schema(by_alias=True))))
    known |= DescribedMeter.Options.model_fields.keys()
    assert named - known == {"a"}  # the name of a channel
