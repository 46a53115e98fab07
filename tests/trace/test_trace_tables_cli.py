"""`rig trace TABLE --response`: JSON with the keys of every trace, text, report, refusals."""

from __future__ import annotations

import csv
import json

import pytest

from proving.truth.table import MISSING, simulate
from rig.cli import main
from rig.cli.show import out
from rig.fitter.trace.engine import family
from rig.procedures.present.effects_shown import show_certificate
from rig.procedures.present.terminal import show
from rig.procedures.present.words import units

DECLARED = ("--response", "y", "--formula", "1 + x")
EFFECT_KEYS = {
    "effect", "cause", "stratum", "term", "terms", "coefficients", "stderr", "unit", "size", "p_adjusted",
    "p_adjusted_is_bound", "share", "aliases", "separation_sigmas", "separate_by",
}  # fmt: skip
SIDE_KEYS = {
    "sigma_E", "sigma_bias", "sigma_prec", "T_bias", "F_bias_95", "T_b", "T_S", "F_bS_95", "cv_rms",
    "sigma_subplot", "sigma_wholeplot", "reading_error_pct",
}  # fmt: skip


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


@pytest.fixture
def table(tmp_path):
    missing = MISSING["drift"]
    columns = simulate(missing.lab, 1, missing.at(2.0))
    path = tmp_path / "cells.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


@pytest.fixture
def rig(monkeypatch, capsys):
    """The command in this process: exit code, what it printed, what it complained of."""

    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["rig", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return (ended.value.code, *capsys.readouterr())

    return run


def test_json_report_and_keys(rig, table, tmp_path):
    page = tmp_path / "cells.html"
    code, printed, complaint = rig("trace", table, *DECLARED, "--time", "t_s", "--report", page, "--json")
    assert code == 0, complaint
    result = json.loads(printed)
    assert result["data"] == {"file": "cells.csv", "points": 120, "kind": "general", "simulated": False}
    found = result["sensors"]["y"]
    assert {"declared", "verdict", "before", "effects", "after", "unnamed", "notes", "fitted", "sentence"} <= set(found)
    assert any("no sign and no largest size is asked" in note for note in found["notes"])
    assert found["verdict"] == "explained"
    assert set(found["before"]) == set(found["after"]) >= SIDE_KEYS
    effect = found["effects"][0]
    assert set(effect) >= EFFECT_KEYS
    assert effect["effect"] == "drift:t_s"
    assert effect["family"] == "drift"
    assert found["fitted"]["coefficients"]["x"]["estimate"] == pytest.approx(2.0, abs=0.2)
    assert "drift:t_s" in found["sentence"]
    assert "; not confirmed by a measurement of its own." in found["certificate"]
    text = page.read_text()
    assert text.count("data:image/png;base64,") == 2
    assert "drift:t_s" in text


def test_columns_of_several_words(rig, table):
    """Names in back-ticks; a comma in a name is no comma between units."""
    header, rows = table.read_text().split("\n", 1)
    names = {"x": '"Set, x (kN)"', "y": '"Read, y (mV)"'}
    table.write_text(",".join(names.get(name, name) for name in header.split(",")) + "\n" + rows)
    options = ("--response", "`Read, y (mV)`", "--formula", "1 + `Set, x (kN)`", "--time", "t_s")
    code, printed, complaint = rig("trace", table, *options, "--json")
    assert code == 0, complaint
    found = json.loads(printed)["sensors"]["Read, y (mV)"]
    assert found["effects"][0]["effect"].startswith("drift")
    assert units(found["effects"][0]) == ["Read, y (mV) per unit of t_s"] * len(found["effects"][0]["terms"])
    assert found["roles"]["settings"] == ["Set, x (kN)"]


def test_text_tells_what_was_taken_for_what(rig, table):
    code, printed, complaint = rig(
        "trace", table, "--response", "y", "--formula", "1 + x", "--ignore", "temp_c", "--full"
    )
    assert code == 0, complaint
    assert "drift:t_s" in printed
    assert "t_s is used as the time" in printed
    assert printed.splitlines()[-1].startswith("  for the certificate: y: the declared model (1 + x) lacks drift:t_s")
    assert printed.count("not confirmed by a measurement of its own") == 1


def test_a_terminal_gets_the_certificate_wrapped(capsys, monkeypatch):
    monkeypatch.setattr(out, "_force_terminal", True)
    monkeypatch.setattr(out, "_width", 40)
    show(show_certificate({"certificate": "it scatters [sic] " * 20}), out)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 8
    assert max(map(len, lines[2:])) <= 40
    assert "[sic]" in lines[2]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--response", "y"), "--formula"),
        (("--group", "unit"), "--response"),
        (("--response", "y", "--formula", "1 + x", "--time", "nothing"), "nothing"),
    ],
)
def test_refusals_say_what_to_do(rig, table, options, words):
    code, _, complaint = rig("trace", table, *options)
    assert code == 2
    assert words in complaint


def test_a_column_with_gaps_can_be_ignored(rig, tmp_path):
    table = tmp_path / "gap.csv"
    rows = [f"{x},{0.1 + x + 0.01 * (x % 2)},{'' if x == 1 else x}" for x in range(6)]
    table.write_text("\n".join(["x_kN,y_V,note_a", *rows]))
    code, _, complained = rig("trace", table, "--response", "y_V", "--formula", "1 + x_kN", "--ignore", "note_a")
    assert code == 0, complained
    _, _, complained = rig("trace", table, "--response", "y_V", "--formula", "1 + x_kN", "--ignore", "note")
    assert "there is no column 'note'; the table has x_kN, y_V, note_a" in " ".join(complained.split())
