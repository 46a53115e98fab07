"""Sizes from the text of the tables, no NaN, the same table for the same arguments. python3 check.py [seeds, 3]"""

import hashlib
import os
import subprocess
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(HERE))
import fifteenth  # noqa: E402
from fifteenth.common import left, rms  # noqa: E402

SIZE = 0.8
ROWS = {"attitude": (300, 1500), "whole_plots": (60, 300), "general": (40, 400)}
TEXT = ("operator", "observer", "who", "range")
HEAD = {
    "attitude": "replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC,x_V",
    "whole_plots": "whole_plot,order,elapsed_s,pressure_psia,sensor_temperature_degC,sse_temperature_degC,bridge_",
    "general": "",
}


def read(csv):
    lines = csv.strip().split("\n")
    names = lines[0].split(",")
    out = {}
    for c, v in zip(names, zip(*[r.split(",") for r in lines[1:]], strict=True), strict=True):
        try:
            out[c] = np.array([float(x) for x in v])
            assert np.all(np.isfinite(out[c])), c
        except ValueError:
            assert c in TEXT, c
            out[c] = np.array(v)
    return out


def what(kind, table, c):
    """Name of the first response, declared model, groups: from the text and the options alone."""
    one = np.ones(len(next(iter(c.values()))))
    if kind == "attitude":
        g = fifteenth.attitude.gravity(c["pitch_deg"], c["roll_deg"])
        return "x_V", np.column_stack([one, g]), c["replicate"]
    if kind == "whole_plots":
        names = ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
        q = [(c[k] - c[k].mean()) / c[k].std() for k in names]
        squares = [q[i] * q[j] for i in range(3) for j in range(i, 3)]
        return "bridge_mV" if "bridge_mV" in c else "bridge_1_mV", np.column_stack([one, *q, *squares]), one
    o = dict(zip(table.options[::2], table.options[1::2], strict=True))
    assert all(v in c for k, v in o.items() if k != "--formula")
    terms = [w.strip() for w in o["--formula"].split("+")]
    return o["--response"], np.column_stack([one if w == "1" else c[w] for w in terms]), one


def digest():
    h = hashlib.sha256()
    for kind, m in fifteenth.KINDS.items():
        for seed in (3, 4):
            for e in [(), *[(e,) for e in m.EFFECTS], *m.PAIRS]:
                for noise in ["white"] if e else m.NOISES:
                    t = fifteenth.table(kind, e, seed, 1.0, noise)
                    h.update(t.csv.encode() + repr((t.options, t.size)).encode() + t.hidden.tobytes())
    return h.hexdigest()


def one(kind, seed, noise, found):
    m = fifteenth.KINDS[kind]
    null = fifteenth.table(kind, [], seed, SIZE, noise)
    n0 = read(null.csv)
    y, model, groups = what(kind, null, n0)
    n, sd = len(n0[y]), null.error_sd
    assert ROWS[kind][0] <= n <= ROWS[kind][1], (kind, seed, n)
    assert null.csv.startswith(HEAD[kind]) and null.size == 0 and not null.hidden.any()
    found["rows", kind] = [*found.get(("rows", kind), []), n]
    if kind == "whole_plots":
        found["rows", "plots"] = [*found.get(("rows", "plots"), []), len(np.unique(n0["whole_plot"]))]
    o = null.options
    assert np.all(np.diff(n0[o[o.index("--time") + 1] if o else "elapsed_s"]) > 0)
    at = ("null", kind, noise)
    found[at] = [*found.get(at, []), rms(left(model, groups, n0[y])) / sd]
    alone = {}
    for e in [*[(e,) for e in m.EFFECTS], *m.PAIRS]:
        t = fifteenth.table(kind, e, seed, SIZE, noise)
        assert t.csv == fifteenth.table(kind, list(e), seed, SIZE, noise).csv
        assert t.options == o and t.error_sd == sd
        c = read(t.csv)
        assert list(c) == list(n0)
        moved = [k for k in c if k == y or k in ("y_V", "z_V") or k.startswith("bridge_") and k.endswith("_mV")]
        assert all(np.array_equal(c[k], n0[k]) for k in c if k not in moved)
        assert t.hidden.shape == (n,) and np.all(np.isfinite(t.hidden))
        rest, diff = left(model, groups, t.hidden), c[y] - n0[y]
        room = t.step * 1.001 if noise == "rounded" else 2e-3 * sd
        assert np.max(np.abs(diff - t.hidden)) <= room, (kind, e, seed, noise)
        if len(e) > 1:
            assert np.allclose(t.hidden, alone[e[0]] + alone[e[1]], rtol=1e-9, atol=1e-12)
            continue
        alone[e[0]] = t.hidden
        kept = ("kept", kind, e[0])
        found[kept] = min(found.get(kept, 1.0), t.kept[e[0]])
        got = rms(rest if noise == "rounded" else left(model, groups, diff)) / sd
        found["worst"] = max(found.get("worst", 0.0), abs(got / SIZE - 1))
        assert abs(got / SIZE - 1) < 2e-3, (kind, e, seed, noise, got)


def main(seeds):
    found = {}
    for kind, m in fifteenth.KINDS.items():
        assert len(m.EFFECTS) == 8 and len(m.PAIRS) == 3 and "white" in m.NOISES
        assert set(m.ABOUT) == set(m.EFFECTS) and all(v.startswith(("Everyday", "Unlisted")) for v in m.ABOUT.values())
        noises = list(m.NOISES)
        for seed in range(seeds):
            for noise in noises if seed < 2 else dict.fromkeys(["white", noises[seed % len(noises)]]):
                one(kind, seed, noise, found)
        print("%-12s %d seeds: passed" % (kind, seeds))
    for k, v in found.items():
        if k[0] == "rows":
            print("%s of %s: %d to %d" % (k[0] if k[1] != "plots" else "number", k[1], min(v), max(v)))
    print("greatest departure of a size from %.2f (from the text): %.1e" % (SIZE, found["worst"]))
    print("share of an effect's rms (about its mean) which the declared model leaves, least of the seeds:")
    for k, v in found.items():
        if k[0] == "kept":
            print("  %-12s %-20s %.4f" % (k[1], k[2], v))
    print("null: rms that the declared model leaves / error_sd, mean over the seeds:")
    for k, v in found.items():
        if k[0] == "null":
            print("  %-12s %-10s %.3f" % (k[1], k[2], np.mean(v)))
    mine = digest()
    code = (
        "import sys; sys.dont_write_bytecode=True; sys.path.insert(0, %r); import check; print(check.digest())" % HERE
    )
    env = dict(os.environ, PYTHONHASHSEED="77")
    other = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True).stdout
    assert other.strip() == mine, "another process gives another table"
    print("same tables in two processes: sha256 %s" % mine[:16])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
