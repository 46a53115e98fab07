"""Accelerometers on a dividing head. Effects: f(lab, rng, k) -> (rows, sensors) in V."""
import types
import numpy as np
from .common import NOISES as N, Made, ar, csv_text, lag, residual, scaled, since, stream, telegraph

D = np.pi / 180


def gravity(a, R):
    return np.stack([np.sin(a), -np.sin(R) * np.cos(a), -np.cos(R) * np.cos(a)], 1)


def laboratory(r):
    """Design, clock, temperature and sensors of one laboratory."""
    while True:
        span = r.choice([180, 90, 60])
        pitch = np.linspace(-span, span, r.choice([13, 17, 19, 25, 31, 37]))
        n_roll = r.choice([1, 3, 5, 9, 13])
        roll = np.linspace(-1, 1, n_roll) * r.choice([180, 90]) if n_roll > 1 else np.zeros(1)
        reps = r.integers(3, 7)
        if 150 <= len(pitch) * n_roll * reps <= 1500:
            break
    P, Q = (v.ravel() for v in np.meshgrid(pitch, roll, indexing="ij"))
    serpentine = r.random() < 0.25
    order = []
    for j in range(reps):
        if serpentine:
            o = np.lexsort((P, Q))
            o = o[::-1] if j % 2 else o
            blocks = [b if i % 2 == 0 else b[::-1] for i, b in enumerate(np.split(o, n_roll))]
            order.append(np.concatenate(blocks))
        else:
            order.append(r.permutation(len(P)))
    L = types.SimpleNamespace(rep=np.repeat(np.arange(reps), len(P)), n=reps * len(P))
    L.point = np.concatenate(order)
    L.a_deg, L.R_deg = P[L.point], Q[L.point]
    L.a, L.R = L.a_deg * D, L.R_deg * D
    L.g = gravity(L.a, L.R)
    move = np.maximum(abs(np.diff(L.a_deg, prepend=0)), abs(np.diff(L.R_deg, prepend=0)))
    step = r.uniform(25, 60) + move / r.uniform(6, 20) + r.uniform(0, 4, L.n)
    pauses = (r.random(reps) < 0.5) * np.exp(r.uniform(np.log(300), np.log(15000), reps))
    first = np.r_[False, np.diff(L.rep) > 0]
    L.t = np.round(np.cumsum(step + first * pauses[L.rep]), 1)
    wander = np.sin(2 * np.pi * (L.t / r.uniform(8e3, 9e4) + r.random())) + 0.2 * ar(r, L.n, 0.97)
    L.T = np.round(r.uniform(20, 25) + r.uniform(0.2, 1.0) * wander, 3)
    L.m = int(r.integers(1, 4)) if n_roll > 1 else 1
    L.S = r.uniform(4.7, 5.3, L.m)
    L.b = r.normal(0, 5e-3, L.m)
    mis = r.normal(0, 1, (L.m, 3)) * r.uniform(0.1, 1, (L.m, 1)) * D
    L.u = np.eye(3)[:L.m] + mis
    L.u /= np.linalg.norm(L.u, axis=1)[:, None]
    L.V = L.b + L.S * (L.g @ L.u.T)
    L.sd = np.exp(r.uniform(np.log(1e-5), np.log(1e-4)))
    L.own = r.random() < 1 / 3
    L.columns = L.g if n_roll > 1 else np.stack([np.sin(L.a), np.cos(L.a)], 1)
    return L


def left(L, y):
    out = np.empty(len(y))
    for j in range(L.rep.max() + 1):
        i = L.rep == j
        out[i] = residual(np.column_stack([np.ones(i.sum()), L.columns[i]]), y[i])
    return out


def turned(L, da=0.0, dR=0.0):
    """Volts by which true angles a + da, R + dR differ from those commanded."""
    return L.S * ((gravity(L.a + da, L.R + dR) - L.g) @ L.u.T)


def payload_tilts_base(L, r, k):
    ph = r.uniform(-1, 1)
    return turned(L, k * 1e-5 * np.cos(L.a + ph) * (1 + 0.3 * np.cos(L.R)))


def worm_turn(L, r, k):
    ph = r.uniform(0, 2 * np.pi)
    return turned(L, k * 1e-5 * (np.sin(40 * L.a + ph) + 0.4 * np.sin(80 * L.a)))


