"""docs/reference/models.md: its commands print what it says."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from command import rig

from rig.procedures.general.declared import Declared
from rig.procedures.general.fit import fit_general
from rig.procedures.general.series import Series
from rig.tables import FileSource

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "models.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(csv|sh|text)(?: (\S+))?\n(.*?)^```", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Section:
    """Files, and pairs of a command and the lines that it has to print."""

    name: str
    files: dict[str, str]
    commands: list[tuple[str, list[str]]]


def sections():
    for part in PAGE.split("\n## ")[1:]:
        files, commands = {}, []
        for kind, name, text in BLOCK.findall(part):
            if kind == "csv":
                files[name] = text
            elif kind == "sh":
                commands += [(line, []) for line in text.splitlines()]
            else:
                commands[-1][1].extend(text.splitlines())
        if commands:
            yield Section(part.splitlines()[0], files, commands)


def flat(text):
    """Words of printed lines, whatever draws the table."""
    return " ".join(re.sub(r"[│┃|]", " | ", text).split())


@pytest.mark.parametrize("section", list(sections()), ids=lambda section: section.name)
def test_examples_print_what_the_page_says(section, tmp_path):
    for name, text in section.files.items():
        (tmp_path / name).write_text(text)
    for command, lines in section.commands:
        program, *words = shlex.split(command)
        assert program == "rig"
        done = rig(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        printed = flat(done.stdout + done.stderr)
        for line in lines:
            assert flat(line) in printed, done.stdout


def test_there_are_examples():
    assert len(list(sections())) == 6
    assert all(lines for section in sections() for _, lines in section.commands)


def cell(tmp_path):
    text = next(text for kind, name, text in BLOCK.findall(PAGE) if name == "cell.csv")
    (tmp_path / "cell.csv").write_text(text)
    return FileSource(tmp_path / "cell.csv").read


def test_figures_of_iso_376_are_those_computed_by_hand(tmp_path):
    """At 4 kN of the page's table: definitions of the standard, in plain arithmetic."""
    declared = Declared(model="load-cell-cubic", abscissa="force_kN", series=Series("series", "sense", "position_deg"))
    found = fit_general(cell(tmp_path), "deflection_mV_V", declared=declared)
    at = next(row for row in found["iso376"] if row["force_kN"] == 4.0)
    x1, x2, x3, x4, x5, x6 = 0.80031, 0.80030, 0.80026, 0.80049, 0.80035, 0.80057
    mean = (x1 + x3 + x5) / 3
    assert at["mean"] == pytest.approx(mean, rel=1e-12)
    assert at["repeatability"] == pytest.approx(100 * (x1 - x2) / ((x1 + x2) / 2), rel=1e-9)
    assert at["reproducibility"] == pytest.approx(100 * (x5 - x3) / mean, rel=1e-9)
    assert at["reversibility"] == pytest.approx(100 * ((x4 - x3) / x3 + (x6 - x5) / x5) / 2, rel=1e-9)
    b1, b2, b3 = (one["estimate"] for one in found["coefficients"].values())
    fitted = 4 * b1 + 16 * b2 + 64 * b3
    assert at["interpolation"] == pytest.approx(100 * (mean - fitted) / fitted, abs=1e-9)
    assert found["data"]["points"] == 20
    assert "8 rows of falling forces are not fitted: they are in the reversibility" in found["calibration"]["notes"]
    # the highest force is not approached from above
    assert next(row for row in found["iso376"] if row["force_kN"] == 10.0)["reversibility"] is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--series", "series"), "go together"),
        (("--series", "position_deg", "--direction", "sense"), "is repeated within one series"),
        (("--series", "series", "--direction", "nothing"), "there is no column 'nothing'"),
    ],
)
def test_series_that_are_none_are_refused(tmp_path, options, message):
    cell(tmp_path)
    done = rig(
        "fit",
        "cell.csv",
        "--response",
        "deflection_mV_V",
        "--model",
        "load-cell-cubic",
        "--abscissa",
        "force_kN",
        *options,
        cwd=tmp_path,
    )
    assert done.returncode == 2, done.stdout
    assert message in " ".join(done.stderr.split()), done.stderr


def test_numbers_of_the_vapour_example_are_relative_weights(tmp_path):
    """The page says that its weights are one over the square of the pressure."""
    text = next(text for kind, name, text in BLOCK.findall(PAGE) if name == "vapour.csv")
    _, *rows = [line.split(",") for line in text.split()]
    p, w = np.array([row[1:] for row in rows], float).T
    np.testing.assert_allclose(w, 1.0 / p**2, rtol=1e-3)


def test_json_of_a_named_model_has_what_a_certificate_needs(tmp_path):
    text = next(text for kind, name, text in BLOCK.findall(PAGE) if name == "prt.csv")
    (tmp_path / "prt.csv").write_text(text)
    done = rig("fit", "prt.csv", "--response", "R_ohm", "--model", "callendar-van-dusen", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)
    assert found["model"]["parameters"]["R0"] == {"unit": "ohm", "meaning": "resistance at 0 degC"}
    assert found["model"]["valid"]["range"] == [-200.0, 850.0]
    assert [set(row) for row in found["predictions"]] == [{"t_degC", "value", "confidence95", "prediction95"}] * 5
