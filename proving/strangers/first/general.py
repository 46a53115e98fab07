"""Any other calibration. Effects: f(lab, rng, k) -> (rows, 1); LABS says which bench each one needs."""
import types
import numpy as np
from .common import NOISES, Made, csv_text, residual, scaled, stream


def bench(r, response, setting, span, levels, reps, curve, sd, time=True, **more):
    """Levels x reps; columns, formula and ideal response of a bench."""
    L = types.SimpleNamespace(response=response, name=setting, reps=reps, options=[])
    x = np.linspace(*span, levels)
    shuffled = r.random() < 0.6
    L.x = np.concatenate([r.permutation(x) if shuffled else (x if j % 2 == 0 else x[::-1]) for j in range(reps)])
    L.n, L.block = len(L.x), np.repeat(np.arange(reps), levels)
    L.t = np.round(np.cumsum(r.uniform(20, 90) * r.uniform(.8, 1.3, L.n)), 1)
    L.room = np.round(r.uniform(20, 24) + r.uniform(.3, 1.5) * np.sin(2 * np.pi * (L.t / r.uniform(4e3, 3e4) + r.random())), 2)
    z = (L.x - span[0]) / (span[1] - span[0])
    L.z = z
    L.y = curve[0] + curve[1] * z + (curve[2] * z * z if len(curve) > 2 else 0)
    L.sd = sd * r.uniform(.7, 1.5)
    L.X = np.stack([z ** i for i in range(len(curve))], 1)
    L.formula = f"1 + {setting}" + (f" + {setting}^2" if len(curve) > 2 else "")
    L.C = {"run": np.arange(L.n) + 1}
    L.time = time
    if time:
        L.C["elapsed_s"] = L.t
        L.options += ["--time", "elapsed_s"]
    L.C[setting] = np.round(L.x, 6)
    L.C["room_temperature_degC"] = L.room
    if r.random() < 0.6:
        L.C["replicate"] = L.block + 1
        L.options += ["--replicate", "replicate"]
    if not shuffled and r.random() < 0.8:
        L.C["direction"] = np.where(L.block % 2 == 0, 1, -1)
        L.options += ["--direction", "direction"]
    return L


def size_of(r):
    return int(r.integers(9, 25)), int(r.integers(3, 9))


def voltmeter(r):
    return bench(r, "reading_V", "calibrator_V", (-10, 10), int(r.integers(21, 42)), int(r.integers(2, 6)), (-10, 20), 2e-5, r.random() < .6)


def pump_loop(r):
    L = bench(r, "frequency_Hz", "flow_L_min", (5, r.uniform(60, 120)), *size_of(r), (60, 1200), .5, r.random() < .6)
    L.water = np.round(r.uniform(15, 60, L.reps)[L.block] + r.normal(0, .2, L.n), 2)
    L.C["water_temperature_degC"] = L.water
    return L


def spectrometer(r):
    return bench(r, "transmittance_1", "wavelength_nm", (400, r.uniform(700, 1000)), int(r.integers(40, 90)),
                 int(r.integers(2, 4)), (.9, .05, -.08), 5e-4, r.random() < .5)


def force_machine(r):
    L = bench(r, "deflection_mV_V", "force_kN", (10, r.choice([100, 200, 500])), int(r.integers(8, 12)),
              int(r.integers(4, 8)), (.2, 1.8, .001), 2e-5, r.random() < .6)
    L.turn = (np.arange(L.reps) * r.choice([60, 90, 120]) % 360)[L.block]
    L.C["position_deg"] = L.turn
    who = r.permutation(["Ames", "Brandt", "Cole"])
    L.C["operator"] = who[np.arange(L.reps) % 3][L.block]
    L.options += ["--group", "operator"]
    return L


def oil_loop(r):
    L = bench(r, "differential_pressure_Pa", "flow_L_min", (2, 20), *size_of(r), (40, 400, 30), .4, r.random() < .6)
    L.oil = np.round(r.uniform(18, 45, L.reps)[L.block] + r.normal(0, .3, L.n), 2)
    L.C["oil_temperature_degC"] = L.oil
    return L


def bath(r):
    L = bench(r, "resistance_ohm", "bath_degC", (0, r.choice([90, 150])), *size_of(r), (100, 50, -.6), 5e-4, r.random() < .6)
    L.depth = r.choice([40, 60, 80, 120, 200], L.n)
    L.C["immersion_mm"] = L.depth
    return L


def diode_bench(r):
    L = bench(r, "photocurrent_uA", "laser_current_mA", (40, 90), *size_of(r), (10, 300), .05, r.random() < .6)
    L.case = np.round(22 + r.uniform(1, 3) * np.sin(2 * np.pi * (L.t / r.uniform(2e3, 8e3) + r.random())) + r.normal(0, .1, L.n), 2)
    L.C["case_temperature_degC"] = L.case
    return L


def cavitation(L, r, k):
    pv = 0.611 * np.exp(17.5 * L.water / (241 + L.water))
    q = L.x / L.x.max()
    excess = np.maximum(0, r.uniform(45, 65) * q ** 2 + pv - r.uniform(35, 45))
    return k * 1e-3 * excess * L.y / 20


def etalon(L, r, k):
    thick, n = r.uniform(700, 1500), 1.5 + 4500 / L.x ** 2            # nm, thin cement layer
    return k * 1e-3 * L.y * np.cos(4 * np.pi * n * thick / L.x + r.uniform(0, 6))


