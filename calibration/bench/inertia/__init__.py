"""Inertia from bifilar swings: recordings, fits, checks, budget, planning, live view, figures."""

from calibration.bench.inertia.errors import RigError, SwingFileError, UnusableSwingError
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.inertia import InertiaResult, formula_inertia, inertia_about_axis
from calibration.bench.inertia.live import LiveState, LiveSwing, LiveView
from calibration.bench.inertia.paper import peak_period
from calibration.bench.inertia.plan import HangPlan, Instruments, plan_hang
from calibration.bench.inertia.recordings import read_swing, write_swing
from calibration.bench.inertia.rest import RestCheck, check_rest
from calibration.bench.inertia.rig import Jig, Rig, UnitDoubt, check_rig, measured, unit_doubts
from calibration.bench.inertia.swing import Swing
from calibration.bench.inertia.swing_fit import SwingFit

__all__ = [
    "HangPlan",
    "InertiaResult",
    "Instruments",
    "Jig",
    "LiveState",
    "LiveSwing",
    "LiveView",
    "RestCheck",
    "Rig",
    "RigError",
    "Swing",
    "SwingFileError",
    "SwingFit",
    "UnitDoubt",
    "UnusableSwingError",
    "check_rest",
    "check_rig",
    "fit_swing",
    "formula_inertia",
    "inertia_about_axis",
    "measured",
    "peak_period",
    "plan_hang",
    "read_swing",
    "unit_doubts",
    "write_swing",
]
