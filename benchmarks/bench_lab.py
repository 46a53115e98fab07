"""The index of a large laboratory: made from files, beside reading them alone; what is due; a recall.

.venv/bin/python -m benchmarks.bench_lab 10000 20
"""

from __future__ import annotations

import json
import os
import random
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

from rig.archive import Lab, affected, due

_STANDARDS = 50
"""Pieces of equipment that all calibrations share."""


def _certificate(item: int, year: int, rng: random.Random) -> dict[str, Any]:
    day = date(2000 + year, 1 + item % 12, 1).isoformat()
    thing = {"name": "cell", "maker": "EXAMPLE", "model": "10 kN", "serial": f"S-{item}", "asset": ""}
    standard = {"name": "meter", "maker": "", "model": "", "serial": "", "asset": f"DVM-{item % _STANDARDS}"}
    volt = 5.0 + 1e-3 * year + rng.gauss(0.0, 1e-4)
    result = {"label": "output at 10 kN", "estimate": volt, "standard": 1e-4, "unit": "V"}
    statement = {"sensor": "cell", "what": "output at 10 kN", "stage": "", "permitted": [4.95, 5.05]}
    return {
        "number": f"C-{item}-{year}",
        "simulated": False,
        "customer": {"name": f"customer {item % 200}"},
        "dates": {"began": day, "ended": day, "issued": day},
        "items": [thing],
        "equipment": [{**standard, "certificate": f"E-{item % _STANDARDS}"}],
        "tables": [{"sensor": "cell", "stage": "", "results": [result]}],
        "statements": [statement],
        "evidence": [],
        "filler": "x" * 4000,  # texts that a certificate has besides
    }


def _took(what: Callable[[], object]) -> float:
    began = time.perf_counter()
    what()
    return time.perf_counter() - began


def main() -> None:
    items, years = (int(text) for text in (sys.argv[1:] or ["1000", "20"]))
    rng = random.Random(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for item in range(items):
            own = folder / f"{item % 100:02d}"
            own.mkdir(exist_ok=True)
            for year in range(years):
                (own / f"C-{item}-{year}.json").write_text(json.dumps(_certificate(item, year, rng)))

        for one in (folder, *folder.iterdir()):  # long ago: what changed a moment ago is read again
            os.utime(one, (1e9, 1e9))

        def asked(question: Callable[[Lab], object]) -> Callable[[], object]:
            def ask() -> object:
                with Lab.open(folder) as lab:
                    return question(lab)

            return ask

        reading = _took(lambda: [json.loads(path.read_bytes()) for path in folder.rglob("*.json")])
        making = _took(asked(lambda lab: None))
        print(
            f"{items} items, {items * years} certificates; index made in {making:.0f} s, {making / reading:.1f} times"
        )
        print(f"their reading as JSON ({reading:.0f} s)")
        for words, question in (
            ("nothing new", lambda lab: None),
            ("what is due", due),
            ("recall of one standard", lambda lab: affected(lab, "DVM-7", date(2005, 3, 1))),
        ):
            print(f"{words}: {sorted(_took(asked(question)) for _ in range(3))[1]:.2f} s")


if __name__ == "__main__":
    main()
