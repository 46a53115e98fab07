"""Pressure transducers in two temperature chambers. Effects: f(lab, rng, k) -> (rows, transducers) in mV."""
import types
import numpy as np
from .common import NOISES, Made, ar, csv_text, residual, rms, scaled, stream


def laboratory(r):
    L = types.SimpleNamespace()
    w, m = int(r.integers(16, 31)), int(r.integers(8, 15))
    L.full = float(r.choice([5, 30]))
    grid = np.linspace(0, L.full, m)
    levels = np.linspace(-120, 40, r.integers(4, 7)), np.linspace(-20, 50, r.integers(3, 5))
    A, B = (v.ravel() for v in np.meshgrid(*levels))
    pick = np.concatenate([r.permutation(len(A)) for _ in range(3)])[:w]
    r.shuffle(pick)
    L.n, L.w, L.wp = w * m, w, np.repeat(np.arange(w), m)
    L.setT, L.setE = A[pick], B[pick]
    L.T = np.round(L.setT[L.wp] + r.normal(0, .02, L.n), 3)
    L.E = np.round(L.setE[L.wp] + r.normal(0, .02, L.n), 3)
    updown = r.random() < 0.35
    half = np.r_[np.arange(0, m, 2), np.arange(1, m, 2)[::-1]]
    L.p = np.concatenate([grid[half] if updown else r.permutation(grid) for _ in range(w)])
    first = np.r_[True, np.diff(L.wp) > 0]
    night = (r.random(w) < 0.2) * r.uniform(3e4, 5e4, w)
    L.t = np.round(np.cumsum(r.uniform(150, 330, L.n) + first * (7200 + night[L.wp])), 1)
    L.start = L.t[first][L.wp]
    L.before = np.where(first, 0.0, np.r_[0.0, L.p[:-1]])         # vented between whole plots
    L.m = int(r.integers(1, 3))
    L.S = r.uniform(1.8, 2.2, L.m)
    x = np.stack([np.ones(L.n), L.p / L.full, L.T / 80, L.E / 40], 1)
    L.X = np.stack([x[:, i] * x[:, j] for i in range(4) for j in range(i, 4)], 1)
    c = r.normal(0, 1, (10, L.m)) * np.array([.5, 0, .2, .2, .004, .02, .02, .03, .01, .03])[:, None]
    L.V = L.X @ c + L.S * L.p[:, None]
    L.sd_w, L.sd = r.uniform(.005, .02), r.uniform(.002, .006)
    return L


def two(L, y, like=0.2, r=None):
    """The same cause in one or two transducers, the second somewhat different."""
    return y[:, None] * (np.ones(L.m) if r is None else np.r_[1, 1 + like * r.normal()][:L.m])


def ice_plug(L, r, k):
    cold = 1 / (1 + np.exp((L.T - r.uniform(-60, -10)) / 3))
    return k * 1e-3 * cold[:, None] * (L.before - L.p)[:, None] * L.S


def transpiration(L, r, k):
    p0 = r.uniform(.02, .08)
    y = (1 - np.sqrt((L.T + 273.15) / 296)) / (1 + L.p / p0)
    return k * 1e-2 * y[:, None] * L.S


def compressor_cycle(L, r, k):
    cycle = r.uniform(900, 2000)
    duty = 0.2 + 0.6 * (40 - L.T) / 160
    return two(L, k * 1e-3 * ((L.t / cycle + r.random()) % 1 < duty), r=r)


def condensation_leakage(L, r, k):
    was = np.r_[20.0, L.setE[:-1]]
    wet = np.maximum(0, L.setE - was)[L.wp] / 30 * (L.E > 5)
    dry = np.exp(-(L.t - L.start) / r.uniform(900, 2500))
    return -two(L, k * 1e-3 * wet * dry * (1 + L.p / L.full), r=r)


def adhesive_glass_transition(L, r, k):
    step = np.tanh((L.T - r.uniform(-90, -20)) / r.uniform(4, 12))
    return k * 1e-4 * step[:, None] * L.p[:, None] * L.S


def regulator_dropout(L, r, k):
    short = np.maximum(0, r.uniform(-8, 8) - L.E) / 20
    return -k * 1e-4 * short[:, None] * L.p[:, None] * L.S


def reference_outgassing(L, r, k):
    rate = np.exp(-r.uniform(5000, 7000) * (1 / (L.T + 273.15) - 1 / 313.0))
    gas = np.cumsum(rate * np.diff(L.t, prepend=0)) / 1e5
    return -k * 1e-2 * gas[:, None] * (L.T + 273.15)[:, None] / 293 * L.S


