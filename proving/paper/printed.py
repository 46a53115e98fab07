"""What NASA/TP-1999-209835 prints in Tables 1 and 2, digits that the scan lost put back."""

from __future__ import annotations

from dataclasses import dataclass

TABLE_1 = (
    ("2(a)", 30.0, 30.0, 1.989),
    ("2(b)", 45.0, 45.0, 1.993),
    ("2(b)", 45.0, 30.0, 1.927),
    ("2(c)", 90.0, 90.0, 2.008),
    ("2(c)", 90.0, 30.0, 2.222),
    ("2(d)", 180.0, 180.0, 1.993),
    ("2(d)", 180.0, 30.0, 2.174),
    ("3 top", 30.0, 30.0, 2.127),
    ("3 top", 30.0, 10.0, 1.811),
    ("3 bottom", 30.0, 30.0, 1.937),
    ("3 bottom", 30.0, 10.0, 1.834),
    ("4", 30.0, 30.0, 1.941),
    ("4", 30.0, 10.0, 1.912),
    ("5", 30.0, 30.0, 1.989),
)
"""Figure, calibrated over plus and minus, used over plus and minus, V^1/2."""


@dataclass(frozen=True)
class Row:
    """A row of Table 2; standard errors in 1e-4 deg.

    Attributes:
        figure: its figure.
        points: K, as the critical values have it.
        replications: n, likewise.
        parameters: L.
        sigma_E: standard error of the regression; the standard deviation of residuals in rows 36 and 54.
        sigma_bias: its part from lack of fit.
        sigma_prec: its part from scatter between replications.
        T_bias: test of lack of fit.
        F_bias: its limit.
        sigma_b: offset between replications.
        sigma_S: sensitivity between replications.
        T_b: test of the offset.
        T_S: test of the sensitivity.
        F_bS: limit of both.
        read: where a digit was put back, what the print has.

    """

    figure: str
    points: int
    replications: int
    parameters: int
    sigma_E: float
    sigma_bias: float
    sigma_prec: float
    T_bias: float
    F_bias: float
    sigma_b: float
    sigma_S: float
    T_b: float
    T_S: float
    F_bS: float
    read: str = ""


TABLE_2 = (
    Row("22", 73, 6, 3, 1.60, 0.431, 1.54, 0.407, 1.33, 1.69, 0.347, 5.82, 0.245, 1.35, "325 points"),
    Row("24", 145, 6, 3, 3.17, 2.62, 1.79, 11.0, 1.23, 0.955, 0.622, 0.124, 0.060, 1.24, "325 points"),
    Row("26", 4, 6, 3, 2.84, 2.20, 1.79, 30.0, 4.35, 0.940, 0.698, 0.052, 0.029, 4.75),
    Row("28(a)", 325, 6, 4, 7.76, 3.54, 6.90, 1.33, 1.15, 41.0, 123.0, 102, 919, 2.22, "365 points; sigma_S 1.23"),
    Row("28(b)", 325, 6, 4, 3.87, 3.54, 1.56, 26.2, 1.15, 24.0, 8.22, 44.0, 5.14, 2.22, "365 points"),
    Row(
        "34", 325, 6, 4, 16.6, 2.45, 16.4, 0.113, 1.15, 281, 145, 5850, 1570, 2.22,
        "365 points; sigma_prec 1.64, sigma_S 1.45",
    ),
    Row("35", 53, 6, 4, 4.27, 3.97, 1.54, 36.2, 1.40, 9.35, 3.96, 5.01, 0.899, 2.24),
    Row("37", 325, 4, 4, 4.89, 4.71, 1.31, 39.4, 1.16, 13.4, 4.70, 7.66, 0.944, 2.61),
    Row("42", 325, 4, 4, 14.2, 4.17, 13.5, 0.289, 1.16, 170, 201, 717, 1000, 2.61, "6 replications"),
    Row("44(a)", 247, 6, 4, 4.34, 4.10, 1.42, 42.1, 1.17, 12.5, 17.5, 9.08, 17.8, 2.22),
    Row("44(b)", 247, 6, 4, 4.44, 4.17, 1.54, 37.3, 1.17, 15.2, 5.79, 12.8, 1.84, 2.22),
    Row("44(c)", 247, 6, 4, 3.55, 3.11, 1.71, 16.8, 1.17, 8.10, 22.0, 6.36, 46.9, 2.22),
    Row("47(a)", 481, 6, 4, 4.09, 3.72, 1.71, 23.9, 1.12, 14.7, 33.2, 15.0, 76.7, 2.22),
    Row("47(b)", 481, 6, 4, 5.23, 5.08, 1.23, 85.9, 1.12, 8.96, 8.96, 2.98, 2.98, 2.22),
    Row("47(c)", 481, 6, 4, 4.79, 4.28, 2.15, 20.0, 1.12, 23.2, 33.0, 27.0, 54.6, 2.22),
    Row("50 x", 6, 6, 4, 4.33, 4.06, 1.70, 85.0, 3.32, 1.29, 3.15, 0.037, 0.223, 3.11),
    Row("50 y", 6, 6, 4, 1.97, 1.50, 1.33, 19.1, 3.32, 1.76, 1.48, 0.435, 0.305, 3.11),
    Row("50 z", 6, 6, 4, 2.79, 1.34, 2.50, 4.28, 3.32, 3.26, 4.60, 1.87, 3.72, 3.11),
    Row("53 x", 73, 6, 4, 4.12, 3.78, 1.65, 27.3, 1.33, 5.61, 12.3, 2.03, 9.73, 1.59),
    Row("53 y", 73, 6, 4, 5.64, 5.51, 1.23, 104, 1.33, 3.74, 3.34, 0.43, 0.34, 1.59),
    Row("53 z", 73, 6, 4, 4.79, 4.23, 2.24, 18.5, 1.33, 8.53, 13.5, 3.52, 8.89, 1.59, "sigma_S 1.35"),
)  # fmt: skip

RESIDUAL_SD = {"36": 3.89, "52 x": 10.4, "52 y": 9.5, "52 z": 8.4, "54 x": 4.10, "54 y": 5.28, "54 z": 4.82}
"""Standard deviation of the full data's residuals under coefficients of a smaller design, 1e-4 deg."""

ROWS = {row.figure: row for row in TABLE_2}
