"""What docs/how_to/certificate.md shows works as it stands, in a copy of the example laboratory."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import tomllib
from pathlib import Path

import pytest
from command import rig

from rig.examples import example
from rig.verbs.certificate.settings import CertificateSettings, read_settings

pytest.importorskip("typst")
DOCUMENT = (Path(__file__).parents[2] / "docs" / "how_to" / "certificate.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"```sh\n(.*?)```", DOCUMENT, re.DOTALL)[0].strip().splitlines()


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """Folder, and what each command of the document said."""
    folder = tmp_path_factory.mktemp("lab")
    shutil.copytree(example("load-cell-lab"), folder, dirs_exist_ok=True)
    run, found = "", []
    for line in COMMANDS:
        words = shlex.split(line)
        assert words.pop(0) == "rig"
        more = ["--issued", "2026-11-24"] if words[0] == "certificate" and "--read" not in words else []
        done = rig(*(run if word == "RUN" else word for word in words), *more, cwd=folder)
        assert done.returncode == 0, (line, done.stderr)
        run = done.stdout.splitlines()[0] if words[0] == "run" else run
        found.append(done.stdout)
    return folder / "certificates", found


def test_commands_of_the_document_run_one_after_the_other(said):
    folder, found = said
    names = [f"SIM-LC-2026-0001{more}.{form}" for more in ("", "-1") for form in ("html", "json", "pdf", "xml")]
    assert sorted(path.name for path in folder.iterdir()) == sorted(names)
    assert "SIMULATED certificate SIM-LC-2026-0001: " in found[1]
    assert "Example laboratory for force" in found[2]


def test_the_undeclared_creep_is_on_the_certificate(said):
    folder, _ = said
    told = json.loads((folder / "SIM-LC-2026-0001.json").read_text())
    assert [one["name"] for one in told["effects"]] == ["creep:force_kN"]
    assert told["statements"][0]["verdict"] == "pass"
    assert json.loads((folder / "SIM-LC-2026-0001-1.json").read_text())["amends"]["changes"] == [
        "The customer asked for a new date of issue."
    ]


@pytest.mark.parametrize("lab", ["attitude-lab", "pressure-lab", "load-cell-lab"])
def test_settings_of_the_examples_are_complete(lab):
    settings = read_settings(example(lab) / "certificate.toml")
    assert settings.approved_by
    assert settings.method.name


def test_the_tables_of_the_document_can_be_read():
    shown, of_table = [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", DOCUMENT, re.DOTALL)]
    settings = CertificateSettings(**{key: tuple(v) if isinstance(v, list) else v for key, v in shown.items()})
    assert (settings.decision.rule, settings.tolerance[0].result) == ("guard-band", "offset")
    table = CertificateSettings(**of_table).table
    assert table is not None
    assert table.models.keys() <= table.given_by.keys()
