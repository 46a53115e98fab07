"""Random stands of the two example laboratories, for certificates: attitude sensors on a head, pressure transducers.

The example's bench and world, with some of its sensors; its register with sizes that are drawn; a short run list.
"""

from __future__ import annotations

import random
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from rig.bench.config import parse_toml
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.tables.table_of_run import run_table

_SIZE = re.compile(r"^((?:expanded|half_width|drift|standard) = )([-+.\de]+)$", re.MULTILINE)
RULES = ("simple", "guard-band", "probability", "shared-risk")


def _resized(of: random.Random, register: str) -> str:
    """The register with every uncertainty a tenth to ten times as large, and other certificates' numbers."""
    told = _SIZE.sub(lambda size: f"{size[1]}{float(size[2]) * 10 ** of.uniform(-1, 1):.3g}", register)
    told = re.sub(r'number = "EXAMPLE-', f'number = "C{of.randrange(10**4)}-', told)
    return re.sub(r"^due = .*$", "due = 2040-01-01", told, flags=re.MULTILINE)


class LabStand(ABC):
    """What both laboratories have in common.

    Attributes:
        folder: of the files.
        at: points of the certificate.
        limits: lower and upper limit of the tolerance.
    """

    lab = ""
    prefix = ""

    def __init__(self, seed: int, folder: Path) -> None:
        self._of, self.folder = random.Random(seed), folder
        texts = {path.stem: path.read_text() for path in example(self.lab).glob("*.toml")}
        bench = parse_toml(re.sub(r"^due = .*$", "", texts["bench"], flags=re.MULTILINE), "bench.toml")
        names = list(bench["sensors"])
        self.names = self._kept(names)
        bench["sensors"] = {name: bench["sensors"][name] for name in self.names}
        world = parse_toml(texts["world"], "world.toml")
        world["sensors"] = {name: one for name, one in world["sensors"].items() if name in self.names}
        world["effects"] = {}
        self.at = self._points()
        self.limits, tolerance = self._tolerance()
        settings = parse_toml(texts["certificate"], "certificate.toml")
        settings |= {"at": [dict(one) for one in self.at], "paper": self._of.choice(("a4", "letter"))}
        settings |= {"annex": self._of.choice(("all", "largest")), "decision": {"rule": self._of.choice(RULES)}}
        settings["tolerance"] = [tolerance] if self._of.random() < 0.7 else []
        self._write("procedure", self._procedure())
        self._write("bench", toml_text(bench))
        self._write("world", toml_text({**world, "seed": seed + 1}))
        self._write("equipment", _resized(self._of, texts["equipment"]))
        self._write("certificate", toml_text(settings))

    def _write(self, name: str, text: str) -> None:
        (self.folder / f"{name}.toml").write_text(text)

    def _kept(self, names: Sequence[str]) -> Sequence[str]:
        return sorted(self._of.sample(names, self._of.randint(1, 3)))

    @abstractmethod
    def _points(self) -> Sequence[Mapping[str, float]]: ...

    @abstractmethod
    def _tolerance(self) -> tuple[tuple[float, float], Mapping[str, object]]: ...

    @abstractmethod
    def _procedure(self) -> str: ...

    def again(self, run: Path, printed: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[str, str, float]]:
        """Sensor, label and value of results that are computed a second time; none where that takes a program."""
        yield from ()


class AttitudeStand(LabStand):
    """One to three sensors on the dividing head."""

    lab = "attitude-lab"

    def _kept(self, names: Sequence[str]) -> Sequence[str]:
        return names if self._of.random() < 0.7 else ["x"]

    def _points(self) -> Sequence[Mapping[str, float]]:
        of = self._of
        return [
            {
                "pitch_deg": round(of.uniform(-50, 50), 1),
                "roll_deg": 0.0 if len(self.names) == 1 else of.choice((0.0, 30.0)),
            }
            for _ in range(of.randint(1, 3))
        ]

    def _tolerance(self) -> tuple[tuple[float, float], Mapping[str, object]]:
        return (-0.02, 0.02), {"result": "offset", "unit": "V", "lower": -0.02, "upper": 0.02}

    def _procedure(self) -> str:
        of = self._of
        pitches = sorted({-90, 0, 90, *of.sample(range(-80, 81, 5), 3)})
        return (
            f"kind = 'pitch-roll'\nname = 'random'\nseed = {of.randrange(99)}\nreplications = {of.randint(2, 3)}\n"
            f"[design]\ntype = 'D'\npitch_deg = {pitches}\nroll_deg = [-120, 0, 120]\n[settle]\ndwell_s = 2\n"
            f"[measure]\nreadings = {of.randint(3, 5)}\n[environment]\nsetpoint_degC = 23\ndwell_s = 60\n"
        )

    def again(self, run: Path, printed: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[str, str, float]]:
        """Offset and sensitivity by least squares on the components of gravity."""
        table = run_table(run)
        pitch, roll = (np.radians(table.columns[name]) for name in ("pitch_deg", "roll_deg"))
        columns = np.column_stack(
            [np.ones(len(table)), np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
        )
        for output, sensor in table.outputs.items():
            found = np.linalg.lstsq(columns, table.columns[output], rcond=None)[0]
            yield sensor, "offset", float(found[0])
            yield sensor, "sensitivity per local g", float(np.linalg.norm(found[1:]))


class PressureStand(LabStand):
    """One to three transducers in two chambers."""

    lab = "pressure-lab"

    def _points(self) -> Sequence[Mapping[str, float]]:
        of = self._of
        return [{"pressure_psia": round(of.uniform(0.2, 2.4), 2)} for _ in range(of.randint(1, 3))]

    def _tolerance(self) -> tuple[tuple[float, float], Mapping[str, object]]:
        return (-0.4, 0.4), {"result": "coefficient 1", "unit": "mV", "lower": -0.4, "upper": 0.4}

    def _procedure(self) -> str:
        of = self._of
        plots = [[of.randrange(-20, 31, 5), of.randrange(-20, 31, 5)] for _ in range(4)]
        pressures = sorted({0.12, 2.5, *(round(of.uniform(0.2, 2.4), 2) for _ in range(2))})
        return (
            f"kind = 'whole-plot'\nname = 'random'\nseed = {of.randrange(99)}\n[design]\ntype = 'list'\n"
            f"temperatures_degC = {[[10, 20], [20, 10], [30, 30], *plots]}\npressures_psia = {pressures}\n"
            f"repeated_psia = [{pressures[1]}]\n"
            "[model]\nformula = '1 + P + P^2 + T_sensor + T_SSE + P*T_sensor + P*T_SSE + T_sensor^2'\n"
            f"[soak]\ndwell_s = 120\ndrift_degC_per_h = 5\n[settle]\ndwell_s = 4\n"
            f"[measure]\nreadings = {of.randint(2, 4)}\n"
        )
