"""Files in the form of loggers, scopes, meters and balances are read right: names, units, rows, times and values.

All are written by hand after the public form of each; the numbers are our own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from command import rig

from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.procedures.general.clock_texts import seconds_of
from rig.tables import FileForm, FileSource, read_any_csv


@dataclass(frozen=True)
class Form:
    """A file, and what it says.

    Attributes:
        text: of the file.
        columns: values by name, None for a missing one; text as text.
        units: by name, those of a row or of the cells.
        header: row of the names.
        rows: rows of the file, of the first value and of the last; () if not looked at.
        said: parts of the sentence.
    """

    text: str | bytes
    columns: dict[str, list[object]]
    header: int = 1
    rows: tuple[int, ...] = ()
    units: dict[str, str] = field(default_factory=dict)
    said: tuple[str, ...] = ()


def lines(*each: str) -> str:
    return "\r\n".join(each) + "\r\n"


FORMS = {
    "campbell toa5": Form(
        lines(
            '"TOA5","83014","CR1000","83014","CR1000.Std.32.02","CPU:Program.CR1","12345","Table1"',
            '"TIMESTAMP","RECORD","AirTC","RH"', '"TS","RN","Deg C","%"', '"","","Smp","Avg"',
            '"2026-06-22 09:00:00",1,24.5,55.2', '"2026-06-22 09:15:00",2,"NAN",53.8',
        ),
        {"RECORD": [1, 2], "AirTC": [24.5, None], "RH": [55.2, 53.8],
         "TIMESTAMP": ["2026-06-22 09:00:00", "2026-06-22 09:15:00"]},
        2, (5, 6), {"AirTC": "Deg C", "RH": "%"}, ("names in row 2", "units (row 3)", "row 4 left out"),
    ),
    "campbell toa5, started again": Form(
        lines(
            *(2 * (
                '"TOA5","CR6","CR6","1234","CR6.Std.10","CPU:a.CR6","77","T1"',
                '"TIMESTAMP","RECORD","P","T"', '"TS","RN","kPa","Deg C"', '"","","Avg","Smp"',
                '"2026-06-22 09:00:00",1,100.5,20.25', '"2026-06-22 09:15:00",2,101.5,20.5',
            )),
        ),
        {"P": [100.5, 101.5, 100.5, 101.5], "T": [20.25, 20.5, 20.25, 20.5]}, 2, (5, 12), {"P": "kPa", "T": "Deg C"},
        ("row 7 (the names again), row 8 (the names again), row 9 (the names again), row 10 (the names again)",),
    ),
    "campbell, its rows without the first": Form(
        lines("TIMESTAMP,RECORD,A_Avg,B_Max", "TS,RN,,", ",,Avg,Max", "2026-06-22 09:00:00,1,2.5,3.5",
              "2026-06-22 09:01:00,2,2.75,3.75"),
        {"RECORD": [1, 2], "A_Avg": [2.5, 2.75], "B_Max": [3.5, 3.75]}, 1, (4, 5), {},
        ("row 2 left out", "row 3 left out"),
    ),
    "hobo": Form(
        lines(
            '"Plot Title: C1"',
            '"#","Date Time, GMT-04:00","Temp, °F (LGR S/N: 20123456)","RH, % (LGR S/N: 20123456)",'
            '"Stopped (LGR S/N: 1)"',
            "1,06/13/23 12:00:00 PM,70.21,45.1,", "2,06/13/23 12:10:00 PM,70.41,45.2,",
            "3,06/13/23 12:12:00 PM,,,Logged",
        ),
        {"#": [1, 2, 3], "Temp, °F (LGR S/N: 20123456)": [70.21, 70.41, None],
         "RH, % (LGR S/N: 20123456)": [45.1, 45.2, None], "Stopped (LGR S/N: 1)": ["", "", "Logged"]},
        2, (3, 5), {}, ("month first, years of two digits (2023)",),
    ),
    "lascar easylog": Form(
        lines(
            "EL-USB-2,Time,Celsius(°C),Humidity(%rh),Dew Point(°C),Serial Number",
            "1,13/02/2020 10:00:00,20.5,45.0,8.1,010012345", "2,13/02/2020 10:05:00,20.0,45.5,8.0",
            "3,13/02/2020 10:10:00,20.5,46.0,8.4", "4,13/02/2020 10:15:00,21.0,46.5,8.9",
        ),
        {"Celsius(°C)": [20.5, 20.0, 20.5, 21.0], "Humidity(%rh)": [45.0, 45.5, 46.0, 46.5],
         "Serial Number": [10012345, None, None, None]},
        1, (2, 5), {}, ("day first",),
    ),
    "keysight benchvue": Form(
        lines(
            "Address,USB0::0x2A8D::0x5101::X::INSTR,,,", "Model,DAQ970A,,,",
            "Instrument Channel,Measurement,Units,Range,Resolution", "101,Temp (RTD),C,Auto,5.5",
            "102,DC Voltage,Vdc,Auto,5.5", ",,,,", "Scan Interval,00:00:10,,,",
            "Scan Sweep Time (Sec),Scan Number,101 (C)- Tref,102 (Vdc)- Sensor,",
            "2020-02-21 13:41:31.610,1,20.012,0.20015,", "2020-02-21 13:41:41.610,2,25.034,+9.90000000E+37,",
            "2020-02-21 13:41:51.610,3,30.034,0.3,",
        ),
        {"Scan Number": [1, 2, 3], "101 (C)- Tref": [20.012, 25.034, 30.034],
         "102 (Vdc)- Sensor": [0.20015, None, 0.3]},
        8, (9, 11), {}, ("names in row 8", "1 cell with 9.9E37"),
    ),
    "agilent benchlink 34970a": Form(
        lines(
            "Name:,Data 1", "Owner:,lab", "Comments:", "Acquisition Date:,2/21/2020 1:41:31 PM", "",
            "Channels,,,", "101 <ref>,Temp,C", "", "Scan,Time,101 <ref> (C),Alarm 101,102 <out> (VDC)",
            "1,02/21/2020 13:41:31:610,20.012,0,0.20015", "2,02/21/2020 13:41:41:610,25.034,0,0.25031",
        ).encode("utf-16"),
        {"Scan": [1, 2], "101 <ref> (C)": [20.012, 25.034], "102 <out> (VDC)": [0.20015, 0.25031],
         "Time": ["02/21/2020 13:41:31:610", "02/21/2020 13:41:41:610"]},
        9, (10, 11), {}, ("encoding utf-16", "month first"),
    ),
    "keithley kickstart": Form(
        lines(
            "Instrument,DMM6500", "Serial,0412345", "", "Index,Time,Reading,Unit,Range", "1,0.0,1.00012,VDC,10 V",
            "2,0.5,Overflow,VDC,10 V", "3,1.0,1.00035,VDC,10 V",
        ),
        {"Index": [1, 2, 3], "Reading": [1.00012, None, 1.00035], "Unit": ["VDC"] * 3, "Range": [10, 10, 10]},
        4, (5, 7), {"Range": "V"}, ("1 cell with Overflow: no reading",),
    ),
    "rigol": Form(
        lines("X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,-1.00e-05,2.0e-07",
              "0,1.0e-01,-1.0,", "1,2.0e-01,-2.0,"),
        {"X": [0, 1], "CH1": [0.1, 0.2], "CH2": [-1, -2]}, 1, (3, 4), {"CH1": "Volt", "CH2": "Volt"},
        ("Start = -1.00e-05", "Increment = 2.0e-07", "(row 2)"),
    ),
    "rigol, newer": Form(
        lines("Time(s),CH1V,t0 = -6.0e-02, tInc = 1.0e-06,", "-6.0e-02,0.5,,,", "-5.9e-02,0.75,,,", "-5.8e-02,1.0,,,"),
        {"Time(s)": [-0.06, -0.059, -0.058], "CH1V": [0.5, 0.75, 1.0]}, 1, (2, 4),
    ),
    "keysight scope": Form(
        lines("x-axis,1,2", "second,Volt,Volt", "-1.0E-03,0.25,0.5", "-0.9E-03,0.5,0.75", "-0.8E-03,0.75,0.75"),
        {"x-axis": [-1e-3, -0.9e-3, -0.8e-3], "1": [0.25, 0.5, 0.75], "2": [0.5, 0.75, 0.75]}, 1, (3, 5),
        {"x-axis": "second", "1": "Volt", "2": "Volt"},
    ),
    "siglent": Form(
        lines(
            "Record Length,Analog:4", "Sample Interval,1.000000E-07", "Vertical Units,V", "Horizontal Units,s",
            "Source,CH1", "Second,Value", "-2.0E-07,0.004", "-1.0E-07,0.006", "0.0E+00,0.008", "1.0E-07,0.010",
        ),
        {"Second": [-2e-7, -1e-7, 0, 1e-7], "Value": [0.004, 0.006, 0.008, 0.01]}, 6, (7, 10),
    ),
    "tektronix": Form(
        lines(
            "Model,MSO54", "Firmware Version,1.28", "Waveform Type,ANALOG", "Point Format,Y", "Horizontal Units,s",
            "Horizontal Scale,4e-06", "Sample Interval,3.2e-10", "Record Length,3", "Label,", "", "TIME,CH1,CH2",
            "-2.0e-05,0.5,-0.5", "-1.0e-05,0.75,-0.75", "0.0,1.0,-1.0",
        ),
        {"TIME": [-2e-5, -1e-5, 0], "CH1": [0.5, 0.75, 1.0], "CH2": [-0.5, -0.75, -1]}, 11, (12, 14),
    ),
    "lecroy": Form(
        lines(
            "LECROYWS452,12345,Waveform", "Segments,1,SegmentSize,1002", "Segment,TrigTime,TimeSinceSegment1",
            "#1,01-Dec-2020 10:00:00,0", "Time,Ampl", "-5e-07,0.125", "-4e-07,0.25", "-3e-07,0.375",
        ),
        {"Time": [-5e-7, -4e-7, -3e-7], "Ampl": [0.125, 0.25, 0.375]}, 5, (6, 8),
    ),
    "labview lvm": Form(
        lines(
            "LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t,",
            "Date\t2019/07/22", "Time\t17:18:18,938945770263671875", "***End_of_Header***\t", "",
            "Channels\t2", "Samples\t3\t3", "Date\t2019/07/22\t2019/07/22", "X_Dimension\tTime\tTime",
            "X0\t0,0000000000000000E+0\t0,0000000000000000E+0", "Delta_X\t1,000000\t1,000000",
            "***End_of_Header***", "X_Value\tUntitled\tUntitled 1\tComment",
            "0,000000\t0,000000\t0,055544", "1,000000\t0,250000\t0,054323", "2,000000\t0,500000\t0,055239",
        ),
        {"X_Value": [0, 1, 2], "Untitled": [0, 0.25, 0.5], "Untitled 1": [0.055544, 0.054323, 0.055239]}, 16, (17, 19),
        {}, ("decimal comma", "tabs"),
    ),
    "labview lvm without x": Form(
        lines(
            "LabVIEW Measurement\t", "X_Columns\tNo", "***End_of_Header***\t", "", "Channels\t2", "Samples\t3\t3",
            "X0\t0.0E+0\t0.0E+0", "Delta_X\t1.000000\t1.000000", "***End_of_Header***",
            "X_Value\tP\tT\tComment", "\t0.125\t20.5\tstart", "\t0.25\t20.75", "\t0.375\t21.0",
        ),
        {"P": [0.125, 0.25, 0.375], "T": [20.5, 20.75, 21.0], "Comment": ["start", "", ""]}, 10, (11, 13), {},
        ("no values in X_Value",),
    ),
    "pico": Form(
        lines("Time,Channel A,Channel B", "(ms),(V),(mV)", "", "-5.0,0.125,1.5", "-4.0,∞,2.5", "-3.0,0.25,3.5"),
        {"Time": [-5, -4, -3], "Channel A": [0.125, None, 0.25], "Channel B": [1.5, 2.5, 3.5]}, 1, (4, 6),
        {"Time": "ms", "Channel A": "V", "Channel B": "mV"}, ("1 cell with ∞",),
    ),
    "omega": Form(
        lines(
            "Omega OM-CP-QUADTEMP\t", "Start:\t02/21/2020 13:41", "", "Date\tTime\tCh 1 (°C)\tCh 2 (°C)",
            "02/21/2020\t01:41:31 PM\t20.5\t21.5", "02/21/2020\t01:41:41 PM\t20.75\tOPEN",
        ).encode("cp1252"),
        {"Ch 1 (°C)": [20.5, 20.75], "Ch 2 (°C)": [21.5, None], "Time": ["01:41:31 PM", "01:41:41 PM"]}, 4, (5, 6), {},
        ("encoding cp1252", "1 cell with OPEN", "month first"),
    ),
    "testo": Form(
        lines(
            "testo 175 H1;;", "Seriennummer: 40345;;", "id;Datum / Uhrzeit;Temperatur [°C];Feuchte [%rF]",
            "1;21.02.2020 13:41:31;20,5;45,2", "2;21.02.2020 13:51:31;20,6;----", "3;21.02.2020 14:01:31;20,7;45,4",
        ),
        {"Temperatur [°C]": [20.5, 20.6, 20.7], "Feuchte [%rF]": [45.2, None, 45.4]}, 3, (4, 6), {},
        ("decimal comma", "day first", "1 cell with ----"),
    ),
    "vaisala": Form(
        lines(
            "Device:\tHMT330", "", "Date\tTime\tRH\tT\tTd", "yyyy-mm-dd\thh:mm:ss\t%RH\t'C\t'C",
            "2020-02-21\t13:41:31\t45.25\t20.5\t8.25", "2020-02-21\t13:41:41\t45.5\t20.75\t8.5",
        ),
        {"RH": [45.25, 45.5], "T": [20.5, 20.75], "Td": [8.25, 8.5]}, 3, (5, 6), {"RH": "%RH", "T": "'C", "Td": "'C"},
    ),
    "graphtec": Form(
        lines(
            'Vendor,"GRAPHTEC Corporation"', 'Model,"GL240"', 'Version,"Ver1.11  "', "Sampling interval,200ms",
            "Total data points,3        ", "Start time,2026-09-24,09:09:54", "AMP settings",
            "CH,Signal name,Input,Range,Filter,Span,,Unit", 'CH1," ref",DC,100mV,Off,+50.00,-50.00,[mV]',
            'CH2," out",TEMP,TC_K,Off,+50.00,-50.00,[degC]', "Data",
            "Number,Date&Time,ms,CH1,CH2,Alarm1-10,AlarmOut", 'NO.,Time,ms,"mV","degC","A1234567890","A1234"',
            '1,2026/09/24 09:09:54,000,"+  0.25","+ 20.5",LLLLLLLLLL,LLLL',
            '2,2026/09/24 09:09:54,200,"-  0.50","BURNOUT",LLLLLLLLLL,LLLL',
            '3,2026/09/24 09:09:54,400,"+++++++","+ 21.5",LLLLLLLLLL,LLLL',
        ),
        {"Number": [1, 2, 3], "ms": [0, 200, 400], "CH1": [0.25, -0.5, None], "CH2": [20.5, None, 21.5]}, 12, (14, 16),
        {"ms": "ms", "CH1": "mV", "CH2": "degC"}, ("1 cell with +++++++", "1 cell with BURNOUT"),
    ),
    "yokogawa": Form(
        lines(
            "MX100 file,,,", "Date,Time,CH001,CH002", ",,V,degC", "2020/02/21,13:41:31,0.25,20.5",
            "2020/02/21,13:41:32,+OVER,20.75", "2020/02/21,13:41:33,0.75,21.0",
        ),
        {"CH001": [0.25, None, 0.75], "CH002": [20.5, 20.75, 21.0]}, 2, (4, 6), {"CH001": "V", "CH002": "degC"},
        ("1 cell with +OVER",),
    ),
    "hioki": Form(
        lines(
            '"HIOKI CSV","8420"', '"TITLE","none"', '"SAMPLING","1s"', "",
            '"Time","CH1-1[V]","CH1-2[C]"', '"20-02-2020 13:41:31","1.25E-01","2.05E+01"',
            '"20-02-2020 13:41:32","2.50E-01","OVER"', '"20-02-2020 13:41:33","3.75E-01","2.10E+01"',
        ),
        {"CH1-1[V]": [0.125, 0.25, 0.375], "CH1-2[C]": [20.5, None, 21.0]}, 5, (6, 8), {},
        ("day first", "1 cell with OVER"),
    ),
    "datataker": Form(
        lines(
            '"Timestamp","TZ","1TK (Deg C)","2V (mV)"', "2020/02/21 13:41:31.000,n,20.5,0.125",
            "2020/02/21 13:41:41.000,n,20.75,0.25",
        ),
        {"1TK (Deg C)": [20.5, 20.75], "2V (mV)": [0.125, 0.25]}, 1, (2, 3),
    ),
    "almemo": Form(
        lines(
            "AMR ALMEMO 2590;;;", "DATE:;TIME:;M00: °C;M01: mV", "21.02.20;13:41:31;20,5;0,125",
            "21.02.20;13:41:41;20,75;0,25", "21.02.20;13:41:51;21,0;0,5",
        ).encode("cp1252"),
        {"M00: °C": [20.5, 20.75, 21], "M01: mV": [0.125, 0.25, 0.5]}, 2, (3, 5), {},
        ("day first, years of two digits (2020)", "decimal comma"),
    ),
    "fluke hydra": Form(
        lines(
            "Scan,Date,Time,Chan 0 (VDC),Chan 1 (C)", "1,02/21/20,13:41:31,0.125,20.5", "2,02/21/20,13:41:41,OTC,20.75",
            "3,02/21/20,13:41:51,0.5,21.0",
        ),
        {"Scan": [1, 2, 3], "Chan 1 (C)": [20.5, 20.75, 21.0], "Chan 0 (VDC)": ["0.125", "OTC", "0.5"]}, 1, (2, 4), {},
        ("month first, years of two digits (2020)",),
    ),
    "german excel": Form(
        lines("Kraft [kN];Signal [mV/V];Zeit", "0,5;1.234,56;09.12.2022 16:39", "1,5;2.345,67;09.12.2022 16:41"),
        {"Kraft [kN]": [0.5, 1.5], "Signal [mV/V]": [1234.56, 2345.67]}, 1, (2, 3), {},
        ("decimal comma", "digits in groups, such as 1.234,56", "day first"),
    ),
    "french excel": Form(
        lines("Charge (N);Sortie (mV)", "10,5;1 234,56", "20,5;2 345,67", "Moyenne;1 790,115", ""),
        {"Sortie (mV)": [1234.56, 2345.67], "Charge (N)": [10.5, 20.5]}, 1, (2, 3), {},
        ("row 4 (Moyenne) left out", "digits in groups"),
    ),
    "italian excel": Form(
        lines("Carico (N);Uscita (mV)", "10,5;1.234.567,25", "20,5;2.345.678,50"),
        {"Uscita (mV)": [1234567.25, 2345678.5]}, 1, (2, 3),
    ),
    "swiss excel": Form(
        lines("Kraft;Signal", "10.5;1'234.56", "20.5;2'345.67"), {"Signal": [1234.56, 2345.67]}, 1, (2, 3),
    ),
    "american excel": Form(
        lines("Load (lbf),Output", '"1,000.50",1.25', '"2,000.25",2.5'), {"Load (lbf)": [1000.5, 2000.25]}, 1, (2, 3),
    ),
    "balance": Form(
        lines("No;Weight;Time", "1;100.012 g;10:00:01", "2;100.013 g;10:00:05", "3;-0.002 g;10:00:09"),
        {"Weight": [100.012, 100.013, -0.002]}, 1, (2, 4), {"Weight": "g"},
        ("numbers with their unit in each cell: Weight",),
    ),
    "results with their uncertainties (GUM, 7.2.2)": Form(
        lines("I_A,U_V", "0.1,0.1021(12)", "0.2,0.2034(12)", "0.3,0.3029(110)"),
        {"U_V": [0.1021, 0.2034, 0.3029], "u_U_V": [0.0012, 0.0012, 0.0110]}, 1, (2, 4), {},
        ("the digits in parentheses beside U_V are its standard uncertainty, in the column u_U_V",),
    ),
    "results with limits": Form(
        lines("I_A;U_V", "0,1;0,1021 ± 0,0012", "0,2;0,2034 ± 0,0012", "0,3;0,3029 ± 0,011"),
        {"U_V": [0.1021, 0.2034, 0.3029]}, 1, (2, 4), {},
        ("what stands beside the values of U_V is not used: give standard uncertainties in a column u_U_V",),
    ),
    "write.table of R": Form(
        lines('"x" "y"', '"1" 0.5 1.25', '"2" 1.5 2.25', '"3" 2.5 3.5'),
        {"x": [0.5, 1.5, 2.5], "y": [1.25, 2.25, 3.5]}, 1, (2, 4), {}, ("without a name: column_1",),
    ),
    "titration": Form(
        lines(
            "Titrando 905", "Method: pH", "", "Volume\tU\tTemperature", "mL\tmV\t°C", "0.0000\t-12.5\t25.0",
            "0.1000\t-11.5\t25.0", "0.2000\t-10.0\t25.0",
        ).encode("cp1252"),
        {"Volume": [0, 0.1, 0.2], "U": [-12.5, -11.5, -10]}, 4, (6, 8),
        {"Volume": "mL", "U": "mV", "Temperature": "°C"},
    ),
    "plate reader": Form(
        lines(
            "User: X", "Path: C,,,,,", "Date: 16/03/2022,,,,,",
            "Absorbance spectrum,,,,values are displayed as OD,",
            ",,,,,", ",,,Raw Data (Abs),Raw Data (Abs),Raw Data (Abs)",
            "Well,Sample,Dilution,220,222,224",
            "A1,S1,1,3.736,3.389,3.636", "A3,S1,2,3.669,3.651,3.956", "A5,S1,4,3.232,4.083,4.167",
            "E3,Blank,1,3.3,3.7,4",
        ),
        {"Dilution": [1, 2, 4, 1], "220": [3.736, 3.669, 3.232, 3.3], "Well": ["A1", "A3", "A5", "E3"]}, 7, (8, 11),
        {}, ("names in row 7",),
    ),
    "empty columns at the end": Form(
        lines("time,T1,RH1,T2,RH2", "0,26.38,37.23,", "10,26.48,38.32,", "20,26.14,33.70,"),
        {"time": [0, 10, 20], "T1": [26.38, 26.48, 26.14], "RH1": [37.23, 38.32, 33.7]}, 1, (2, 4), {},
        ("names in row 1", "no values in T2, RH2"),
    ),
    "empty columns and a preamble": Form(
        lines("Logger 7", "", "time;T1;RH1;T2;;", "0;26,38;37,23;;;", "10;26,48;38,32;;;"),
        {"time": [0, 10], "T1": [26.38, 26.48], "RH1": [37.23, 38.32]}, 3, (4, 5), {}, ("no values in T2",),
    ),
    "ctime": Form(
        lines("when,ref_C,out_V", "Tue Nov 24 10:00:00 2020,20.01,0.2001", "Tue Nov  3 10:01:00 2020,25.02,OL",
              "Tue Nov 24 10:02:00 2020,30.01,0.3"),
        {"ref_C": [20.01, 25.02, 30.01], "out_V": [0.2001, None, 0.3]}, 1, (2, 4), {}, ("1 cell with OL: no reading",),
    ),
    "decimal comma beside dates": Form(
        lines("Zeit;Temperatur", "09.12.2022 16:39:26;3,303", "09.12.2022 16:41:26;3,370"),
        {"Temperatur": [3.303, 3.37]}, 1, (2, 3), {}, ("decimal comma, as beside dates with dots", "day first"),
    ),
    "carriage returns": Form(
        "x;y\r0,5;1,25\r1,5;2,25\r".encode("utf-8-sig"), {"x": [0.5, 1.5], "y": [1.25, 2.25]}, 1, (2, 3),
    ),
    "remarks at the end": Form(
        lines("x,y", "1,2.5", "2,3.5", "# stopped by hand", "# 9,9"), {"x": [1, 2], "y": [2.5, 3.5]}, 1, (2, 3), {},
        ("rows 4, 5 left out as remarks",),
    ),
    "summaries": Form(
        lines("run,x,y", "1,1,2.5", "2,2,3.5", "3,3,4.5", "Average,2,3.5", "Std dev,1,1", "Sum,6,10.5"),
        {"x": [1, 2, 3], "y": [2.5, 3.5, 4.5]}, 1, (2, 4), {},
        ("row 5 (Average), row 6 (Std dev), row 7 (Sum) left out",),
    ),
    "quoted separators": Form(
        lines('"x, set","y, read",note', '1,2.5,"a, b"', '2,3.5,"c; d"'),
        {"x, set": [1, 2], "y, read": [2.5, 3.5], "note": ["a, b", "c; d"]}, 1, (2, 3),
    ),
    "padding": Form(
        lines("  x   ,   y   ", "   1   ,   2.5   ", "   2   ,   3.5   "), {"x": [1, 2], "y": [2.5, 3.5]}, 1, (2, 3),
    ),
    "names twice, in groups": Form(
        lines("Reference,,Device,", "p,T,p,T", "[kPa],[degC],[mV],[degC]", "0,20.1,0.02,21.5", "50,20.2,25.5,21.6"),
        {"Reference p": [0, 50], "Reference T": [20.1, 20.2], "Device p": [0.02, 25.5], "Device T": [21.5, 21.6]}, 2,
        (4, 5), {"Reference p": "kPa", "Device p": "mV", "Device T": "degC", "Reference T": "degC"},
        ("names in row 2, with those of their groups in row 1 where they occur twice",),
    ),
    "names twice, each with its group": Form(
        lines("Bench 4", "", "Time;Left;Right", "t;F;F", "s;N;N", "0,5;1,5;2,5", "1,5;3,5;4,5"),
        {"t": [0.5, 1.5], "Left F": [1.5, 3.5], "Right F": [2.5, 4.5]}, 4, (6, 7),
        {"t": "s", "Left F": "N", "Right F": "N"}, ("names in row 4, with those of their groups in row 3",),
    ),
    "padding, and a separator at the end": Form(
        lines("  load (N) ,   reading (mV)  , ", "   0.0 ,  0.001 , ", "  10.0 ,  1.002 , ", "  20.0 ,  2.003 , "),
        {"load (N)": [0, 10, 20], "reading (mV)": [0.001, 1.002, 2.003]}, 1, (2, 4),
    ),
    "days of a spreadsheet": Form(
        lines("Excel date,y", "44927.0,1.5", "44927.25,2.5"), {"Excel date": [44927, 44927.25], "y": [1.5, 2.5]}, 1,
        (2, 3), {}, ("Excel date counts days as a spreadsheet does: the first row is of 2023-01-01 00:00:00",),
    ),
    "an epoch in milliseconds": Form(
        lines("timestamp_ms,T", "1583331342193,20.5", "1583331343193,20.75"), {"T": [20.5, 20.75]}, 1, (2, 3), {},
        ("timestamp_ms counts ms from 1970 on, if it is the time: the first row is of 2020-03-04 14:15:42 UTC",),
    ),
    "key=value": Form(
        lines("t=0 lux=12.5 raw=100", "t=10 lux=25.0 raw=201", "t=20 lux=50.0 raw=399"),
        {"t": [0, 10, 20], "lux": [12.5, 25, 50], "raw": [100, 201, 399]}, 0, (1, 3), {}, ("key=value",),
    ),
    "lines of json": Form(
        lines('{"t": 0, "T": 20.5}', '{"t": 10, "T": 21.5}'), {"t": [0, 10], "T": [20.5, 21.5]}, 0, (1, 2), {},
        ("key=value",),
    ),
    "key=value after a time": Form(
        lines("2020-02-21 10:00:00 T=20.5 U=0.5", "2020-02-21 10:00:10 T=21.5 U=0.6", "restarted",
              "2020-02-21 10:00:20 T=22.5 U=0.7", "2020-02-21 10:00:30 T=23.5 U=0.8"),
        {"T": [20.5, 21.5, 22.5, 23.5], "time": [f"2020-02-21 10:00:{i}0" for i in range(4)]}, 0, (1, 5), {},
        ("row 3 without such values not read",),
    ),
    "whole lines in quotes": Form(
        lines('"x;y"', '"1,5;2,5"', '"2,5;3,5"'), {"x": [1.5, 2.5], "y": [2.5, 3.5]}, 1, (2, 3), {},
        ("quotes around whole lines left out",),
    ),
    "units in remarks": Form(
        lines("# x y", "# mm V", "1 2.5", "2 3.5"), {"x": [1, 2], "y": [2.5, 3.5]}, 1, (3, 4), {"x": "mm", "y": "V"},
    ),
    "names of groups above names": Form(
        lines("Sensor A,,Sensor B,", "T,RH,T,RH", "20.5,45,20.6,46", "21.5,46,21.6,47"),
        {"Sensor A T": [20.5, 21.5], "Sensor B RH": [46, 47]}, 2, (3, 4), {},
        ("names in row 2, with those of their groups in row 1",),
    ),
    "key: value with units": Form(
        lines("# log", "T: 20.5 C, U: 0.125 V", "T: 21.5 C, U: 0.25 V"),
        {"T": [20.5, 21.5], "U": [0.125, 0.25]}, 0, (2, 3),
        {"T": "C", "U": "V"}, ("key=value",),
    ),
}  # fmt: skip


def written(tmp_path, text, name="data.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("form", FORMS)
def test_files_of_instruments_are_read_right_and_what_was_understood_is_said(tmp_path, form):
    given = FORMS[form]
    table = FileSource(written(tmp_path, given.text)).all_columns()
    for name, values in given.columns.items():
        if isinstance(values[0], str):
            assert table.text[name].tolist() == values
        else:
            expected = [math.nan if value is None else value for value in values]
            np.testing.assert_array_equal(table.columns[name], expected)
    assert table.understood.get("header_row", 1) == given.header
    assert {name: unit for name, unit in table.units.items() if unit} == given.units
    if given.rows:
        assert (table.rows[0], table.rows[-1]) == given.rows
    for part in given.said:
        assert part in table.understood["sentence"]


ASKED = {
    "sessions with preambles of their own": (
        lines("Logger", "Start 10:00", "x,y", "1,2.5", "2,3.5", "", "Logger", "Start 11:00", "x,y", "3,4.5", "4,5.5"),
        "holds several tables",
    ),
    "numbers that may be names": (lines("Well,660,664", "A1,3.7,3.3", "A2,2.7,2.3"), "say --header 1 or --header 0"),
    "fewer names": (lines("x,y", "1,2,3,4", "4,5,6,7"), "2 names, and 4 values"),
    "more names": (lines("x;y;z;w", "1,5;2,5", "4,5;5,5"), "4 names, and 2 values"),
    "two rows of names": (lines("a,b", "c,d", "1,2", "3,4"), "rows 1 and 2 may both hold the names"),
    "zeros of a lost block": ("x,y\n1,2.5\n2,3.5\n" + 40 * "\0", "there is a NUL in it"),
    "a group or a fraction": (lines("x;y", "1;1,234", "2;5,678"), "may be 1.234 or 1234; say --decimal"),
}


@pytest.mark.parametrize("case", ASKED)
def test_what_can_be_read_in_two_ways_is_asked(tmp_path, case):
    text, says = ASKED[case]
    with pytest.raises(UsageError, match=says):
        FileSource(written(tmp_path, text)).all_columns()


HEADED = {
    "empty columns at the end": (
        lines("time,T1,T2", "0,26.5,", "10,26.25,"),
        1,
        {"time": [0, 10], "T1": [26.5, 26.25]},
    ),
    "numbers as names": (lines("Well,660,664", "A1,3.7,3.3", "A2,2.7,2.3"), 1, {"660": [3.7, 2.7], "664": [3.3, 2.3]}),
    "units under the names": (lines("title", "a,b", "s,V", "1,2", "3,4"), 2, {"a": [1, 3], "b": [2, 4]}),
    "another row of words above": (lines("a,b", "c,d", "1,2", "3,4"), 2, {"c": [1, 3], "d": [2, 4]}),
    "the second of two tables": (lines("x,y", "1,2", "2,3", "3,4", "new", "x,y", "5,6", "7,8"), 6, {"x": [5, 7]}),
    "a preamble of the same width": (
        lines("Model,DMM,", "Date,2020-02-21,", "x,y,z", "1,2,3", "4,5,6"),
        3,
        {"x": [1, 4]},
    ),
    "a remark": (lines("# made by hand", "# x y", "1 2", "3 4"), 2, {"x": [1, 3], "y": [2, 4]}),
}


@pytest.mark.parametrize("case", HEADED)
def test_the_row_of_names_that_is_said_is_obeyed_and_no_observation_is_lost(tmp_path, case):
    """`--header 1` of a table with empty columns at the end took row 2 for the names."""
    text, row, columns = HEADED[case]
    table = FileSource(written(tmp_path, text), FileForm.of(None, None, None, row)).all_columns()
    assert {name: table.columns[name].tolist() for name in columns} == columns
    assert table.understood.get("header_row", 1) == row


def test_a_row_of_names_that_is_not_there_is_told(tmp_path):
    with pytest.raises(UsageError, match="--header 9: this row is blank, or there is none; the last one is 3"):
        FileSource(written(tmp_path, lines("x,y", "1,2", "3,4")), FileForm.of(None, None, None, 9)).all_columns()


@pytest.mark.parametrize("word", ["OL", "-OL", "O.L", "Overload", "+OVER", "OVERRANGE", "----", "+++++++", "BURNOUT"])
def test_words_for_no_reading_are_gaps_in_numbers_and_words_elsewhere(tmp_path, word):
    path = written(tmp_path, lines("x,y,state", "1,2.5,up", f"2,{word},{word}", "3,4.5,up"))
    table = read_any_csv(path, ("x", "y"))
    assert table.columns["y"].tolist() == [2.5, 4.5]
    assert f"1 cell with {word}: no reading, so no value" in table.understood["sentence"]
    assert "1 row left out without a value in y (row 3)" in table.understood["sentence"]
    assert read_any_csv(path, ("state",)).text["state"].tolist() == ["up", word, "up"]


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (["06/13/23 12:00:00 AM", "06/13/23 12:00:30 PM"], [0, 43230]),
        (["Tue Nov 24 10:00:00 2020", "Wed Nov 25 10:00:01 2020"], [0, 86401]),
        (["Fri Feb  5 10:00:00 2021", "Fri Feb  5 10:00:02 2021"], [0, 2]),
        (["24-Nov-2020 10:00:00", "25-Nov-2020 10:00:00"], [0, 86400]),
        (["31. Dez. 2020 23:59:59", "1. Jan. 2021 00:00:01"], [0, 2]),
        (["Dec 31, 2020 11:59:59 PM", "Jan 1, 2021 12:00:00 AM"], [0, 1]),
        (["24.11.20 10:00", "24.11.20 10:01"], [0, 60]),
        (["31.12.99 23:59:59", "01.01.00 00:00:00"], [0, 1]),
        (["2020/11/24 10:00:00.25", "2020/11/24 10:00:01.75"], [0, 1.5]),
        (["20201124T100000", "20201124T100010"], [0, 10]),
        (["2020-11-24T10:00:00+01:00", "2020-11-24T09:00:01Z"], [0, 1]),
        (["2020-02-28 23:59:59", "2020-02-29 00:00:00"], [0, 1]),
        (["20/10/2024-01:18:45", "20/10/2024-01:19:45"], [0, 60]),
        (["20/Oct/2024:23:59:59 +0200", "21/Oct/2024:00:00:01 +0200"], [0, 2]),
        (["2024-10-20_01:18:45", "2024-10-20_01:19:00"], [0, 15]),
    ],
)
def test_times_of_instruments_in_seconds(texts, expected):
    assert seconds_of("t", texts).tolist() == expected


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["06/11/23 10:00", "07/11/23 10:00"], "--date-order dmy or --date-order mdy"),
        (["20-02-21", "20-02-22"], "--date-order dmy or --date-order ymd"),
        (["13/04/2026", "04/13/2026"], "no dates in the same order"),
        (["30/02/2026", "01/03/2026"], "which is no time"),
    ],
)
def test_dates_that_may_be_read_in_two_ways_are_asked_about(texts, says):
    with pytest.raises(FitError, match=says):
        seconds_of("t", texts)


def test_the_order_that_is_said_is_used():
    assert seconds_of("t", ["20-02-21", "20-02-22"], None, "ymd").tolist() == [0, 86400]
    assert seconds_of("t", ["20-02-21", "20-02-22"], None, "dmy").tolist() == [0, 365 * 86400]


def test_what_was_understood_of_a_logger_is_said_by_the_commands(tmp_path):
    path = written(tmp_path, FORMS["campbell toa5"].text.replace("NAN", "24.75"))
    done = rig("fit", path, "--response", "RH", "--formula", "1 + AirTC")
    assert "names in row 2; row 4 left out: it says how the logger made the values" in done.stderr


@pytest.mark.parametrize("names", ["#,kN,V", "#,force,out", "No.,kN,V"])
def test_names_that_are_units_beside_numbered_rows_are_names(tmp_path, names):
    path = written(tmp_path, f"{names}\n1,0,0.1002\n2,1,0.2011\n3,2,0.2998\n4,3,0.4003\n")
    first, *others = names.split(",")
    table = read_any_csv(path, others)
    assert [table.columns[name].tolist()[:2] for name in others] == [[0, 1], [0.1002, 0.2011]]
    assert read_any_csv(path, (first,)).columns[first].tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize("more", ["", ",note"])
def test_a_table_of_a_dry_run_stays_simulated_with_named_columns(tmp_path, more):
    cells = [f"{x},{2 * x + 0.01 * (x * 7 % 5 - 2):.4f},1{',ok' if more else ''}" for x in range(20)]
    (tmp_path / "e.csv").write_text("\n".join([f"x,y,simulated{more}", *cells]) + "\n")
    done = rig("trace", "e.csv", "--response", "y", "--formula", "1 + x", "--report", "e.html", cwd=tmp_path)
    assert done.stdout.startswith("SIMULATED e.csv"), done.stdout
    assert "SIMULATED: no real instrument" in (tmp_path / "e.html").read_text()
