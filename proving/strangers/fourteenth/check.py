"""Sizes from the text of the tables, no NaN, same arguments same table, bounds of the contract.
python3 check.py [number of seeds, 3]"""
import hashlib
import os
import subprocess
import sys
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(HERE))
import fourteenth  # noqa: E402

SIZE = 0.8
ROWS = {"attitude": (300, 1500), "whole_plots": (80, 300), "general": (40, 400)}
HEAD = {"attitude": "replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC,x_V",
        "whole_plots": "whole_plot,order,elapsed_s,pressure_psia,sensor_temperature_degC,sse_temperature_degC,bridge_"}


def read(csv):
    lines = csv.strip().split("\n")
    names = lines[0].split(",")
    rows = [r.split(",") for r in lines[1:]]
    assert all(len(r) == len(names) for r in rows)
    out = {}
    for j, c in enumerate(names):
        v = [r[j] for r in rows]
        try:
            out[c] = np.array([float(x) for x in v])
            assert np.all(np.isfinite(out[c])), c
        except ValueError:
            assert c in ("operator", "person", "observer", "direction", "range"), c
            out[c] = np.array(v)
        assert "nan" not in [x.lower() for x in v]
    return out


def what(kind, table, c):
    """(name of the first response, declared model, groups) from the text and the options alone."""
    one = np.ones(len(next(iter(c.values()))))
    if kind == "attitude":
        a, r = np.radians(c["pitch_deg"]), np.radians(c["roll_deg"])
        g = [one, np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a)]
        return "x_V", np.column_stack(g), c["replicate"]
    if kind == "whole_plots":
        y = "bridge_mV" if "bridge_mV" in c else "bridge_1_mV"
        q = [(v - v.mean()) / v.std() for v in
             (c["pressure_psia"], c["sensor_temperature_degC"], c["sse_temperature_degC"])]
        m = [one] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)]
        return y, np.column_stack(m), one
    o = dict(zip(table.options[::2], table.options[1::2]))
    terms = [w.strip() for w in o["--formula"].split("+")]
    assert all(v in c for k, v in o.items() if k != "--formula")
    return o["--response"], np.column_stack([one if w == "1" else c[w] for w in terms]), one


def left(m, groups, v):
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        q, s, _ = np.linalg.svd(m[at] / np.sqrt(np.mean(m[at] ** 2, axis=0) + 1e-300), full_matrices=False)
        q = q[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


def rms(v):
    return float(np.sqrt(np.mean(v * v)))


def digest():
    h = hashlib.sha256()
    for kind, m in fourteenth.KINDS.items():
        for seed in (3, 4):
            for e in list(m.EFFECTS) + [()] + list(m.PAIRS):
                e = [e] if isinstance(e, str) else e
                for noise in m.NOISES if not e else ["white"]:
                    t = fourteenth.table(kind, e, seed, 1.0, noise)
                    h.update(t.csv.encode() + repr((t.options, t.size)).encode() + t.hidden.tobytes())
    return h.hexdigest()


def main(seeds):
    worst, lowest, ratio, rounded = 0.0, {}, {}, []
    for kind, m in fourteenth.KINDS.items():
        assert len(m.EFFECTS) == 8 and len(m.PAIRS) == 3 and len(m.NOISES) >= 8 and "white" in m.NOISES
        assert set(m.ABOUT) == set(m.EFFECTS) and all(v.startswith(("Everyday", "Unlisted")) for v in m.ABOUT.values())
        noises = list(m.NOISES)
        count = []
        for seed in range(seeds):
            use = noises if seed < 3 else ["white", noises[seed % len(noises)]]
            for noise in dict.fromkeys(use):
                null = fourteenth.table(kind, [], seed, SIZE, noise)
                n0 = read(null.csv)
                y, model, groups = what(kind, null, n0)
                n = len(n0[y])
                count.append(n)
                assert ROWS[kind][0] <= n <= ROWS[kind][1], (kind, seed, n)
                assert null.csv.startswith(HEAD.get(kind, "")) and null.size == 0 and not null.hidden.any()
                if kind == "attitude":
                    assert len(np.unique(groups)) >= 3
                o = null.options
                t_name = o[o.index("--time") + 1] if o else "elapsed_s"
                assert np.all(np.diff(n0[t_name]) > 0)
                ratio.setdefault((kind, noise), []).append(rms(left(model, groups, n0[y])) / null.error_sd)
                alone = {}
                for e in [(e,) for e in m.EFFECTS] + [tuple(p) for p in m.PAIRS]:
                    t = fourteenth.table(kind, e, seed, SIZE, noise)
                    assert t.csv == fourteenth.table(kind, list(e), seed, SIZE, noise).csv
                    assert t.options == null.options and t.error_sd == null.error_sd
                    c = read(t.csv)
                    assert list(c) == list(n0)
                    resp = [k for k in c if k == y or k in ("y_V", "z_V") or k.startswith("bridge_")]
                    assert all(np.array_equal(c[k], n0[k]) for k in c if k not in resp)
                    diff = c[y] - n0[y]
                    assert t.hidden.shape == (n,) and np.all(np.isfinite(t.hidden))
                    hid = left(model, groups, t.hidden)
                    if len(e) == 1:
                        alone[e[0]] = t.hidden
                        key = (kind, e[0])
                        lowest[key] = min(lowest.get(key, 1.0), t.kept[e[0]])
                        got = rms(hid) / null.error_sd
                        if noise == "rounded":
                            gain = float(left(model, groups, diff) @ hid / (hid @ hid))
                            rounded.append(gain)
                            assert abs(gain - 1) < 0.35, (kind, e, seed, gain)
                            assert np.max(np.abs(diff - t.hidden)) <= t.step * 1.001
                        else:
                            got = rms(left(model, groups, diff)) / null.error_sd
                        worst = max(worst, abs(got / SIZE - 1))
                        assert abs(got / SIZE - 1) < 1e-3, (kind, e, seed, noise, got)
                    else:
                        assert np.allclose(t.hidden, alone[e[0]] + alone[e[1]], rtol=1e-9, atol=1e-12)
                    if noise != "rounded":
                        assert np.max(np.abs(diff - t.hidden)) < 2e-3 * null.error_sd
        print("%-12s %d seeds, rows %d to %d: passed" % (kind, seeds, min(count), max(count)))
    print("greatest departure of a size from %.2f (from the text): %.1e" % (SIZE, worst))
    print("rounded: gain of the text's difference on hidden %.3f to %.3f" % (min(rounded), max(rounded)))
    print("share of an effect's rms (about its mean) which the declared model leaves, least of the seeds:")
    for (kind, e), v in lowest.items():
        print("  %-12s %-24s %.3f" % (kind, e, v))
    print("null: rms left by the declared model / error_sd, mean over the seeds:")
    for (kind, e), v in ratio.items():
        print("  %-12s %-16s %.3f" % (kind, e, np.mean(v)))
    mine = digest()
    code = "import sys; sys.dont_write_bytecode=True; sys.path.insert(0, %r); import check; print(check.digest())" % HERE
    for salt in ("1", "77"):
        other = subprocess.run([sys.executable, "-c", code], env=dict(os.environ, PYTHONHASHSEED=salt),
                               capture_output=True, text=True, check=True).stdout.strip()
        assert other == mine, "another process gives another table"
    print("same tables in three processes: sha256 %s" % mine[:16])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
