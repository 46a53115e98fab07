"""A stand with a register and settings for certificates: a load cell under weights, run dry."""

from __future__ import annotations

from pathlib import Path

from general_lab import BENCH, PROCEDURE, run_dry

REGISTER = """
name = "stand"
[laboratory]
name = "Stand laboratory"
address = "1 Weight Road"
calibrates = ["A. Byron"]
approves = ["C. Wheat"]
[equipment.W-1]
maker = "Weights"
model = "M1"
[equipment.W-1.certificate]
number = "F-1"
date = 2020-01-01
due = 2030-01-01
laboratory = "force"
[[equipment.W-1.says]]
quantity = "force_kN"
behaves = "gain"
unit = "%"
expanded = 0.01
k = 2
probability = 0.9545
[equipment.DVM-1]
[equipment.DVM-1.certificate]
number = "E-1"
date = 2020-01-01
laboratory = "voltage"
[[equipment.DVM-1.says]]
quantity = "V"
unit = "mV"
standard = 0.1
range = [-10, 10]
[sensors.cell]
maker = "Cells"
model = "C 10"
serial = "77"
customer = "Bridge builders"
customer_address = "2 River Road"
condition = "clean"
"""
SETTINGS = """
number = "S-{year}-{next:03d}"
country = "GB"
item = "Load cell"
calibrated_by = "A. Byron"
approved_by = "C. Wheat"
at = [{ force_kN = 1 }, { force_kN = 4 }]
[method]
name = "W-3: comparison with weights"
"""
ISSUED = "2026-11-24"


def stand(
    folder: Path, *, register: str = REGISTER, bench: str = BENCH, procedure_more: str = "", **options: str
) -> Path:
    """A finished run of the stand, with its register."""
    folder.mkdir(parents=True, exist_ok=True)
    bench = bench.replace('driver = "person"', 'driver = "person"\nasset = "W-1"')
    bench = bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"')
    (folder / "equipment.toml").write_text(register)
    procedure = PROCEDURE.replace("replications = 2", "replications = 4") + procedure_more
    path, _ = run_dry(folder, procedure, bench=bench, **options)
    return path


def settled(folder: Path, more: str = "", text: str = SETTINGS) -> Path:
    """The file of the settings."""
    path = folder / "certificate.toml"
    path.write_text(text.replace("[method]", f"{more}\n[method]") if "[[" not in more else f"{text}\n{more}")
    return path
