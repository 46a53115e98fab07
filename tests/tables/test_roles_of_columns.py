"""Likely roles of the columns of an unknown table, and the command that is proposed: what a calibration engineer takes.

Shaped like tables that others published (a Hall load cell, a spectrophotometric star, a divider, a thermometer that
cools); the numbers are our own.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import rig

RNG = np.random.default_rng(14)


def table(**columns):
    names = [name.strip("_") if name.startswith("column") else name for name in columns]
    rows = zip(*([*map(str, values)] for values in columns.values()), strict=True)
    return "\n".join([",".join(names), *(",".join(row) for row in rows)]) + "\n"


def told(tmp_path, text, name="data.csv"):
    path = tmp_path / name
    path.write_text(text)
    found = json.loads(rig("fit", path, "--json").stdout)
    return found, {each["column"]: each["role"] for each in found["columns"]}


def test_an_uncertainty_beside_its_quantity_goes_with_the_fit_and_is_said(tmp_path):
    x = np.arange(0, 60, 5)
    u = np.tile([0.1, 0.2, 0.3], 4)
    y = 1 + 2 * x + u * RNG.standard_normal(12)
    found, roles = told(tmp_path, table(z_deg=x, y=y.round(4), u_y=u, w=1 / u**2))
    assert roles == {"z_deg": "setting", "y": "response", "u_y": "uncertainty", "w": "weight"}
    assert found["next"].endswith("--response y --formula '1 + z_deg' --u-y u_y")
    assert "u_y is taken for the standard uncertainty of y; please check that" in found["notes"]
    assert "w is a weight made of u_y" in found["notes"]


@pytest.mark.parametrize(
    ("names", "option", "note"),
    [
        (("T_C", "R_ohm", "u_R"), "--u-y u_R", "u_R is taken for the standard uncertainty of R_ohm"),
        (("step", "charge", "error"), "--u-y error", "an error may also be a deviation or a limit"),
        (("T_C", "R_ohm", "R_sd"), "--u-y R_sd", "R_sd is taken"),
        (("T_C", "R_ohm", "U_R"), "", "U_R may be the expanded uncertainty of R_ohm"),
    ],
)
def test_names_of_uncertainties(tmp_path, names, option, note):
    x = np.arange(0, 120, 20)
    columns = (x, (100 + 0.385 * x + [0.001, -0.002, 0.001, 0.002, -0.001, -0.001]).round(4), [0.002, 0.003] * 3)
    found, roles = told(tmp_path, table(**dict(zip(names, columns, strict=True))))
    assert [*roles.values()] == ["setting", "response", "uncertainty"]
    assert ("--u-y" in found["next"]) == bool(option)
    assert found["next"].endswith(option)
    assert note in " ".join(found["notes"])


def test_the_first_column_without_a_name_is_no_number_of_rows(tmp_path):
    x = np.arange(8)
    lines = [f"{10 * i} {1.01 * i + 0.001 * (i % 3):.4f} {21.1 + 0.1 * (i // 2):.1f}" for i in x]
    found, roles = told(tmp_path, "\n".join(lines) + "\n", "nohead.txt")
    assert roles == {"column_1": "setting", "column_2": "response", "column_3": "covariate"}
    assert found["responses"] == ["column_2"]
    assert "The columns have no names" in found["notes"][0]


def test_time_is_no_response(tmp_path):
    t = 1583331342193977883 + np.arange(40) * 30_000_000_000
    found, roles = told(
        tmp_path, table(**{"Time ns": t, "Temperature": (20 + 57 * np.exp(-np.arange(40) / 15)).round(1)})
    )
    assert roles == {"Time ns": "setting", "Temperature": "response"}
    assert found["next"].endswith("--response Temperature --formula '1 + `Time ns`'")
    assert "recorded over time and nothing else varies" in found["notes"][0]


def test_a_number_of_rows_is_no_quantity_that_was_set(tmp_path):
    found, _ = told(tmp_path, table(Index=np.arange(1, 31), Reading=2.0 + np.sin(np.arange(30) ** 2.0).round(4)))
    assert "recorded over time and nothing else varies" in found["notes"][0]


def test_the_same_quantity_in_two_units_and_a_flag(tmp_path):
    mass = np.arange(0, 4100, 100)
    adc = (mass * 0.25 + np.tile([1, -1, 0, 0], 11)[:41]).round()
    text = table(
        reference_mass_g=mass, reference_mass_kg=mass / 1000, raw_avg_adc=adc, corrected_avg_adc=adc,
        stick_slip_corrected=["false"] * 25 + ["true"] * 16,
    )  # fmt: skip
    found, roles = told(tmp_path, text)
    assert [*roles.values()] == ["setting", "the same quantity", "the same quantity", "response", "group"]
    assert "direction" not in roles.values()
    assert found["next"].endswith("--response corrected_avg_adc --formula '1 + reference_mass_g'")


def test_parallel_outputs_and_a_room_are_no_settings(tmp_path):
    set_V = np.repeat(np.arange(0, 3.3, 0.1).round(1), 10)
    n = len(set_V)
    text = table(
        V=set_V, V_in=set_V + 1e-5 * RNG.standard_normal(n), V_2x=set_V * 1.01 + 1e-4 * RNG.standard_normal(n),
        T=(23.62 + 0.01 * RNG.integers(0, 8, n)).round(2),
    )  # fmt: skip
    found, roles = told(tmp_path, text)
    assert roles == {"V": "setting", "V_in": "other output", "V_2x": "response", "T": "covariate"}
    assert found["next"].endswith("--response V_2x --formula '1 + V'")


def test_the_outputs_of_a_plate_reader_are_no_settings_of_each_other(tmp_path):
    dilution = np.repeat([1, 2, 4, 8, 16, 32], 2)
    outputs = {f"{nm}": (3 / dilution + 0.01 * RNG.standard_normal(12)).round(3) for nm in (660, 664, 666)}
    found, roles = told(tmp_path, table(Well=[f"A{i}" for i in range(12)], Dilution=dilution, **outputs))
    assert roles == {"Well": "text", "Dilution": "setting", **dict.fromkeys(outputs, "response")}
    assert "--response 660 --formula '1 + Dilution" in found["next"]


def test_powers_that_leave_no_scatter_are_not_proposed(tmp_path):
    x = np.arange(3200, 8400, 170)
    found, _ = told(
        tmp_path, table(wavelength_nm=x, reading=np.where(x < 4500, 1.17, -0.25 + (x - 4500) * 2e-4).round(3))
    )
    assert "^" not in found["next"]
    assert "powers up to" in found["curve"]


def test_measured_quantities_alone_are_listed_with_a_doubt(tmp_path):
    walk = np.cumsum(RNG.standard_normal((2, 30)), axis=1).round(3)
    found, _ = told(tmp_path, table(alpha=walk[0], beta=walk[1]))
    assert "No column looks like a setting" in found["notes"][0]
