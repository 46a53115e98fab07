"""Run from the folder above: python3.11 -m fifth.check. Sizes are computed again here, from the text of the table."""
import csv
import io
import sys

import numpy as np

from . import KINDS, _KINDS, table
from . import common as c

SIZES, SEEDS = (0.7, 2.0), (1, 2, 3)


def read(text):
    rows = list(csv.reader(io.StringIO(text)))
    return {k: [r[i] for r in rows[1:]] for i, k in enumerate(rows[0])}


def clean(text):
    """No NaN, no infinity, no empty cell, as many cells in every row."""
    rows = list(csv.reader(io.StringIO(text)))
    return all(len(r) == len(rows[0]) and all(w and w.lower() not in ("nan", "inf", "-inf", "none") for w in r) for r in rows)


def num(t, k):
    return np.array([float(v) for v in t[k]])


def model_of(kind, tab, t):
    one = np.ones(len(tab.hidden))
    if kind == "attitude":
        a, R = np.radians(num(t, "pitch_deg")), np.radians(num(t, "roll_deg"))
        return np.column_stack([one, np.sin(a), -np.sin(R) * np.cos(a), -np.cos(R) * np.cos(a)]), num(t, "replicate")
    if kind == "whole_plots":
        p, s, e = (num(t, k) for k in ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"))
        p, s, e = p / 10, (s + 90) / 40, e / 40
        return np.column_stack([one, p, s, e, p * p, s * s, e * e, p * s, p * e, s * e]), one
    name = tab.options[tab.options.index("--formula") + 1].split(" + ")[1]
    return np.column_stack([one, num(t, name)]), one


def left(v, M, blocks):
    out = v.copy()
    for b in np.unique(blocks):
        k = blocks == b
        out[k] -= M[k] @ np.linalg.lstsq(M[k], v[k], rcond=None)[0]
    return out


def main():
    bad, n_tables, worst, lowest = [], 0, 0.0, []
    for kind in KINDS:
        mod = _KINDS[kind]
        assert set(mod.ABOUT) == set(mod.EFFECTS) and len(mod.NOISES) == 9 and "white" in mod.NOISES
        assert all(e in mod.EFFECTS for p in mod.PAIRS for e in p)
        for name in list(mod.EFFECTS) + list(mod.PAIRS):
            effects = (name,) if isinstance(name, str) else name
            for seed in SEEDS:
                for size in SIZES:
                    tab = table(kind, effects, seed, size)
                    text = tab.csv
                    n_tables += 1
                    if not clean(text) or not np.isfinite(tab.hidden).all():
                        bad.append((kind, name, seed, "nan"))
                    if text != table(kind, effects, seed, size).csv:
                        bad.append((kind, name, seed, "not deterministic"))
                    t = read(text)
                    M, blocks = model_of(kind, tab, t)
                    if len(effects) == 1:
                        got = float(np.sqrt(np.mean(left(tab.hidden, M, blocks) ** 2))) / tab.sigma
                        worst = max(worst, abs(got / size - 1))
                        if abs(got / size - 1) > 0.02:
                            bad.append((kind, name, seed, "size again", got))
                        lowest.append((tab.shares[name], kind, name, seed))
                        # the table really carries it: with less the table of size 0, the same noise
                        resp = tab.responses[0]
                        zero = read(table(kind, effects, seed, 0.0).csv)
                        diff = num(t, resp) - num(zero, resp)
                        if np.abs(diff - tab.hidden).max() > 0.03 * tab.sigma:
                            bad.append((kind, name, seed, "not in the table"))
                    for e, s in tab.sizes.items():
                        if abs(s / size - 1) > 0.02:
                            bad.append((kind, name, seed, "size", e, s))
                    if abs(tab.size / size - 1) > 0.02:
                        bad.append((kind, name, seed, "size", tab.size))
        print(f"{kind}: {len(mod.EFFECTS)} effects, {len(mod.PAIRS)} pairs, {len(mod.NOISES)} noises")
        lo, hi = (300, 1500) if kind == "attitude" else (80, 300) if kind == "whole_plots" else (40, 400)
        for noise in mod.NOISES:
            ratios, texts = [], set()
            for seed in range(1, 13):
                tab = table(kind, (), seed, 1.0, noise)
                text = tab.csv
                n_tables += 1
                t = read(text)
                if not clean(text) or tab.size != 0 or np.any(tab.hidden):
                    bad.append((kind, "null", noise, seed))
                if not lo <= len(tab.hidden) <= hi:
                    bad.append((kind, "rows", noise, seed, len(tab.hidden)))
                texts.add(text)
                M, blocks = model_of(kind, tab, t)
                y = num(t, tab.responses[0])
                dof = len(y) - M.shape[1] * len(np.unique(blocks))
                ratios.append(np.sum(left(y, M, blocks) ** 2) / dof / tab.sigma ** 2)
            print(f"  null, {noise}: error sd / declared, rms of 12 laboratories {np.sqrt(np.mean(ratios)):.3f}")
            if len(texts) != 12:
                bad.append((kind, noise, "laboratories alike"))
        for name in mod.EFFECTS:
            for noise in mod.NOISES:
                tab = table(kind, (name,), 4, 1.0, noise)
                n_tables += 1
                if not clean(tab.csv) or abs(tab.size - 1) > 0.02:
                    bad.append((kind, name, noise, tab.size))
    print("tables", n_tables, "; worst size error", f"{worst:.1e}")
    print("least shares of an effect that the declared model leaves:")
    for s in sorted(lowest)[:8:2]:
        print("  ", f"{s[0]:.3f}", *s[1:])
    print("bad:", len(bad))
    for b in bad[:30]:
        print("  ", b)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
