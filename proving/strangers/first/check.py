"""Makes every effect and pair (two seeds, sizes 1 and 2) and every noise, and asserts what must hold."""
import csv
import importlib
import io
import os
import sys
import numpy as np

here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(here))
first = importlib.import_module(os.path.basename(here))
bad = []


def check(kind, effects, seed, size, noise="white"):
    m, again = (first.table(kind, effects, seed, size, noise) for _ in range(2))
    assert m.csv == again.csv and np.array_equal(m.hidden, again.hidden), "not deterministic"
    rows = list(csv.DictReader(io.StringIO(m.csv)))
    assert len(rows) == len(m.hidden) and list(rows[0]) == list(m.columns), "csv"
    for c, v in m.columns.items():
        if v.dtype.kind in "if":
            back = np.array([float(q[c]) for q in rows])
            assert np.isfinite(back).all() and np.allclose(back, v, rtol=1e-5, atol=1e-4), c
    if "elapsed_s" in m.columns:
        assert (np.diff(m.columns["elapsed_s"]) > 0).all(), "time"
    assert np.isfinite(m.hidden).all() and (not effects or abs(m.size / size - 1) < .05), "size"
    low, high = {"attitude": (150, 1500), "whole_plots": (128, 420), "general": (24, 300)}[kind]
    assert low <= len(rows) <= high, f"{len(rows)} rows"


for kind, module in first.KINDS.items():
    assert set(module.ABOUT) == set(module.EFFECTS)
    jobs = [([e], s, z, "white") for e in module.EFFECTS for s in (1, 2) for z in (1, 2)]
    jobs += [(p, s, z, "white") for p in module.PAIRS for s in (1, 2) for z in (1, 2)]
    jobs += [([], 3, 1, n) for n in module.NOISES]
    for job in jobs:
        try:
            check(kind, *job)
        except Exception as e:
            bad.append((kind, job, repr(e)))
for b in bad:
    print(*b)
assert not bad
print("all hold")
