"""Inertia from bifilar swings: recordings, fits, checks, budget, planning, live view, figures."""

from calibration.bifilar.errors import RigError, SwingFileError, UnusableSwingError
from calibration.bifilar.fit import SwingFit, fit_swing
from calibration.bifilar.inertia import InertiaResult, formula_inertia, inertia_about_axis
from calibration.bifilar.live import LiveState, LiveSwing, LiveView
from calibration.bifilar.paper import peak_period
from calibration.bifilar.plan import HangPlan, Instruments, plan_hang
from calibration.bifilar.recordings import read_swing, write_swing
from calibration.bifilar.rest import RestCheck, check_rest
from calibration.bifilar.rig import Jig, Measured, Rig, UnitDoubt, check_rig, measured, unit_doubts
from calibration.bifilar.swing import Swing

__all__ = [
    "HangPlan",
    "InertiaResult",
    "Instruments",
    "Jig",
    "LiveState",
    "LiveSwing",
    "LiveView",
    "Measured",
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
