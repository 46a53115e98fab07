"""Every effect and pair (2 seeds, sizes 1 and 2) and every noise: finite, deterministic, sized, parses back, time goes up."""
import csv
import importlib
import io
import os
import sys

import numpy as np

sys.dont_write_bytecode = True
here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(here))
pack = importlib.import_module(os.path.basename(here))


def design(kind, made):
    """Declared columns rebuilt from the written table alone, and the groups fitted apart."""
    c = made.columns
    if kind == "attitude":
        a, R = np.deg2rad(c["pitch_deg"]), np.deg2rad(c["roll_deg"])
        return np.c_[np.ones(len(a)), np.sin(a), np.sin(R) * np.cos(a), np.cos(R) * np.cos(a)], c["replicate"]
    if kind == "whole_plots":
        x, y, z = c["pressure_psia"] / 30, c["sensor_temperature_degC"] / 100, c["sse_temperature_degC"] / 50
        return np.c_[np.ones(len(x)), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z], np.zeros(len(x))
    terms = made.options[made.options.index("--formula") + 1].split(" + ")[1:]
    cols = [c[f.split("^")[0]] ** (int(f.split("^")[1]) if "^" in f else 1) for f in terms]
    return np.stack([np.ones(len(cols[0]))] + [q / np.abs(q).max() for q in cols], 1), np.zeros(len(cols[0]))


def measured(kind, made, h):
    X, group = design(kind, made)
    r = np.array(h)
    for g in np.unique(group):
        m = group == g
        r[m] -= X[m] @ np.linalg.lstsq(X[m], r[m], rcond=1e-9)[0]
    return np.sqrt(np.mean(r ** 2))


def check(kind, effects, seed, size, noise="white"):
    made = pack.table(kind, effects, seed, size, noise)
    assert made.csv == pack.table(kind, effects, seed, size, noise).csv, "not deterministic"
    rows = list(csv.DictReader(io.StringIO(made.csv)))
    assert len(rows) == len(made.hidden) and list(rows[0]) == list(made.columns)
    for name, col in made.columns.items():
        if col.dtype.kind in "fi":
            assert np.isfinite(col).all() and np.array_equal(np.array([float(r[name]) for r in rows]), col.astype(float)), name
        else:
            assert [r[name] for r in rows] == col.tolist(), name
        if name.startswith("elapsed"):
            assert (np.diff(col) > 0).all(), "time"
    assert np.isfinite(made.hidden).all()
    if kind == "general":
        assert {"--response", "--formula"} <= set(made.options) and all(v in made.columns for v in made.options[5::2])
    else:
        assert not made.options
    assert len(made.sizes) == len(effects)
    for name, s in zip(effects, made.sizes):
        assert abs(s / size - 1) < 0.05, (name, s)
    if len(effects) == 1:
        assert abs(measured(kind, made, made.hidden) / made.sd / size - 1) < 0.05, (effects, measured(kind, made, made.hidden) / made.sd)
    return len(rows)


if __name__ == "__main__":
    count = 0
    for kind, mod in pack.KINDS.items():
        assert set(mod.EFFECTS) == set(mod.ABOUT) and len(mod.NOISES) == 9
        assert all(set(p) <= set(mod.EFFECTS) for p in mod.PAIRS)
        assert (len(mod.EFFECTS), len(mod.PAIRS)) == ((12, 8) if kind == "attitude" else (9, 6))
        for effects in [(e,) for e in mod.EFFECTS] + [tuple(p) for p in mod.PAIRS]:
            for seed in (1, 2):
                for size in (1.0, 2.0):
                    check(kind, effects, seed, size)
                    count += 1
        for noise in mod.NOISES:
            check(kind, (), 3, 0.0, noise)
            count += 1
    print(count, "tables in order")
