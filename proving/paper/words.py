"""What tables cannot say: errata of the paper, and why simulated experiments differ from its own."""

from __future__ import annotations

ERRATA = (
    ("eq. (37)", "sin Omega_y for sin Omega_z"),
    (
        "eq. (67)",
        "C_2a for C_a wherever it multiplies cos a, and where it is squared below the line: at 0 deg the variance is "
        "0.0688, not 0.0345 (N = 33, +-30 deg)",
    ),
    ("eq. (75)", "without its minus sign, unlike eq. (87)"),
    (
        "eq. (108)",
        "is of least squares that weigh all sensors alike, the figures it stands beside of weighted ones: at 45 deg "
        "with y and z ten times worse 7.1 against 1.4 sd of x",
    ),
    ("eq. (148)", "h_z ends in -cos a cos R, which it has already, for -cos a sin R"),
    ("eq. (159)", "cos^2 a / rho_AA stands below the line, for beside the fraction"),
    ("5.3", "a tumble with roll is worse by (65 M/6)^1/2, not (65/6)^1/2: the design has MN points"),
    ("5.3.1", "17 percent is above the centre of +-90 deg; above those of +-30 and +-45 deg it is 21 percent"),
    ("5.3.2", "10 percent of figure 3 is 9 percent by Table 1"),
    (
        "5.3.2",
        "9 percent within +-10 deg against D1, said of both designs of figure 3, compares 1.811 within +-10 deg with "
        "D1's 1.989 within +-30 deg; within +-10 deg D1 has 1.814 and nothing is gained",
    ),
    ("5.3.2", "the single curve beside figure 5 is figure 2(a)'s, not figure 1's"),
    ("6.4", "A_x of figures 9(a), (b) is 20 deg in the captions and 0 in the text"),
    ("6.4", "a ten times worse y leaves pitch alone up to 85 deg of roll with coning 0.1 deg, not with 1 deg"),
    ("6.5", "figures 11(c), (d) depart from R = 0 and 180 deg, not from +-90 deg"),
    ("figure 12", "with the signs of eqs. (87), (88), (95) azimuths of -90 deg have the locus, not of +90 deg"),
    ("6.6", "the curves are in figures 13 to 20; figure 12 is a locus"),
    ("9.1", "the standard error given for figure 36 is figure 26's"),
    ("9.2.2", "the step of pitch that becomes 15 deg was 5 deg, not 3"),
    ("figures 31 to 33", "are captioned +-180 deg and show the data of figure 28(b), +-30 deg"),
    ("9.3.2", "the pattern of the x sensor is in figure 47(a), not 44(c)"),
    (
        "9.3.2",
        "drift is said to be significant for x and z only; by row 47(b) it is for y as well (T_b = T_S = 2.98, limit "
        "2.22). Its sigma_b and sigma_S are the same number too",
    ),
    ("9.3.3", "bias is said to be significant for x and y; by row 50 it is for z as well (4.28, limit 3.32)"),
    ("9.3.3", "0.000433 of figure 47(a) is the tumble's; 47(a) has 0.000409. Figure 50 is of the six-point tumble"),
    ("9.3.4", "the 481-point calibration is that of section 9.3.2"),
    ("Table 2", "the remark of row 36 has figure 28(a), the text and the numbers 28(b)"),
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
    "The sensors. Sizes of noise, pads, temperature coefficients and drifts were chosen so that Table 2's sizes "
    "come out; everything else is their consequence.",
    "Drift. The simulated world drifts with time at a steady rate, the paper's sensors moved between replications "
    "as they pleased. Row 22's offset drift (T_b 5.82 beside a sigma_b hardly above sigma_E) is a change between "
    "replications that the world does not have; it was left out, so T_b is not significant there.",
    "The tumbles. Deflection of isolation pads is a product of two components of gravity and vanishes at every "
    "cardinal angle: pads alone give a tumble no bias at all. That the paper's tumbles show one (T_bias 30, 85, 19) "
    "means that its sensors had something else as well; a nonlinearity of 5 to 15 ug/g^2 in each and an eccentricity "
    "of 2.9 arc seconds of the roll axis give sizes like those of rows 24, 26, 47, 50, 53 at once and are here for "
    "that. Both are guesses.",
    "Rows 44(b) and (c). With these the y and z sensors show less over +-90 deg than the paper's (T_bias of z about 3 "
    "instead of 17), and row 47(b) has no drift.",
    "Seeds. Another seed is other noise on the same sensors, effects and drifts. Sizes and criteria were settled with "
    "seeds 1 to 3 in view, one sensor's noise after a first look at ten.",
    "Sensor 2. Its sigma_E of 16.6 is its drift: sigma_b / T_b^1/2 is 3.7, all that it scatters within a "
    "replication. So it was given a noise of twice sensor 1's, not ten times, and a steady drift of 28 uV/h and 9 "
    "ppm/h, which gives rows 34 and 42 alike.",
    "Figure 48's unusual scatter at -90 deg of pitch is not there.",
    "Order. Replications alternate as A B B A here, which balances time and direction against the points; the paper"
    " does not say what it did.",
)
