"""Names and notes with markup in them come out as text: in the terminal, in tables, in reports."""

from __future__ import annotations

import csv
import json

import pytest
from command import rig
from dry import LAB, SHORT, dry
from few_sensors import with_sensors

from proving.forger import Opened, forge
from rig.cli.show import out
from rig.procedures.present.blocks import Grid, Line
from rig.procedures.present.html import html
from rig.procedures.present.terminal import show

NAME = '<script>alert(1)</script>[red]&"$x^{$ ESCAPE'


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("markup")
    bench, world = with_sensors(LAB, folder, "x")
    text = bench.read_text()
    first = next(line for line in text.splitlines() if line.startswith("name ="))
    bench.write_text(text.replace(first, f'name = "{NAME}"'.replace('&"$', '&\\"$')))
    text = SHORT.partition("[environment]")[0].replace('"short"', '"<b>night</b> [bold]x[/]"')
    run = dry(folder, bench=bench, world=world, text=text)
    return forge(run, folder / "forged.sqlite", _with_escape)


def _with_escape(run: Opened) -> None:
    """A bench file's door refuses the character that terminals obey; an earlier version's or a forged run has it."""
    run.documents = {name: text.replace("ESCAPE", "\\u001b[2J") for name, text in run.documents.items()}
    for record in run.records:
        record["body"] = json.loads(json.dumps(record["body"]).replace("ESCAPE", "\\u001b[2J"))


def test_in_the_terminal(run_file):
    for command in ("status", "verify", "fit"):
        done = rig(command, run_file)
        assert done.returncode == 0, done.stderr
        assert "\x1b" not in done.stdout + done.stderr
    said = rig("status", run_file).stdout
    assert "<b>night</b> [bold]x[/]" in said
    assert "<script>alert(1)</script>[red]" in said


def test_in_a_report(run_file, tmp_path):
    page = tmp_path / "page.html"
    done = rig("trace", run_file, "--report", page)
    assert done.returncode in (0, 3), done.stderr
    html = page.read_text()
    assert "<script>alert" not in html
    assert "<b>night" not in html
    assert "&lt;b&gt;night" in html


def test_in_a_table(run_file, tmp_path):
    assert rig("export", run_file, "--out", tmp_path / "data.csv").returncode == 0
    with (tmp_path / "data.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == 30


def test_a_word_between_colons_is_no_picture(capsys):
    """A file may be called so."""
    blocks = [Line("[bold]night:x:2.csv[/]"), Grid(["file"], rows=[("night:x:3.csv",)])]
    show(blocks, out)
    printed = capsys.readouterr().out
    for drawn in (printed, html(blocks)):
        assert "night:x:2.csv" in drawn
        assert "night:x:3.csv" in drawn