def cable_pull(L, r, k):
    side, free = r.choice([-1, 1]), r.uniform(0.1, 0.5) * abs(L.a).max()
    return turned(L, -k * 1e-5 * side * np.maximum(0, side * L.a - free))


def slip_ring_spot(L, r, k):
    where, wide = r.choice(L.a), r.uniform(6, 15) * D
    d = np.angle(np.exp(1j * (L.a - where)))
    ohm = np.exp(-0.5 * (d / wide) ** 2) * r.lognormal(0, 0.4, L.n)      # worn track: contact varies
    return -k * 1e-5 * ohm[:, None] * (1 + 0.2 * L.V / 5)


def range_switch(L, r, k):
    limit = r.uniform(1.05, 1.2)
    return k * 1e-5 * (abs(L.V) > limit) * np.ones(L.m) * (1 + 0.2 * L.V / 5)


def plume_lag(L, r, k):
    up = r.normal(size=3)
    hot = L.g @ (up / np.linalg.norm(up))
    return k * 1e-4 * lag(hot, L.t, r.uniform(60, 400))[:, None] * r.uniform(0.5, 1.5, L.m)


def steel_pillar(L, r, k):
    """Induced dipole of a pillar; field along each sensor's torquer magnet."""
    pos = np.array([r.uniform(0.35, 0.5), r.uniform(-.1, .1), r.uniform(-.1, .1)])
    mom = np.array([r.uniform(-.4, .4), r.uniform(-.4, .4), 1.0])
    ca, sa, cR, sR = np.cos(L.a), np.sin(L.a), np.cos(L.R), np.sin(L.R)
    z, o = 0 * ca, 1 + 0 * ca
    pit = np.array([[ca, z, sa], [z, o, z], [-sa, z, ca]]).transpose(2, 0, 1)
    rol = np.array([[o, z, z], [z, cR, -sR], [z, sR, cR]]).transpose(2, 0, 1)
    M = pit @ rol                                                  # package to laboratory
    d = M @ np.array([r.uniform(.05, .12), r.uniform(-.05, .05), r.uniform(.03, .08)]) - pos
    q = np.linalg.norm(d, axis=1)[:, None]
    B = (3 * d * (d @ mom)[:, None] / q ** 5 - mom / q ** 3) / 20
    return k * 1e-5 * np.einsum("nij,ni->nj", M, B)[:, :L.m]


def filter_memory(L, r, k):
    keep = k * 1e-6
    return np.stack([keep * (since(v, v[0]) - v) for v in L.V.T], 1)


def seat_play(L, r, k):
    lever = np.sin(L.a + r.uniform(-.4, .4)) + r.uniform(-.2, .2)
    return turned(L, k * 1e-5 * np.tanh(lever / 0.03))


def parking_floor(L, r, k):
    load = telegraph(r, L.t, (L.t[-1] - L.t[0]) / r.uniform(6, 15))
    return turned(L, k * 1e-5 * load)


def lost_steps(L, r, k):
    move = np.diff(L.a_deg, prepend=0)
    limit = np.quantile(abs(move), r.uniform(0.6, 0.8))
    slip = np.zeros(L.n)
    for i in range(1, L.n):
        slip[i] = 0 if L.rep[i] != L.rep[i - 1] else slip[i - 1] - np.sign(move[i]) * (abs(move[i]) > limit - 1e-9)
    return turned(L, k * 1e-5 * slip)


def compressor_rectification(L, r, k):
    cycle, duty = r.uniform(600, 1800), r.uniform(0.3, 0.6)
    on = ((L.t / cycle + r.random()) % 1 < duty).astype(float)
    gain = 1 + r.uniform(-.5, .5) * (L.g @ L.u.T) ** 2
    return k * 1e-5 * on[:, None] * gain


EFFECTS = {f.__name__: f for f in (
    payload_tilts_base, worm_turn, cable_pull, slip_ring_spot, range_switch, plume_lag, steel_pillar,
    filter_memory, seat_play, parking_floor, lost_steps, compressor_rectification)}
PAIRS = [["payload_tilts_base", "compressor_rectification"], ["worm_turn", "parking_floor"],
         ["cable_pull", "filter_memory"], ["slip_ring_spot", "plume_lag"], ["range_switch", "lost_steps"],
         ["steel_pillar", "parking_floor"], ["seat_play", "compressor_rectification"],
         ["plume_lag", "range_switch"]]
