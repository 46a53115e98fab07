"""What tables cannot say: errata of the paper, and why simulated experiments differ from its own."""

from __future__ import annotations

ERRATA = (
    ("eq. (37)", "Omega_y in the first term is Omega_z"),
    (
        "eq. (67)",
        "every C_2a beside cos a, and the one squared in the denominator, is C_a; as printed the variance at 0 deg is"
        " 0.0345 instead of 0.0688 (N = 33, +-30 deg)",
    ),
    ("eq. (75)", "the minus sign is lost; only its square is used"),
    (
        "eq. (108)",
        "is of least squares that weigh all sensors alike, the figures it stands beside of weighted ones: at 45 deg "
        "with y and z ten times worse 7.1 against 1.4 sd of x",
    ),
    ("eq. (148)", "the last entry of h_z is -cos a sin R"),
    ("eq. (159)", "the second term is an addend of its own, cos^2 a / rho_AA"),
    ("5.3", "a tumble with roll is worse by (65 M/6)^1/2, not (65/6)^1/2: the design has MN points"),
    ("5.3.1", "17 percent is above the centre of +-90 deg; above those of +-30 and +-45 deg it is 21 percent"),
    ("5.3.2", "10 percent of figure 3 is 9 percent by Table 1"),
    (
        "5.3.2",
        "9 percent within +-10 deg against D1, said of both designs of figure 3, compares 1.811 within +-10 deg with "
        "D1's 1.989 within +-30 deg; within +-10 deg D1 has 1.814 and nothing is gained",
    ),
    ("6.4", "A_x of figures 9(a), (b) is 20 deg in the captions and 0 in the text"),
    ("6.4", "a ten times worse y leaves pitch alone up to 85 deg of roll with coning 0.1 deg, not with 1 deg"),
    ("6.5", "figures 11(c), (d) depart from R = 0 and 180 deg, not from +-90 deg"),
    ("figure 12", "with the signs of eqs. (87), (88), (95) azimuths of -90 deg have the locus, not of +90 deg"),
    ("9.2.2", "from 3 deg to 15 deg is from 5 deg to 15 deg"),
    ("Table 2", "rows 22 and 24 have 73 and 145 points, rows 28, 34, 36 have 325, row 42 four replications"),
    ("Table 2", "by their T, sigma_S of rows 28(a), 34, 53 z is 123, 145, 13.5, and sigma_prec of row 34 is 16.4"),
    (
        "Table 2",
        "drift limits of rows 24 and 26 are F(K - L, 3K), of row 22 nearly (1.36): the limit of T_bias for four "
        "replications. Those of row 53 (1.59) could not be explained",
    ),
)  # fmt: skip
"""Where, and what; each found by computing both sides."""

NOT_ALIKE = (
    "- The sensors. Sizes of noise, pads, temperature coefficients and drifts were chosen so that Table 2's sizes "
    "come out; everything else is their consequence.",
    "- Drift. The simulated world drifts with time at a steady rate, the paper's sensors moved between replications "
    "as they pleased. Row 22's offset drift (T_b 5.82 beside a sigma_b hardly above sigma_E) is a change between "
    "replications that the world does not have; it was left out, so T_b is not significant there.",
    "- The tumbles. Deflection of isolation pads is a product of two components of gravity and vanishes at every "
    "cardinal angle: pads alone give a tumble no bias at all. That the paper's tumbles show one (T_bias 30, 85, 19) "
    "means that its sensors had something else as well; a nonlinearity of 5 to 15 ug/g^2 in each and an eccentricity "
    "of 2.9 arc seconds of the roll axis give all of rows 24, 26, 47, 50, 53 at once, which is why they are here. "
    "Both are guesses.",
    "- Row 44(c). With these the z sensor shows less over +-90 deg than the paper's (T_bias about 3 instead of 17).",
    "- Sensor 2. Its sigma_E of 16.6 is its drift: sigma_b / T_b^1/2 is 3.7, all that it scatters within a "
    "replication. So it was given a noise of twice sensor 1's, not ten times, and a steady drift of 28 uV/h and 9 "
    "ppm/h, which gives rows 34 and 42 alike.",
    "- Figure 48's unusual scatter at -90 deg of pitch is not there.",
    "- Order. Replications alternate as A B B A here, which balances time and direction against the points; the paper"
    " does not say what it did.",
)
