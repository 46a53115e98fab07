"""python check.py [seeds]: every effect and pair: deterministic, of the size asked, finite; nulls: nothing hidden, errors of the stated size."""
import importlib
import pathlib
import sys

import numpy as np

if __name__ == "__main__":
    here = pathlib.Path(__file__).resolve().parent
    sys.path.insert(0, str(here.parent))
    sys.dont_write_bytecode = True
    set_ = importlib.import_module(here.name)
    seeds = range(1, 1 + int(sys.argv[1]) if len(sys.argv) > 1 else 9)
    bad = 0

    def say(*words):
        global bad
        bad += 1
        print("BAD", *words)

    def read(csv):
        lines = csv.strip().split("\n")
        rows = [line.split(",") for line in lines[1:]]
        return lines[0].split(","), rows

    def design(kind, names, rows, options):
        """Anew, from the text alone."""
        def col(name):
            return np.array([float(r[names.index(name)]) for r in rows])

        def levels(v):
            return (v[:, None] == np.unique(v)[None, :]).astype(float)
        if kind == "attitude":
            p, r, d = np.radians(col("pitch_deg")), np.radians(col("roll_deg")), levels(col("replicate"))
            return np.hstack([d, d * np.sin(p)[:, None], d * (np.cos(p) * np.sin(r))[:, None], d * (np.cos(p) * np.cos(r))[:, None]])
        if kind == "whole_plots":
            a, b = col("pressure_psia"), col("sensor_temperature_degC")
            a, b = a / a.max(), (b - b.mean()) / np.abs(b).max()
            return np.column_stack([np.ones(len(a)), a, b, a * a, b * b, a * b])
        x = col(options[options.index("--formula") + 1].split(" + ")[1])
        d = levels(col(options[options.index("--replicate") + 1])) if "--replicate" in options else np.ones((len(x), 1))
        return np.hstack([d, x[:, None] / x.max()])

    limits = {"attitude": (300, 1500), "whole_plots": (80, 300), "general": (40, 400)}
    for kind, module in set_.KINDS.items():
        worst = {}
        assert set(module.ABOUT) == set(module.EFFECTS) and "white" in module.NOISES and len(module.NOISES) == 9
        sizes = []
        for seed in seeds:
            for noise in module.NOISES:
                null = set_.table(kind, [], seed, 1.0, noise)
                names, rows = read(null.csv)
                sizes.append(len(rows))
                if null.csv != set_.table(kind, (), seed, 2.0, noise).csv or null.hidden.any() or null.size != 0 or len(null.hidden) != len(rows):
                    say(kind, seed, noise, "null")
                if not limits[kind][0] <= len(rows) <= limits[kind][1]:
                    say(kind, seed, "rows", len(rows))
                X = design(kind, names, rows, null.options)
                first = {"attitude": "x_V", "general": (null.options + ["", ""])[1]}.get(kind) or [n for n in names if n.startswith("bridge")][0]
                y = np.array([float(r[names.index(first)]) for r in rows])
                e = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
                q = np.sqrt(e @ e / (len(y) - X.shape[1])) / null.sigma
                worst.setdefault("noise " + noise, []).append(q)
            for effects in [(e,) for e in module.EFFECTS] + list(module.PAIRS):
                for size in (0.5, 2.0):
                    one, two = set_.table(kind, effects, seed, size), set_.table(kind, list(effects), seed, size)
                    if one.csv != two.csv or not np.array_equal(one.hidden, two.hidden) or one.options != two.options:
                        say(kind, seed, effects, "not the same twice")
                    if not np.isfinite(one.hidden).all() or "nan" in one.csv or "inf" in one.csv:
                        say(kind, seed, effects, "not finite")
                    names, rows = read(one.csv)
                    X = design(kind, names, rows, one.options)
                    if len(one.hidden) != len(rows) or not np.allclose(one.hidden, sum(one.parts.values())):
                        say(kind, seed, effects, "hidden")
                    for name, h in one.parts.items():
                        left = h - X @ np.linalg.lstsq(X, h, rcond=None)[0]
                        got = np.sqrt(np.mean(left ** 2)) / one.sigma
                        if abs(got / size - 1) > 1e-3:
                            say(kind, seed, effects, name, "size", got, "not", size)
                        worst.setdefault(name, []).append(np.sqrt(np.mean(h ** 2)) / one.sigma / got)
                    if abs(one.size / size - 1) > 1e-6:
                        say(kind, seed, effects, "size", one.size)
                    # what is hidden is what the table has: against the same laboratory with no effect, or with half of it
                    half = set_.table(kind, effects, seed, 0.5 * size)
                    n2, r2 = read(half.csv)
                    first = {"attitude": "x_V", "general": (one.options + ["", ""])[1]}.get(kind) or [n for n in names if n.startswith("bridge")][0]
                    k = names.index(first)
                    d = np.array([float(a[k]) - float(b[k]) for a, b in zip(rows, r2)])
                    if np.abs(d - 0.5 * one.hidden).max() > 0.1 * one.sigma:
                        say(kind, seed, effects, "the table does not have what is hidden")
                if len(effects) == 2:
                    a, b = one.parts.values()
                    Q = np.linalg.qr(X)[0]
                    a, b = a - Q @ (Q.T @ a), b - Q @ (Q.T @ b)
                    worst.setdefault("pair " + " ".join(effects), []).append(abs(a @ b) / np.sqrt(a @ a * (b @ b)))
        print(kind, "rows", min(sizes), "to", max(sizes), "effects", len(module.EFFECTS), "pairs", len(module.PAIRS), "noises", len(module.NOISES))
        for name, v in worst.items():
            what = "error/stated" if name.startswith("noise") else "correlation" if name.startswith("pair") else "whole/left over"
            print(f"    {name:50s} {what:16s} {min(v):8.3f} {np.median(v):8.3f} {max(v):8.3f}")
    print("bad:", bad)
    sys.exit(bad > 0)
