"""Reads the tables' text again and tests it. From the parent folder: python -m FOLDER.check [seeds, 3]"""

import hashlib
import os
import subprocess
import sys

import numpy as np

from . import KINDS, table
from .common import residual, size_of

WORDS = {"operator", "reader", "person", "cable"}
FIXED = {
    "attitude": ["replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC"],
    "whole_plots": [
        "whole_plot", "order", "elapsed_s", "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC",
    ],
}  # fmt: skip


def columns(text):
    head, *body = text.rstrip("\n").split("\n")
    cells = [line.split(",") for line in body]
    out = {}
    for k, name in enumerate(head.split(",")):
        words = [c[k] for c in cells]
        out[name] = np.array(words) if name in WORDS else np.array(words, float)
    return out


def design(kind, options, c):
    """The first response's name, the declared model and its groups, from text and options."""
    n = len(next(iter(c.values())))
    if kind == "attitude":
        up = KINDS[kind].upward(c["pitch_deg"], c["roll_deg"])
        return "x_V", np.column_stack([np.ones(n), up]), c["replicate"]
    if kind == "whole_plots":
        v = [c[k] - c[k].mean() for k in FIXED[kind][3:]]
        terms = [np.ones(n), *v, *(v[a] * v[b] for a, b in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))]
        return next(k for k in c if k.startswith("bridge_")), np.column_stack(terms), np.zeros(n)
    o = {options[k]: options[k + 1] for k in range(0, len(options), 2)}
    terms = [np.ones(n) if w == "1" else c[w] for w in o["--formula"].split(" + ")]
    for k in o.keys() - {"--formula"}:
        assert o[k] in c, k
    return o["--response"], np.column_stack(terms), np.zeros(n)


def one(kind, seed, noise, size, worst, spread):
    mod = KINDS[kind]
    bare = table(kind, (), seed, size, noise)
    c0 = columns(bare.csv)
    y, model, groups = design(kind, bare.options, c0)
    outputs = {o.name for o in bare.lab.outputs}
    assert bare.size == 0 and not bare.hidden.any() and list(c0)[: len(FIXED.get(kind, []))] == FIXED.get(kind, [])
    clock = bare.options[bare.options.index("--time") + 1] if bare.options else "elapsed_s"
    assert (np.diff(c0[clock]) > 0).all()
    spread.append(size_of(residual(c0[y], model, groups)) / bare.error_sd)
    single = {}
    for effects in [*([e] for e in mod.EFFECTS), *mod.PAIRS]:
        got = table(kind, effects, seed, size, noise)
        c = columns(got.csv)
        assert list(c) == list(c0) and got.options == bare.options
        for k in c:
            if k in outputs:
                assert np.isfinite(c[k]).all() and (k != y or (c[k] != c0[k]).any())
            else:
                assert (c[k] == c0[k]).all(), k
        tolerance = 1.01 * got.display if noise == "rounded" else 2e-3 * got.error_sd
        assert np.abs(c[y] - c0[y] - got.hidden).max() <= tolerance, (kind, effects, seed, noise)
        if len(effects) == 2:
            assert np.allclose(got.hidden, single[effects[0]] + single[effects[1]], rtol=1e-9, atol=1e-12)
            continue
        single[effects[0]] = got.hidden
        source = got.hidden if noise == "rounded" else c[y] - c0[y]
        found = size_of(residual(source, model, groups)) / got.error_sd
        worst[kind] = max(worst.get(kind, 0), abs(found / size - 1))
        assert abs(found / size - 1) < 3e-3 and abs(got.size / size - 1) < 1e-9, (kind, effects, seed, noise, found)
    return len(c0[y])


def fingerprint():
    h = hashlib.sha256()
    for kind, mod in KINDS.items():
        for k, noise in enumerate(mod.NOISES):
            for effects in ((), *mod.PAIRS) if k == 0 else ((list(mod.EFFECTS)[k],),):
                got = table(kind, effects, 7, 1.0, noise)
                h.update(got.csv.encode())
                h.update(got.hidden.tobytes())
    return h.hexdigest()


def main(seeds):
    worst = {}
    for kind, mod in KINDS.items():
        texts = list(mod.ABOUT.values())
        assert len(mod.EFFECTS) == 8 and len(mod.PAIRS) == 3 and set(mod.ABOUT) == set(mod.EFFECTS)
        assert sum(v.startswith("Everyday. ") for v in texts) == 5
        assert sum(v.startswith("Unlisted. ") for v in texts) == 3
        assert "white" in mod.NOISES and all(e in mod.EFFECTS for pair in mod.PAIRS for e in pair)
        spread, rows = {}, []
        for seed in range(seeds):
            for k, noise in enumerate(mod.NOISES):
                if seed == 0 or noise == "white" or k == seed % len(mod.NOISES):
                    rows.append(one(kind, seed, noise, 0.7, worst, spread.setdefault(noise, [])))
        rms = ", ".join("%s %.2f" % (k, np.mean(v)) for k, v in spread.items())
        row = (kind, min(rows), max(rows), worst[kind], rms)
        print("%-11s rows %d to %d; size within %.1e; null rms / sd: %s" % row)
    mine = fingerprint()
    code = "import sys; sys.path.insert(0, %r); from %s import check; print(check.fingerprint())"
    package = __package__
    place = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    run = [sys.executable, "-B", "-c", code % (place, package)]
    again = subprocess.run(run, env={**os.environ, "PYTHONHASHSEED": "5"}, capture_output=True, text=True, check=True)
    assert again.stdout.strip() == mine, "two processes give different tables"
    print("two processes give the same tables: " + mine[:16])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
