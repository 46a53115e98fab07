"""python3 -m fourth.check (from the folder above): deterministic, size as asked, finite, nulls hide nothing."""
import csv
import io
import sys

import numpy as np

from . import KINDS, common, table

LIMITS = {"attitude": (300, 1500), "whole_plots": (80, 300), "general": (40, 400)}


def numbers(t):
    rows = list(csv.reader(io.StringIO(t.csv)))
    head, body = rows[0], rows[1:]
    out = {}
    for k, name in enumerate(head):
        try:
            out[name] = np.array([float(row[k]) for row in body])
        except ValueError:
            out[name] = [row[k] for row in body]
    return head, out, len(body)


def independent_size(kind, t):
    """From the text of the table and .hidden only."""
    head, v, n = numbers(t)
    if kind == "attitude":
        a, R = np.radians(v["pitch_deg"]), np.radians(v["roll_deg"])
        X = np.c_[np.ones(n), np.sin(a), np.sin(R) * np.cos(a), np.cos(R) * np.cos(a)]
        parts = [v["replicate"] == k for k in np.unique(v["replicate"])]
    elif kind == "whole_plots":
        p, s, e = (v[k] for k in ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"))
        p, s, e = ((z - z.mean()) / z.std() for z in (p, s, e))
        X = np.c_[np.ones(n), p, s, e, p * p, s * s, e * e, p * s, p * e, s * e]
        parts = [np.ones(n, bool)]
    else:
        terms = t.options[t.options.index("--formula") + 1].split(" + ")
        X = np.column_stack([np.ones(n)] + [(v[k] - v[k].mean()) / v[k].std() for k in terms[1:]])
        parts = [np.ones(n, bool)]
    left = np.empty(n)
    for part in parts:
        left[part] = t.hidden[part] - X[part] @ np.linalg.lstsq(X[part], t.hidden[part], rcond=None)[0]
    return float(np.sqrt(np.mean(left ** 2)) / t.sigma)


def examine(kind, effects, seed, size, noise):
    t, u = (table(kind, effects, seed, size, noise) for _ in range(2))
    what = (kind, effects, seed, size, noise)
    assert t.csv == u.csv and t.options == u.options and t.size == u.size and np.array_equal(t.hidden, u.hidden), what
    head, v, n = numbers(t)
    low, high = LIMITS[kind]
    assert low <= n <= high and t.hidden.shape == (n,), (what, n)
    assert len(set(head)) == len(head), what
    assert np.all(np.isfinite(t.hidden)), what
    for x in v.values():
        assert isinstance(x, list) or np.all(np.isfinite(x)), what
    if not effects:
        assert t.size == 0 and not t.hidden.any(), what
    for e, got in t.sizes.items():
        tolerance = 0.03 if e == "rounding_hand" else 1e-6
        assert abs(got / size - 1) < tolerance, (what, e, got)
    if effects:       # the same laboratory and errors with nothing hidden: the difference is .hidden
        bare = table(kind, effects, seed, 0.0, noise)
        miss = np.abs(first_response(kind, t) - first_response(kind, bare) - t.hidden).max()
        assert miss < 0.05 * t.sigma and not bare.hidden.any(), (what, miss / t.sigma)
    if len(effects) == 1:
        assert abs(independent_size(kind, t) / t.size - 1) < 0.01, (what, independent_size(kind, t), t.size)
    if kind == "general":
        o = t.options
        for word in ("--response", "--replicate", "--time", "--direction"):
            assert word not in o or o[o.index(word) + 1] in head, what
    else:
        assert t.options == []
    return t, n


def first_response(kind, t):
    head, v, n = numbers(t)
    if kind == "attitude":
        return v["x_V"]
    if kind == "whole_plots":
        return v[next(k for k in head if k.startswith("bridge"))]
    return v[t.options[t.options.index("--response") + 1]]


def model_of_null(kind, t):
    """Residual of the declared model on a null: its sd against sigma (other causes would make it larger)."""
    y = first_response(kind, t)
    w = common.Table(t.csv, t.options, 0, y, {}, t.sigma)
    return independent_size(kind, w)


def main(seeds=4):
    done = 0
    causes, pairs = 0, 0
    for kind, m in KINDS.items():
        assert set(m.EFFECTS) == set(m.ABOUT) and len(m.NOISES) == 9 and "white" in m.NOISES
        causes, pairs = causes + len(m.EFFECTS), pairs + len(m.PAIRS)
        noises = sorted(m.NOISES)
        ratio = []
        for seed in range(27):
            t, _ = examine(kind, (), seed, 1.0, noises[seed % 9])
            ratio.append(model_of_null(kind, t))
            done += 1
        print("%-12s nulls: residual sd over sigma, from %.2f to %.2f, mean square %.3f" % (kind, min(ratio), max(ratio), np.mean(np.square(ratio))))
        for k, e in enumerate(m.EFFECTS):
            tries, rows, ratio = [], [], []
            for seed in range(seeds):
                t, n = examine(kind, (e,), 100 + seed, (0.3, 0.6, 1.0, 2.0)[seed % 4], noises[(k + seed) % 9])
                tries.append(t.facts["attempt"])
                rows.append(n)
                ratio.append(np.std(t.hidden) / t.sigma / t.size)
                done += 1
            print("  %-24s rows %s, tries %s, sd of hidden over size %s" % (e, rows, tries, np.round(ratio, 1)))
        for k, p in enumerate(m.PAIRS):
            for seed in range(2):
                t, _ = examine(kind, p, 200 + seed, (0.5, 1.5)[seed], noises[(k + seed) % 9])
                assert len(t.sizes) == 2
                done += 1
    assert causes == 30 and pairs == 20
    print("checked %d tables: %d causes, %d pairs" % (done, causes, pairs))


if __name__ == "__main__":
    main(*[int(w) for w in sys.argv[1:]])
