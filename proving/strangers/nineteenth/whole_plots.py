"""Pressure transducers with strain-gauge bridges over pressure at several temperatures of sensor and electronics (the
signal-conditioning equipment, SSE), a whole plot at each pair of temperatures.
"""

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, World, chance, lagged, play, previous, texts

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
EFFECTS = Causes()
enter = EFFECTS.enter


def laboratory(seed: int, names: tuple[str, ...] = ()) -> Lab:
    """Two chambers, one transducer with one to three bridges, a pressure controller."""
    g = chance("whole_plots", seed, "laboratory")
    plots, per = int(g.integers(9, 19)), int(g.integers(10, 16))
    n = plots * per
    plot = np.arange(n) // per
    start = np.arange(n) % per == 0
    top = float(g.choice([15, 30, 50, 100, 250, 500]))
    grid = np.linspace(top * g.uniform(0.03, 0.08), top, per)
    if g.random() < 0.25:
        grid = np.geomspace(grid[0], top, per)
    style = str(g.choice(["random", "up and down", "up"], p=[0.5, 0.35, 0.15]))
    if style == "random":
        p = np.concatenate([g.permutation(grid) for _ in range(plots)])
    else:
        climb = np.concatenate([grid[::2], grid[1::2][::-1]]) if style == "up and down" else grid
        p = np.tile(climb, plots)
    digits = 4 if top < 40 else 3
    p = np.round(p * (1 + g.normal(0, 0.001, n)), digits)
    gaps = g.uniform(90, 240) * g.uniform(0.75, 1.35, n)
    usual = float(np.median(gaps))
    gaps[start] += g.uniform(2400, 6000, plots)
    t = np.round(np.cumsum(gaps))
    cold, hot = float(g.choice([-55, -40, -20])), float(g.choice([70, 95, 125]))
    sensor = np.linspace(cold, hot, int(g.choice([4, 5, 6])))
    side = np.linspace(max(cold, -40.0), min(hot, 71.0), int(g.choice([3, 4])))
    cells = g.permutation(np.stack(np.meshgrid(sensor, side), -1).reshape(-1, 2))
    cells = cells[np.arange(plots) % len(cells)]
    s, e = (np.round(v[plot] + g.normal(0, 0.3, plots)[plot] + g.normal(0, 0.02, n), 2) for v in cells.T)
    z = [(v - v.mean()) / v.std() for v in (p, s, e)]
    model = np.column_stack([np.ones(n), *z, *(z[a] * z[b] for a in range(3) for b in range(a, 3))])
    full = float(g.choice([20, 30, 60, 100]))
    sd = full * float(g.choice([1e-4, 3e-4, 6e-4]))
    u, warm, board = p / top, (s - (cold + hot) / 2) / ((hot - cold) / 2), e / 60.0
    outputs, extra = [], []
    bridges = int(g.choice([1, 2, 3], p=[0.4, 0.3, 0.3]))
    part = float(g.uniform(0.2, 0.4))  # of a row's error, common to a whole plot
    for j in range(bridges):
        own = sd * (g.uniform(0.8, 1.3) if j else 1.0)
        zero, gain = g.normal(0, 0.02) + g.normal(0, 0.01) * warm, 1 + g.normal(0, 0.012) * warm
        y = zero + gain * u + g.normal(0, 0.002) * u**2 + g.normal(0, 0.003) * warm**2 + g.normal(0, 0.004) * board
        name = "bridge_mV" if bridges == 1 else f"bridge_{j + 1}_mV"
        outputs.append(Output(name, full * (y + g.normal(0, 0.002) * u * board), own))
        extra.append(part * own * g.standard_normal(plots)[plot])
    columns = {
        "whole_plot": [str(k + 1) for k in plot],
        "order": [str(k + 1) for k in range(n)],
        "elapsed_s": texts(t, 0),
        "pressure_psia": texts(p, digits),
        "sensor_temperature_degC": texts(s, 2),
        "sse_temperature_degC": texts(e, 2),
    }
    world = World(t=t, u=u, s=s, e=e, warm=warm, board=board, cold=cold, hot=hot, plot=plot, plots=plots, start=start,
                  begin=t[start][plot] - 60.0, nominal=cells[:, 0], usual=usual)  # fmt: skip
    return Lab(columns, outputs, model, np.zeros(n), world, np.array(extra))


@enter(both=False)
def diaphragm_stretches(w: World, g: Random, j: int) -> Array:
    """Common. At deflections of a good part of its thickness, a diaphragm carries load as a membrane, too, and stiffens:
    the output falls behind with the cube of pressure. Flat metal and silicon diaphragms (Timoshenko and
    Woinowsky-Krieger, Theory of Plates and Shells, art. 96). Depends on pressure alone; matters near full scale.
    """
    return -(w.u**3)