def bit_weight(L, r, k):
    lo, hi = L.y.min(), L.y.max()
    bit = int(r.integers(2, 5))                                        # one heavy bit of the upper ones
    code = np.floor((L.y - lo + .07 * (hi - lo)) / (1.14 * (hi - lo)) * 2 ** bit)
    return k * L.sd * (code % 2)


def mains_alias(L, r, k):
    beat = r.uniform(4, 12) * np.median(np.diff(L.t))
    return k * L.sd * np.sin(2 * np.pi * L.t / beat + r.uniform(0, 6))


def rotation_in_machine(L, r, k):
    ph = r.uniform(0, 6)
    y = np.cos(np.radians(L.turn) + ph) + .3 * np.cos(2 * np.radians(L.turn) + r.uniform(0, 6))
    return k * 1e-5 * y * L.y


def laminar_turbulent(L, r, k):
    nu = np.exp(-.035 * (L.oil - 20))
    Re = 2300 * L.x / (r.uniform(8, 12) * nu)
    part = 1 / (1 + np.exp(-(Re - 2300) / r.uniform(80, 250)))
    return k * 1e-3 * part * L.x ** 1.75 * nu ** .25


def truncated_log(L, r, k):
    q = min(k * L.sd, (L.y.max() - L.y.min()))
    return np.trunc(L.y / q) * q - L.y


def stem_immersion(L, r, k):
    return -k * 1e-2 * .385 * (L.x - L.room) * np.exp(-L.depth / r.uniform(15, 30))


def mode_hop(L, r, k):
    phase = (L.case - 20) / r.uniform(1.2, 2.5) + (L.x - 40) / r.uniform(12, 25)
    saw = phase - np.floor(phase) - .5
    return k * 1e-4 * saw * L.y


LABS = {"cavitation": pump_loop, "etalon": spectrometer, "bit_weight": voltmeter, "mains_alias": voltmeter,
        "rotation_in_machine": force_machine, "laminar_turbulent": oil_loop, "truncated_log": voltmeter,
        "stem_immersion": bath, "mode_hop": diode_bench}
EFFECTS = {f.__name__: f for f in (cavitation, etalon, bit_weight, mains_alias, rotation_in_machine,
                                   laminar_turbulent, truncated_log, stem_immersion, mode_hop)}
PAIRS = [["cavitation", "bit_weight"], ["etalon", "mains_alias"], ["rotation_in_machine", "bit_weight"],
         ["laminar_turbulent", "mains_alias"], ["stem_immersion", "mains_alias"], ["mode_hop", "bit_weight"]]
ABOUT = {
    "cavitation": "Beyond a flow that depends on vapour pressure the turbine meter cavitates and bubbles raise its frequency. Hinge in flow squared plus vapour pressure of the water temperature.",
    "etalon": "A thin cement layer in the window acts as an etalon and modulates transmittance. Periodic in one over wavelength, with dispersion.",
    "bit_weight": "One upper bit of the converter has a wrong weight. Square wave along the response itself, so along the setting.",
    "mains_alias": "Mains hum is sampled in nearly regular intervals and appears as a slow beat. Sine in time, with a period of some rows; nothing else.",
    "rotation_in_machine": "The force is never quite axial, so the deflection depends on the cell's angle in the machine. First and second harmonic of position, proportional to force.",
    "laminar_turbulent": "In the laminar element flow becomes turbulent over a narrow range of Reynolds number and the pressure drop rises. Depends on flow over viscosity, so on oil temperature.",
    "truncated_log": "The logging program truncates towards zero to a coarse step. Sawtooth of the response, opposite for negative values.",
    "stem_immersion": "Heat flows along the stem of a thermometer that is not deep enough. Bath minus room temperature times an exponential of immersion depth.",
    "mode_hop": "The laser diode hops between modes as temperature and current tune the gain; power steps back. Sawtooth in case temperature and current together.",
}


def table(effects, seed, size, noise):
    for attempt in range(80):
        r = stream("general", seed, attempt)
        where = LABS[effects[0]] if effects else r.permutation(sorted(set(LABS.values()), key=lambda f: f.__name__))[0]
        L = where(r)
        parts = [scaled(lambda k, e=e: EFFECTS[e](L, stream(e, seed, attempt), k)[:, None],
                        lambda y: residual(L.X, y), lambda _: L.sd, size) for e in effects]
        if "mains_alias" in effects and not L.time:
            continue                                                   # a beat in time needs the clock
        if 24 <= L.n <= 300 and all(p is not None for p in parts):
            break
    else:
        raise ValueError(f"not visible: {effects} {seed}")
    r = stream("general noise", seed, noise)
    hidden = sum((p[0][:, 0] for p in parts), np.zeros(L.n))
    block = np.arange(L.n) // 4 if noise == "common" else L.block
    C = dict(L.C)
    C[L.response] = L.y + hidden + L.sd * NOISES[noise](r, L.n, L.z, block, None)
    F = {c: None if v.dtype.kind in "US" else "d" if v.dtype.kind == "i" else ".8g" for c, v in C.items()}
    F[L.response] = ".10g"
    if "elapsed_s" in F:
        F["elapsed_s"] = ".1f"
    options = ["--response", L.response, "--formula", L.formula] + L.options
    return Made(csv_text(C, F), C, options, float(np.mean([p[1] for p in parts])) if parts else 0.0, hidden)