ABOUT = {
    "payload_tilts_base": "The payload's centre of mass lies off the pitch axis; its moment tilts the compliant base by an angle going as the cosine of pitch. Depends on pitch (a little on roll); needs a wide pitch span.",
    "worm_turn": "Eccentric 40:1 worm: the true pitch departs periodically with 9 deg of pitch (and its half). Depends on pitch through the angle, seen where the sensor's output is steep.",
    "cable_pull": "The cable's slack is used up beyond some pitch on one side and it then twists the package back, like a spring. Depends on pitch; nothing on the other side.",
    "slip_ring_spot": "A worn spot of the slip ring adds a varying contact resistance, so a voltage drop, in a narrow sector of pitch. Local in pitch, irregular between replications.",
    "range_switch": "The autoranging meter changes range at about 1.1 V, and the higher range has another zero and gain. Depends on the magnitude of the sensor's own output: a step.",
    "plume_lag": "Warm air in the package rises anew after each turn; the temperature field follows attitude with minutes of lag and shifts the offset. Depends on present and earlier attitudes and on the time between readings.",
    "steel_pillar": "A magnetised steel pillar beside the head acts on the torquer magnets; the package moves through its non-uniform field. Depends on pitch and roll in harmonics above the first.",
    "filter_memory": "The meter's digital filter is not reset, so a small part of the reading before remains. Depends on the difference to the previous row's output.",
    "seat_play": "The package rests loose in its seat and tips over to the other stop when the side force of gravity changes sign. Depends on pitch as a step in angle.",
    "parking_floor": "A lorry parks and leaves beside the laboratory, and the floor tilts between two states. Depends on time (irregular on and off), multiplied by the slope of the output with pitch.",
    "lost_steps": "The stepper loses steps in long pitch moves and is homed only at the start of each replication. Depends on the accumulated history of large moves within a replication.",
    "compressor_rectification": "A compressor cycles on and off; its vibration is rectified by the sensor into an offset, a little depending on g squared. Periodic square wave in time.",
}


def common(r, n, s, b, p):
    """Replications alike: the error of a point goes on into the next replication with AR 0.5."""
    e = np.empty(n)
    old = None
    for j in range(b.max() + 1):
        new = r.standard_normal(p.max() + 1)
        old = new if old is None else 0.5 * old + np.sqrt(0.75) * new
        e[b == j] = old[p[b == j]]
    return e


NOISES = dict(N, common=common)


def table(effects, seed, size, noise):
    for attempt in range(60):
        L = laboratory(stream("attitude", seed, attempt))
        parts = [scaled(lambda k, e=e: EFFECTS[e](L, stream(e, seed, attempt), k), lambda y: left(L, y),
                        lambda _: L.sd, size) for e in effects]
        if all(p is not None for p in parts):
            break
    else:
        raise ValueError(f"not visible: {effects} {seed}")
    r = stream("attitude noise", seed, noise)
    hidden = sum((p[0] for p in parts), np.zeros((L.n, L.m)))
    s = abs(L.a_deg) / abs(L.a_deg).max()
    V = L.V + hidden
    reps = L.rep.max() + 1
    for j in range(L.m):
        V[:, j] += L.sd * NOISES[noise](r, L.n, s, L.rep, L.point)
        if L.own:
            V[:, j] += L.sd * r.standard_normal(reps)[L.rep]
            V[:, j] += L.sd * r.standard_normal(reps)[L.rep] * (L.V[:, j] - L.b[j]) / L.S[j]
    C = {"replicate": L.rep + 1, "order": np.arange(L.n) + 1, "elapsed_s": L.t, "pitch_deg": L.a_deg,
         "roll_deg": L.R_deg, "sensor_temperature_degC": L.T}
    F = dict(zip(C, ["d", "d", ".1f", ".6g", ".6g", ".3f"]))
    for j in range(L.m):
        C["xyz"[j] + "_V"], F["xyz"[j] + "_V"] = V[:, j], ".7f"
    return Made(csv_text(C, F), C, [], float(np.mean([p[1] for p in parts])) if parts else 0.0, hidden[:, 0])
