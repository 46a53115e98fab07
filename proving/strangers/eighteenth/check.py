"""Reads tables' text again and tests it. From the parent folder: python -m FOLDER.check [laboratories, 3]"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from . import KINDS, table
from .common import Array, residual, rms

SETTINGS = {
    "attitude": ["pitch_deg", "roll_deg", "sensor_temperature_degC"],
    "whole_plots": ["pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"],
}
HEADS = {
    "attitude": ["replicate", "order", "elapsed_s", *SETTINGS["attitude"]],
    "whole_plots": ["whole_plot", "order", "elapsed_s", *SETTINGS["whole_plots"]],
    "general": [],
}


def read(text: str) -> dict[str, Array]:
    """Columns by name; those with words stay words."""
    rows = [line.split(",") for line in text.splitlines()]
    columns = dict(zip(rows[0], map(np.array, zip(*rows[1:], strict=True)), strict=True))
    return {k: v if v[0][0].isalpha() else v.astype(float) for k, v in columns.items()}


def design(kind: str, options: list[str], c: dict[str, Array]) -> tuple[str, Array, Array]:
    """The first response, the declared model and its groups, from nothing but text and options."""
    n = len(next(iter(c.values())))
    one, same = np.ones(n), np.zeros(n)
    if kind == "general":
        said = dict(zip(options[::2], options[1::2], strict=True))
        assert all(v in c for k, v in said.items() if k != "--formula")
        terms = said["--formula"].split(" + ")
        return said["--response"], np.column_stack([one if k == "1" else c[k] for k in terms]), same
    a, b, d = (c[k] for k in SETTINGS[kind])
    response = list(c)[len(HEADS[kind])]
    if kind == "attitude":
        p, r = np.radians(a), np.radians(b)
        return response, np.column_stack([one, np.sin(p), np.cos(p) * np.sin(r), np.cos(p) * np.cos(r)]), c["replicate"]
    a, b, d = (v - v.mean() for v in (a, b, d))
    return response, np.column_stack([one, a, b, d, a * a, a * b, a * d, b * b, b * d, d * d]), same


def test(kind: str, seed: int, noise: str, size: float) -> tuple[int, float, float]:
    """All causes and pairs of one laboratory: rows, largest error of a size, rms of the null's residual over its sd."""
    module = KINDS[kind]
    null = table(kind, (), seed, size, noise)
    c0 = read(null.csv)
    y, model, groups = design(kind, null.options, c0)
    sd, outputs = null.lab.outputs[0].sd, {o.name for o in null.lab.outputs}
    clock = null.options[null.options.index("--time") + 1] if null.options else "elapsed_s"
    assert null.size == 0 == np.abs(null.hidden).max()
    assert list(c0)[: len(HEADS[kind])] == HEADS[kind]
    assert (np.diff(c0[clock]) > 0).all()
    alone: dict[str, Array] = {}
    worst = 0.0
    for effects in [*((e,) for e in module.EFFECTS), *module.PAIRS]:
        got = table(kind, effects, seed, size, noise)
        c = read(got.csv)
        assert (list(c), got.options) == (list(c0), null.options)
        assert all((c[k] == c0[k]).all() for k in c if k not in outputs)
        assert all(np.isfinite(c[k]).all() for k in outputs)
        change = c[y] - c0[y]
        assert np.abs(change - got.hidden).max() < (1.01 * got.display or 2e-3 * sd), (effects, seed, noise)
        if len(effects) == 2:
            assert np.allclose(got.hidden, alone[effects[0]] + alone[effects[1]], atol=1e-9 * sd)
            continue
        alone[effects[0]] = got.hidden
        found = rms(residual(got.hidden if got.display else change, model, groups)) / sd
        worst = max(worst, abs(found / size - 1))
        assert max(worst, 1e6 * abs(got.size / size - 1)) < 1e-3, (effects, seed, noise, found)
    return len(model), worst, rms(residual(c0[y], model, groups)) / sd


def fingerprint() -> str:
    """Of some tables of each kind and noise."""
    h = hashlib.sha256()
    for kind, module in KINDS.items():
        for noise, name in zip(module.NOISES, module.EFFECTS, strict=False):
            for effects in ((), (name,), *module.PAIRS):
                got = table(kind, effects, 11, 0.8, noise)
                h.update(got.csv.encode() + got.hidden.tobytes())
    return h.hexdigest()[:16]


def main(laboratories: int) -> None:
    """All kinds, and a second process."""
    for kind, module in KINDS.items():
        assert all(e in module.EFFECTS for pair in module.PAIRS for e in pair)
        assert sorted(v.split(".")[0] for v in module.ABOUT.values()) == ["Everyday"] * 5 + ["Unlisted"] * 3
        found = [
            (noise, *test(kind, seed, noise, 0.7))
            for seed in range(laboratories)
            for k, noise in enumerate(module.NOISES)
            if seed == 0 or k in (0, seed % len(module.NOISES))
        ]
        means = ", ".join(f"{k} {np.mean([f[3] for f in found if f[0] == k]):.2f}" for k in module.NOISES)
        rows = [f[1] for f in found]
        print(
            f"{kind}: {min(rows)} to {max(rows)} rows; sizes within {max(f[2] for f in found):.1e}; null's rms: {means}"
        )
    folder = Path(__file__).resolve().parent
    code = f"from {folder.name} import check; print(check.fingerprint())"
    run = [sys.executable, "-B", "-c", code]
    env = {**os.environ, "PYTHONHASHSEED": "5", "PYTHONPATH": str(folder.parent)}
    other = subprocess.run(run, env=env, capture_output=True, text=True, check=True).stdout.strip()
    assert other == fingerprint(), "two processes give different tables"
    print(f"two processes give the same tables: {other}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