@enter(both=False)
def loading_loop(w: World, g: Random, j: int) -> Array:
    """Common. Diaphragm material and clamped edges keep a little strain on the way back: the output at a pressure
    depends on whether it was reached from below or from above. All elastic pressure elements, a line in any data sheet
    (EURAMET cg-17). Depends on the order of pressures, as a play of some tenths of the range; matters at midscale.
    """
    return play(w.u, g.uniform(0.08, 0.3), 0.0) - w.u


@enter()
def bond_creeps(w: World, g: Random, j: int) -> Array:
    """Common. The strain gauge's adhesive relaxes under shear for minutes after a step in pressure, so that the output
    follows pressure in part with a lag. Bonded foil gauges (Window, Strain Gauge Technology; end loops are chosen
    against it). Depends on the history of pressure with a memory of 3 to 15 min; matters after large steps.
    """
    return lagged(w.u, w.t, 60 * g.uniform(3, 15), 0.0) - w.u


@enter(bench=True)
def soaked_too_shortly(w: World, g: Random, j: int) -> Array:
    """Common. The chamber's thermometer is at the new temperature while the heavy transducer is still on its way; zero
    follows the true temperature. Any climatic chamber (DKD-R 5-7 asks for proof of equilibrium). Depends on the step
    of sensor temperature from the whole plot before, and dies with time since the whole plot began; matters in its
    first rows.
    """
    before = previous(w.nominal, 22.0)
    return ((before - w.nominal)[w.plot]) * np.exp(-(w.t - w.begin) / (60 * g.uniform(8, 30)))


@enter()
def zero_ages(w: World, g: Random, j: int) -> Array:
    """Common. Stresses from welding and bonding relax after mounting, and zero drifts as the logarithm of time or a
    slow exponential. Known of new transducers and of all strain-gauge bridges (Window, Strain Gauge Technology).
    Depends on time alone, quick at first; matters over campaigns of days.
    """
    return np.log1p((w.t - w.t[0]) / (3600 * g.uniform(1, 12)))


@enter()
def span_ages(w: World, g: Random, j: int) -> Array:
    """Common. The excitation source drifts in the course of the campaign, and sensitivity with it, while zero of the
    balanced bridge stays. Amplifiers without ratiometric reading; reference drift in ppm per 1000 h is in any data
    sheet. Depends on time and pressure, their product; matters near full scale in long campaigns.
    """
    return w.u * (w.t - w.t[0]) / 86400


@enter()
def zero_bends_with_heat(w: World, g: Random, j: int) -> Array:
    """Common. The zero of a bridge over temperature is a difference of four resistors of another curvature each, and
    the compensating wire adds its own; a parabola is not enough between -55 and 125 degC, an S is left. Foil-gauge
    apparent strain is given as a cubic or quartic (Vishay Tech Note TN-504). Depends on sensor temperature alone;
    matters at its ends.
    """
    return w.warm**3 + g.uniform(-0.5, 0.5) * w.warm**4


@enter()
def span_bends_with_heat(w: World, g: Random, j: int) -> Array:
    """Common. Piezoresistance falls with temperature on a curve (Kanda, IEEE Trans. Electron Devices 1982), and a
    single span resistor compensates only its slope: sensitivity has a bow over sensor temperature. All silicon
    pressure sensors. Depends on pressure times the square of sensor temperature; matters at full scale in heat and
    cold.
    """
    return w.u * w.warm**2


@enter(bench=True)
def reference_bows(w: World, g: Random, j: int) -> Array:
    """Common. The reference of the conditioning electronics is trimmed so that its voltage bows over the board's
    temperature (the box method of bandgap references; Brokaw, IEEE JSSC 1974), and excitation with it. Gain of all
    channels has a bow over SSE temperature. Depends on the output, so pressure, times the square of SSE temperature;
    matters at full scale in a hot or cold box.
    """
    return (w.u + 0.02) * w.board**2


@enter(both=False)
def amplifier_clips(w: World, g: Random, j: int) -> Array:
    """Common. With offset and span at their limits the instrumentation amplifier comes close to its rail, and output
    is compressed softly above a knee. Single-supply conditioners (data sheets: output swing against linearity).
    Depends on the output, so pressure; matters only in the top tenth or fifth.
    """
    knee, soft = g.uniform(0.72, 0.88), g.uniform(0.02, 0.05)
    return -soft * np.logaddexp(0.0, (w.u - knee) / soft)


@enter()
def remembers_heat_or_cold(w: World, g: Random, j: int) -> Array:
    """Common. After a hot soak zero comes back to another value than after a cold one: solder, glass frit and adhesive
    flow at one extreme and hold the strain. Thermal hysteresis of zero is in every data sheet of pressure
    transducers. Depends on whether the whole plot's sensor temperature was reached from above or below; constant
    within a whole plot, matters at middle temperatures.
    """
    scaled = w.nominal / (w.hot - w.cold)
    return (play(scaled, g.uniform(0.1, 0.25), 22.0 / (w.hot - w.cold)) - scaled)[w.plot]


