"""A certificate made by hand, with all of its parts, for tests of its forms."""

from __future__ import annotations

from dataclasses import replace
from datetime import date

from rig.verbs.certificate.document import (
    Amendment,
    Condition,
    Dates,
    Document,
    Equipment,
    Evidence,
    External,
    Holding,
    Item,
    Laboratory,
    Logo,
    Method,
    Party,
    Person,
    Supplied,
)
from rig.verbs.certificate.measured import Budget, Column, Contribution, Effect, Result, ResultTable, Stage, Statement

LOGO = (
    b'<svg xmlns="http://www.w3.org/2000/svg" width="120" height="60" viewBox="0 0 120 60">'
    b'<rect width="120" height="60" rx="4" fill="#2f5d8a"/>'
    b'<path d="M12 44 L36 14 L60 44" stroke="#fff" stroke-width="5" fill="none"/>'
    b'<circle cx="88" cy="30" r="15" fill="none" stroke="#fff" stroke-width="5"/></svg>'
)
PRESSURES = ("0.010", "0.120", "0.500", "0.790", "1.000", "2.500", "4.000", "5.000")


def document(*, items: int = 1, simulated: bool = False, stages: tuple[Stage, ...] = ("",)) -> Document:
    """A certificate of pressure transducers."""
    sensors = tuple(f"bridge_{n + 1}" for n in range(items))
    return Document(
        number="K-2026-0147",
        simulated=simulated,
        laboratory=Laboratory(
            Party(
                "Hillside Calibration Laboratory",
                ("14 Standards Road", "EX1 2AB Hillside", "United Kingdom"),
                "GB",
                "certificates@hillside.example",
                "+44 1632 960147",
            ),
            "Accredited calibration laboratory no. 0417 (ISO/IEC 17025:2017)",
            Logo(LOGO, "svg"),
        ),
        customer=Party(
            "Meridian Space Systems Ltd", ("Unit 7, Orbit Park", "AB12 3CD Northport", "United Kingdom"), "GB"
        ),
        items=tuple(
            Item(
                name,
                "Pressure transducer, 0 to 5 psi absolute",
                "Northfield Sensors",
                "PT-105A",
                f"4411{n:02d}",
                "clean, no visible damage",
                customer_id=f"MSS-P-{n + 1:03d}",
                from_customer=("serial",) if n == 0 else (),
            )
            for n, name in enumerate(sensors)
        ),
        place="Laboratory 2, 14 Standards Road, Hillside",
        dates=Dates(date(2026, 11, 2), date(2026, 11, 9), date(2026, 11, 14), date(2026, 11, 24)),
        calibrated_by=(Person("Ada Byron", "calibration engineer"),),
        approved_by=Person("Charles Wheat", "head of the laboratory"),
        method=Method(
            "Comparison with a pressure controller at 20 pairs of temperatures, procedure PL-12, issue 4",
            (
                "Every pair of temperatures was a whole plot of 11 pressures in random order. The model was fitted by "
                "restricted maximum likelihood, with errors of whole plots and of points.",
            ),
            (
                "McCollum, Commo and Parker: Calibration Modeling Methodology to Optimize Performance for Low Range "
                "Applications",
            ),
        ),
        conditions=tuple(
            condition
            for stage in stages
            for condition in (
                Condition(
                    "sensor_temperature_degC",
                    "Temperature of the transducers",
                    "°C",
                    "-130.1",
                    "-90.02",
                    "-49.8",
                    stage,
                ),
                Condition(
                    "sse_temperature_degC", "Temperature of the electronics", "°C", "-40.2", "0.03", "40.1", stage
                ),
            )
        ),
        equipment=(
            Equipment("dead weights", "", "", "", "", "", "", None, None),
            Equipment(
                "supply",
                "Druck",
                "PACE5000",
                "10472213",
                "PC-0061",
                "PTB 30112 2026",
                "PTB",
                date(2026, 4, 30),
                date(2027, 4, 30),
            ),
            Equipment(
                "scanner",
                "Keysight",
                "34970A",
                "MY44001234",
                "DVM-0102",
                "NPL-E-2026-0044",
                "NPL",
                date(2026, 1, 31),
                date(2027, 1, 31),
                "UKAS 0478",
            ),
            Equipment(
                "local gravity", "", "", "", "", "BGS G-114", "British Geological Survey", date(2019, 6, 1), None
            ),
        ),
        tables=tuple(
            table
            for stage in stages
            for name in sensors
            for table in (_outputs(name, stage), _coefficients(name, stage))
        ),
        budgets=tuple(_budget(name, stage) for stage in stages for name in sensors),
        evidence=tuple(
            Evidence(
                "20261109T180000-line-1a2b.sqlite",
                "20261109T180000-line-1a2b",
                "3f7a9c0d51e2b846" * 4,
                1204,
                220,
                date(2026, 11, 9),
                date(2026, 11, 14),
                "0.1.0",
                stage,
            )
            for stage in stages
        ),
        statements=tuple(
            Statement(
                name,
                "error of the inferred pressure at 0.5 psi",
                "±0.010 psi",
                "guard band w = U: conforming if the error and its expanded uncertainty lie within the tolerance",
                "pass",
                "0.998",
                "error of the inferred pressure at 0.5 psi conforms with its tolerance.",
                stage,
            )
            for stage in stages
            for name in sensors
        ),
        effects=(
            Effect(
                sensors[0],
                "thermal-hysteresis",
                "the offset depends on the temperature before",
                "12.1 µV (9.0 to 15.2 µV)",
                True,
                "run 20261116T180000-confirm-77aa",
            ),
        ),
        adjustment="zero and span were set at the customer's wish" if len(stages) > 1 else "",
        notes=("Errors of the meter that reads the sensors in use are not in these uncertainties.",),
        deviations=("Point 41 was skipped: the pressure did not settle.",),
        holdings=tuple(
            Holding("DVM-0102", "NPL-E-2026-0044", label, unit, limits, found, by, stage)
            for stage in stages
            for label, unit, limits, found, by in (
                ("temperature", "°C", "18 to 28", "21.03 to 21.92", "room"),
                ("humidity", "%", "20 to 80", "", ""),
            )
        ),
        external=tuple(
            External(
                name, label, *numbers, "Thermal Testing Ltd", "UKAS 4711", "TT-2026-0042", date(2026, 2, 3), used_for
            )
            for name in sensors
            for label, numbers, used_for in (
                ("time constant", ("0.210", "s", "0.040", "2.00", "0.95"), ""),
                ("insulation resistance at 100 V", ("5.2", "Gohm", "", "", ""), "the choice of items"),
            )
        ),
        supplied=(
            Supplied(sensors[0], "serial number", "441100", ""),
            Supplied(sensors[0], "volume of the cavity", "0.31 cm³", "results"),
            Supplied("", "tolerance of every output", "", "conformity"),
        ),
    )