def stale_barometer(L, r, k):
    clock = L.t + r.uniform(0, 86400)
    fine = np.arange(0, clock[-1] + 600, 600.0)
    air = np.cumsum(ar(r, len(fine), 0.995)) / 50
    now, morning = (np.interp(c, fine, air) for c in (clock, np.floor(clock / 86400) * 86400))
    return k * 1e-3 * (now - morning)[:, None] * L.S


def controller_handover(L, r, k):
    cut = r.uniform(.25, .7) * L.full
    y = (L.p > cut) * (1 + r.uniform(-.5, .5) * (L.p - cut) / L.full)
    return k * 1e-3 * y[:, None] * L.S


EFFECTS = {f.__name__: f for f in (
    ice_plug, transpiration, compressor_cycle, condensation_leakage, adhesive_glass_transition,
    regulator_dropout, reference_outgassing, stale_barometer, controller_handover)}
PAIRS = [["ice_plug", "regulator_dropout"], ["transpiration", "stale_barometer"],
         ["compressor_cycle", "adhesive_glass_transition"], ["condensation_leakage", "controller_handover"],
         ["reference_outgassing", "controller_handover"], ["ice_plug", "compressor_cycle"]]
ABOUT = {
    "ice_plug": "Moisture freezes in the pressure line below some sensor temperature and throttles it, so part of the pressure before is still there. Depends on the previous pressure (vented at the start) and only in cold whole plots.",
    "transpiration": "Between warm manifold and cold cell rarefied gas sets a pressure difference (thermal transpiration) which vanishes as pressure rises. Depends on sensor temperature, only at the lowest pressures.",
    "compressor_cycle": "The chamber's compressor couples into the bridge while it runs; its duty grows towards cold. Periodic on/off in time, with the share depending on sensor temperature.",
    "condensation_leakage": "When the electronics go from cold to warm, dew shunts the bridge, then dries up. Depends on the previous whole plot's electronics temperature and on time since the whole plot began.",
    "adhesive_glass_transition": "The gauge adhesive passes its glass transition and the sensitivity changes within some degrees. Depends on pressure times a step in sensor temperature.",
    "regulator_dropout": "Below some electronics temperature the excitation regulator falls out of regulation. Pressure times a hinge in electronics temperature.",
    "reference_outgassing": "The sealed reference vacuum fills by outgassing, much faster when hot, so zero falls for good. Depends on the accumulated history of sensor temperature and time.",
    "stale_barometer": "The controller adds the barometer's value of the last midnight; the weather goes on. An irregular wandering in time that returns to zero each day.",
    "controller_handover": "The controller's second module takes over above some pressure with another zero and span. A step (with a change of slope) in pressure.",
}


def table(effects, seed, size, noise):
    for attempt in range(60):
        L = laboratory(stream("whole_plots", seed, attempt))

        def sd_of(y):
            mean = np.array([y[L.wp == j].mean() for j in range(L.w)])[L.wp]
            return L.sd if rms(y - mean) ** 2 >= 0.5 * rms(y) ** 2 else np.hypot(L.sd, L.sd_w)
        parts = [scaled(lambda k, e=e: EFFECTS[e](L, stream(e, seed, attempt), k), lambda y: residual(L.X, y),
                        sd_of, size) for e in effects]
        if all(p is not None for p in parts):
            break
    else:
        raise ValueError(f"not visible: {effects} {seed}")
    r = stream("whole_plots noise", seed, noise)
    hidden = sum((p[0] for p in parts), np.zeros((L.n, L.m)))
    V = L.V + hidden
    for j in range(L.m):
        plots = ar(r, L.w, 0.5) if noise == "common" else r.standard_normal(L.w)
        sub = NOISES["white" if noise == "common" else noise](r, L.n, L.p / L.full, L.wp, None)
        V[:, j] += L.sd_w * plots[L.wp] + L.sd * sub
    C = {"whole_plot": L.wp + 1, "order": np.arange(L.n) + 1, "elapsed_s": L.t, "pressure_psia": L.p,
         "sensor_temperature_degC": L.T, "sse_temperature_degC": L.E}
    F = dict(zip(C, ["d", "d", ".1f", ".6g", ".3f", ".3f"]))
    for j in range(L.m):
        name = "bridge_mV" if L.m == 1 else f"bridge_{j + 1}_mV"
        C[name], F[name] = V[:, j], ".5f"
    return Made(csv_text(C, F), C, [], float(np.mean([p[1] for p in parts])) if parts else 0.0, hidden[:, 0])
