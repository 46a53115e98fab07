"""Nights of a laboratory of the general kind, from the files of its example: fewer levels, and a straight world.

Nothing here knows which laboratory it is: whoever adds an example of this kind has its nights.
"""

from __future__ import annotations

import random
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.files.toml_text import toml_text

HOLD_S, GAP_S = 1800, 900
_NOISY = 25.0
"""Scatter of readings, in those of the noisiest sensor over one second, from which on they are noisy."""
_NOISY_STANDARD = 5.0
"""The same of a reference standard, of which no repeat shows that a reading is off."""
_SOAK_S = 1500.0
"""About the time of a soak."""
_POINT_S = 25.0
"""About the time of a short night's point, without that of a person."""


@dataclass(frozen=True)
class AnyLaboratory:
    """An example laboratory of the general kind.

    Attributes:
        example: its procedure file.
        truth: its world file, without what the declared model lacks.
        bench: the bench file of its nights.
    """

    example: Mapping[str, Any]
    truth: Mapping[str, Any]
    bench: Mapping[str, Any]

    @classmethod
    def of(cls, folder: Path, bench: Mapping[str, Any]) -> AnyLaboratory:
        """The laboratory in a folder of an example, on a bench."""
        procedure, world = (
            tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8")) for name in ("procedure", "world")
        )
        for sensor in world["sensors"].values():
            sensor.pop("hidden", None)
        return cls(procedure, world, bench)

    @property
    def _person(self) -> bool:
        """Whether a person sets a factor."""
        setters = self.bench.get("factors", {}).values()
        return any(self.bench["instruments"][name]["driver"] == "person" for name in setters)

    def _levels(self, name: str) -> list[float]:
        return sorted(self.example["factors"][name]["levels"])

    def _count(self, name: str, *, brief: bool) -> int:
        """Number of levels of a factor in a short night; so that there are about twelve points in it."""
        factors = self.example["factors"]
        if factors[name].get("hard"):
            return 2 if brief else 3
        return (3 if brief else 4) if len(factors) == 1 else 2

    def answers(self, rng: random.Random) -> tuple[float | None, ...]:
        """What somebody may say unasked: nothing, a value near one level, or nonsense; empty without a person."""
        if not self._person:
            return ()
        name = next(f for f, i in self.bench["factors"].items() if self.bench["instruments"][i]["driver"] == "person")
        levels = self._levels(name)
        near = rng.choice(levels) + 0.005 * (levels[-1] - levels[0])
        return None, None, levels[0] - 3.0, near, 1e9, float("nan")

    def lasts_s(self, *, brief: bool, full: bool) -> float:
        """About how long a night without trouble takes."""
        points, plots = 1.0, 1.0
        for name, factor in self.example["factors"].items():
            levels = len(factor["levels"]) if full else self._count(name, brief=brief)
            points *= levels * (2 if factor.get("order") == "up-down" else 1)
            plots *= levels if factor.get("hard") else 1
        again = self.example.get("replications", 1) if full else 1 if brief else 2
        hard = any(f.get("hard") and name.endswith("_degC") for name, f in self.example["factors"].items())
        by_hand = self.truth.get("person", {}).get("sets_s", 60.0) if self._person else 0.0
        return float(again * (points * (_POINT_S + by_hand) + (plots * _SOAK_S if hard else 0.0)))

    def world(self, seed: int, rng: random.Random) -> str:
        """The world file: the example's own, without what its declared model lacks."""
        person = {"person": {"sets_s": rng.choice((5, 30, 90, 700))}} if self._person else {}
        return toml_text({**self.truth, "seed": seed, **person})

    def procedure(self, rng: random.Random, *, brief: bool) -> str:
        """A short procedure: the example's factors at fewer levels, and a straight line in each."""
        factors = {}
        for name, given in self.example["factors"].items():
            levels, count = self._levels(name), self._count(name, brief=brief)
            chosen = sorted({levels[0], levels[-1], *rng.sample(levels[1:-1], min(count - 2, len(levels) - 2))})
            order = {} if given.get("hard") else {"order": rng.choice(("up-down", "random"))}
            factors[name] = {**given, "levels": chosen, **order}
        noise = max((sensor.get("noise", 1e-5) * self._volts(name) for name, sensor in self.truth["sensors"].items()))
        hard = any(factor.get("hard") for factor in factors.values())
        soak = {"soak": self.example["soak"]} if hard and "soak" in self.example else {}
        return toml_text(
            {
                "kind": "general",
                "name": "night",
                "seed": rng.randrange(1000),
                "replications": 1 if brief else 2,
                "factors": factors,
                **soak,
                "settle": {"dwell_s": 3},
                "measure": {"readings": rng.choice((4, 5)), "max_sd_V": _NOISY * noise, **self._of_standards()},
                "faults": {"noisy": ["retry 10", "skip"]},
                "model": {"formula": " + ".join(["1", *factors])},
                "recovery": {
                    "max_gap_s": GAP_S,
                    "hold_max_s": HOLD_S,
                    **({"continue_gap_s": 600, "whole_plot_repeats": 10} if hard else {}),
                },
            }
        )

    def _of_standards(self) -> dict[str, dict[str, float]]:
        """Limits of the scatter of reference standards: those of the example, or as those of the sensors."""
        noise = {name: one["noise"] for name, one in self.truth.get("references", {}).items() if one.get("noise")}
        own = self.example.get("measure", {}).get("max_sd", {})
        found = {name: own.get(name, _NOISY_STANDARD * sd) for name, sd in noise.items()}
        found |= {name: most for name, most in own.items() if name in self.truth["sensors"]}
        return {"max_sd": found} if found else {}

    def _volts(self, sensor: str) -> float:
        return {"mV": 1e-3, "uV": 1e-6}.get(self.bench["sensors"][sensor].get("unit", "V"), 1.0)