def _outputs(name: str, stage: Stage) -> ResultTable:
    results = tuple(
        Result(
            f"output_{n}",
            "output",
            (pressure, "-90.0"),
            f"{2.004 * float(pressure):.4f}",
            "0.0021",
            "2.02",
            "0.95",
            "mV",
            2.004 * float(pressure) + 1e-5,
            0.00104,
            2.0192,
            41.0,
        )
        for n, pressure in enumerate(PRESSURES)
    )
    at = (Column("Pressure", "psi"), Column("Temperature", "°C"))
    return ResultTable(name, "output at chosen points", results, at, stage)


def _coefficients(name: str, stage: Stage) -> ResultTable:
    rows = (
        ("1", "mV", "-0.000123", "0.000021"),
        ("P", "mV/psi", "2.00410", "0.00031"),
        ("P^2", "mV/psi^2", "1.2e-05", "3.1e-06"),
    )
    results = tuple(
        Result(
            label, label, (), value, expanded, "1.98", "0.95", unit, float(value), float(expanded) / 1.98, 1.98, 60.0
        )
        for label, unit, value, expanded in rows
    )
    return ResultTable(name, "coefficients", results, (), stage, ("Output in mV, pressure P in psi.",))


def _budget(name: str, stage: Stage) -> Budget:
    lines = (
        Contribution("PC-0061 offset", "certificate PTB 30112 2026", "B", "0.00080", "inf", 0.59),
        Contribution("repeatability of the run", "scatter of the run", "A", "0.00054", "17", 0.27),
        Contribution("DVM-0102 drift", "certificate NPL-E-2026-0044", "B", "0.00034", "inf", 0.107),
        Contribution("DVM-0102 gain", "certificate NPL-E-2026-0044", "B", "0.00018", "inf", 0.034),
        Contribution("line head", "survey of 2024", "B", "0.000012", "inf", -0.001),
    )
    return Budget(
        name, "output_3", "output at 0.790 psi, −90.0 °C", "mV", lines, "0.00104", "41", "2.02", "0.0021", stage, 3
    )


def amended(first: Document) -> Document:
    """The same certificate, amended."""
    changes = ("The serial number of the item was wrong: 441101 instead of 441100.",)
    return replace(
        first,
        number="K-2026-0147-1",
        amends=Amendment(first.number, first.dates.issued, changes, "0" * 64, first.number, first.dates.issued),
    )
