"""NIST's linear least-squares problems with their certified values, digit for digit as published."""

from __future__ import annotations

import json
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

FILE = Path(__file__).parents[1] / "reference" / "nist" / "linear.json"


@dataclass(frozen=True)
class Problem:
    """Data and certified values as exact fractions of their decimals; `text` keeps the digits of certified values."""

    name: str
    model: str
    names: tuple[str, ...]
    rows: tuple[tuple[Fraction, ...], ...]
    coefficients: tuple[str, ...]
    stderr: tuple[str, ...]
    sigma: str

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The data as doubles, by name; y is the response."""
        return dict(zip(self.names, np.array(self.rows, float).T, strict=True))

    def terms(self) -> list[tuple[Fraction, ...]]:
        """Columns of the model, exactly, read from its formula by nobody's code but this."""
        made = []
        for term in self.model.split(" + "):
            name, _, power = term.partition("^")
            if name == "1":
                made.append(tuple(Fraction(1) for _ in self.rows))
            elif name != "0":
                made.append(tuple(row[self.names.index(name)] ** int(power or 1) for row in self.rows))
        return made

    def write_csv(self, path: Path) -> Path:
        """The data as a table, every digit as published."""
        raw = json.loads(FILE.read_text(), parse_float=str, parse_int=str)["sets"][self.name]["rows"]
        path.write_text("\n".join([",".join(self.names), *(",".join(row) for row in raw)]) + "\n")
        return path


def _problem(name: str, entry: dict) -> Problem:
    rows = tuple(tuple(Fraction(cell) for cell in row) for row in entry["rows"])
    certified = (tuple(entry["coefficients"]), tuple(entry["stderr"]), entry["sigma"])
    return Problem(name, entry["model"], tuple(entry["columns"]), rows, *certified)


PROBLEMS = {
    name: _problem(name, entry)
    for name, entry in json.loads(FILE.read_text(), parse_float=str, parse_int=str)["sets"].items()
}


def digits(found: float, certified: str) -> float:
    """NIST's log relative error: how many digits are right, of 15; of a certified zero, of the absolute error."""
    value = float(certified)
    error = abs(found - value) / (abs(value) or 1.0)
    return 15.0 if error == 0 else min(15.0, float(-np.log10(error)))