@enter(bench=True)
def barometer_moves(w: World, g: Random, j: int) -> Array:
    """Common. The standard measures gauge pressure and a single barometer reading of the morning makes it absolute;
    weather goes on. All bridges shift together by some hPa over hours and days, on top of the atmosphere's tide of
    12 h (Chapman and Lindzen, Atmospheric Tides). Depends on time, slowly and smoothly; matters for transducers of low
    range.
    """
    weather = np.sin(2 * np.pi * w.t / (86400 * g.uniform(1.2, 3.5)) + g.uniform(0, 2 * np.pi))
    return weather + g.uniform(0.1, 0.3) * np.sin(2 * np.pi * w.t / 43200 + g.uniform(0, 2 * np.pi))


@enter()
def epoxy_softens(w: World, g: Random, j: int) -> Array:
    """Uncommon. An epoxy that bonds or pots the cell passes its glass transition: expansion is three times as large
    above it, and zero has another slope over sensor temperature from there on. Potted and epoxy-bonded cells (Ferry,
    Viscoelastic Properties of Polymers; thermomechanical analysis). Depends on sensor temperature, a kink; matters in
    the hot third.
    """
    knee, soft = w.cold + g.uniform(0.5, 0.75) * (w.hot - w.cold), g.uniform(2, 5)
    return soft * np.logaddexp(0.0, (w.s - knee) / soft)


@enter()
def insulation_leaks(w: World, g: Random, j: int) -> Array:
    """Uncommon. Insulation of gauge backing and mineral cable falls by half every 8 to 14 K; the leakage current
    unbalances the bridge. Known of high-temperature gauges and of p-n isolated silicon above 100 degC. Depends
    exponentially on sensor temperature, not on pressure; matters at the hottest whole plots.
    """
    return np.exp((w.s - w.hot) * np.log(2) / g.uniform(8, 14))


@enter(both=False)
def cold_oil_is_slow(w: World, g: Random, j: int) -> Array:
    """Uncommon. Silicone oil between isolating diaphragm and chip grows viscous in the cold, and the capillary passes
    it slowly: the cell follows a step in pressure late, and only there. Oil-filled process transmitters with remote
    seals (makers give response time over temperature; Andrade's law). Depends on the step from the row before, with a
    lag that grows e-fold for every 15 to 30 K of cooling; matters in cold whole plots.
    """
    tau = w.usual * g.uniform(0.3, 0.7) * np.exp((w.cold - w.s) / g.uniform(15, 30))
    return lagged(w.u, w.t, tau, 0.0) - w.u


@enter()
def prestress_changes_bow(w: World, g: Random, j: int) -> Array:
    """Uncommon. Housing and diaphragm expand differently, so temperature sets a tension in the diaphragm, which sets
    how much of the load it carries as a membrane: the curvature over pressure changes with temperature. Clamped thin
    diaphragms under thermal prestress (Timoshenko; Sheplak and Dugundji, J. Appl. Mech. 1998). Depends on the square
    of pressure times sensor temperature; matters at full scale in heat and cold.
    """
    return w.u**2 * w.warm


@enter(both=False)
def thin_gas_cools_less(w: World, g: Random, j: int) -> Array:
    """Uncommon. The bridge heats itself, and gas in the cavity carries its heat away; at low pressure the path of its
    molecules is no longer short against the gap, it conducts less, and the chip is warmer. A Pirani gauge that nobody
    wanted (Jousten, Handbook of Vacuum Technology). Depends on pressure as 1/(1 + p/p0) with p0 of a few percent of
    the range; matters at the lowest pressures.
    """
    return 1 / (1 + w.u / g.uniform(0.03, 0.12))


@enter(both=False)
def gas_heats_by_compression(w: World, g: Random, j: int) -> Array:
    """Uncommon. A quick rise in pressure heats the gas in line and cavity nearly adiabatically, expansion cools it; the
    chip sees it for a minute or two, and zero follows. Known of leak tests by pressure decay and of pneumatic
    calibrators. Depends on the logarithm of the ratio to the pressure before, and dies with the time between rows;
    matters after large steps in few seconds.
    """
    step = np.log(w.u / previous(w.u, float(w.u[0])))
    gap = np.diff(w.t, prepend=w.t[0] - w.usual)
    return step * np.exp(-gap / (w.usual * g.uniform(0.25, 0.6)))


@enter()
def connector_mated_anew(w: World, g: Random, j: int) -> Array:
    """Uncommon. Between two whole plots somebody opens the chamber and mates the connector again: contact resistance in
    one arm of the bridge is another one, and zero steps. Four-wire bridges with completion in the electronics. Depends
    on time, a single step between two whole plots; matters ever after.
    """
    return np.where(w.plot >= int(g.uniform(0.3, 0.75) * w.plots), 1.0, 0.0)


PAIRS = [("diaphragm_stretches", "zero_ages"), ("loading_loop", "span_bends_with_heat"),
         ("insulation_leaks", "bond_creeps")]  # fmt: skip
ABOUT = EFFECTS.about()
