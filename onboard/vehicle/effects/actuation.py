"""Effects between the command and the thrust of a rotor."""

from onboard.vehicle.effects.description import (
    Domain,
    EffectDescription,
    EffectParameter,
    Needs,
    same_for,
)

_TACHOMETER = "authors' tachometer logs 1, 3, 5: fit of seven steps of the upgraded motor (authors_data 5)"

DESCRIPTIONS = (
    EffectDescription(
        name="thrust_scale",
        domain=Domain.ACTUATION,
        equation="F = scale F*",
        parameters={
            "scale": EffectParameter(
                unit="1",
                low=0.5,
                high=1.5,
                typical=0.95,
                neutral=1.0,
                practical_minimum=0.01,
                meaning="true over expected thrust of all rotors",
                source="air density alone: 10 % per 1000 m; propeller wear (bench notes 1.3)",
            )
        },
        revealed_by="any hover of known mass",
        confused_with=(
            "thrust_curve",
            "battery_sag",
            "motor_imbalance",
            "ceiling_effect",
            "ground_effect",
            "mass_error",
            "inertia_error",
        ),
        reference="thrust proportional to air density and to the square of the speed",
    ),
    EffectDescription(
        name="thrust_curve",
        domain=Domain.ACTUATION,
        equation="F = F* (1 + curvature (F*/F_hover - 1)), F_hover = m g / 4 of the vehicle file",
        parameters={
            "curvature": EffectParameter(
                unit="1",
                low=-0.3,
                high=0.3,
                typical=0.05,
                neutral=0.0,
                practical_minimum=0.01,
                meaning="relative change of thrust at twice the hover thrust; none at hover",
                source="coefficients that flew against the printed ones: 3 % above 3 g (errata 1)",
            )
        },
        revealed_by="vertical steps: thrust well below and above that of hover at one battery voltage",
        confused_with=(
            "thrust_scale",
            "battery_sag",
            "motor_saturation",
            "inflow_thrust_loss",
            "translational_lift",
            "mass_error",
        ),
        reference="first term of the deviation of a thrust map, made independent of a scale at hover",
    ),
    EffectDescription(
        name="battery_sag",
        domain=Domain.ACTUATION,
        equation="V = E - (R + resistance) I",
        parameters={
            "resistance": EffectParameter(
                unit="ohm",
                low=0.0,
                high=0.5,
                typical=0.05,
                neutral=0.0,
                practical_minimum=0.01,
                meaning="resistance of cell, leads and connector beyond the vehicle file's",
                source="sigma of the resistance of crazyflie21-upgraded (authors_data 2)",
            )
        },
        revealed_by="voltage that drops with the current: a long discharge, vertical steps",
        confused_with=(
            "thrust_scale",
            "thrust_curve",
            "motor_saturation",
            "mass_error",
        ),
        reference="source behind a resistance",
    ),
    EffectDescription(
        name="motor_lag",
        domain=Domain.ACTUATION,
        equation="tau_up, tau_down -> scale tau_up, scale tau_down",
        parameters={
            "scale": EffectParameter(
                unit="1",
                low=0.2,
                high=5.0,
                typical=1.2,
                neutral=1.0,
                practical_minimum=0.1,
                meaning="factor on both time constants of the thrust",
                source="printed 0.15 and 0.16 s, fitted 0.184 to 0.219 s down (errata 2)",
            )
        },
        revealed_by="steps of thrust and fast turns: thrust chops, attitude doublets",
        confused_with=(
            "motor_lag_asymmetry",
            "motor_speed_law",
            "command_delay",
            "inflow_thrust_loss",
            "rate_damping",
            "rotor_acceleration_torque",
            "inertia_error",
            "pose_delay",
        ),
        reference="first-order thrust (paper, motor model)",
        excludes=("motor_speed_law",),
    ),
    EffectDescription(
        name="motor_lag_asymmetry",
        domain=Domain.ACTUATION,
        equation="tau_up -> tau_up / sqrt(ratio), tau_down -> tau_down sqrt(ratio)",
        parameters={
            "ratio": EffectParameter(
                unit="1",
                low=0.1,
                high=10.0,
                typical=1.5,
                neutral=1.0,
                practical_minimum=0.15,
                meaning="factor on tau_down / tau_up, their product unchanged",
                source="fitted 0.078 s up and 0.185 s down against 0.05 and 0.15 s (authors_data 5)",
            )
        },
        revealed_by="large steps down against large steps up: throttle chops, flips",
        confused_with=(
            "motor_lag",
            "motor_speed_law",
            "command_delay",
        ),
        reference="brushed motors are driven up and coast down (bench notes 1.2)",
        excludes=("motor_speed_law",),
    ),
    EffectDescription(
        name="motor_speed_law",
        domain=Domain.ACTUATION,
        equation="dw/dt = a (ws - w) + b (ws^2 - w^2), one pair (a, b) up and one down",
        parameters={
            "a_up": EffectParameter(
                unit="1/s",
                low=0.0,
                high=50.0,
                typical=0.0,
                neutral=None,
                practical_minimum=1.0,
                meaning="back electromotive force while the winding conducts",
                source=_TACHOMETER,
            ),
            "b_up": EffectParameter(
                unit="1/rad",
                low=1e-5,
                high=0.05,
                typical=4.24e-3,
                neutral=None,
                practical_minimum=4e-4,
                meaning="drag torque of the propeller over the rotor's inertia, rising",
                source=_TACHOMETER,
            ),
            "a_down": EffectParameter(
                unit="1/s",
                low=0.0,
                high=50.0,
                typical=0.50,
                neutral=None,
                practical_minimum=1.0,
                meaning="friction of the coasting rotor",
                source=_TACHOMETER,
            ),
            "b_down": EffectParameter(
                unit="1/rad",
                low=1e-5,
                high=0.05,
                typical=1.78e-3,
                neutral=None,
                practical_minimum=2e-4,
                meaning="drag torque of the propeller over the rotor's inertia, falling",
                source=_TACHOMETER,
            ),
        },
        revealed_by="large steps up and down from several thrusts: throttle chops of two sizes, flips",
        confused_with=(
            "motor_lag",
            "motor_lag_asymmetry",
            "command_delay",
        ),
        reference="brushed motor with propeller, J dw/dt = kt (V - ke w) / R - kq w^2 (bench notes 1.2)",
        needs=(Needs.ROTOR_SPEED,),
        excludes=("motor_lag", "motor_lag_asymmetry"),
    ),
    EffectDescription(
        name="motor_imbalance",
        domain=Domain.ACTUATION,
        equation="F_i = m_i F*_i",
        parameters=same_for(
            ("m1", "m2", "m3", "m4"),
            EffectParameter(
                unit="1",
                low=0.3,
                high=1.5,
                typical=0.96,
                neutral=1.0,
                practical_minimum=0.01,
                meaning="true over expected thrust of this rotor",
                source="motor to motor 3 to 5 % (bench notes 1.3, engineering estimate)",
            ),
        ),
        revealed_by="hover and vertical steps: a constant moment that grows with the thrust",
        confused_with=(
            "thrust_scale",
            "velocity_moment",
            "com_offset",
            "thrust_tilt",
        ),
        reference="as thrust_scale, rotor by rotor",
    ),
    EffectDescription(
        name="motor_saturation",
        domain=Domain.ACTUATION,
        equation="F = min(F*, thrust_limit)",
        parameters={
            "thrust_limit": EffectParameter(
                unit="N",
                low=0.02,
                high=1.0,
                typical=0.125,
                neutral=None,
                practical_minimum=0.003,
                meaning="most that a rotor really gives",
                source="quadratic map at 2.5 V of a sagging pack: 12.5 gf (errata 1)",
            )
        },
        revealed_by="thrust at the upper end: fast climbs, a nearly empty battery",
        confused_with=(
            "thrust_curve",
            "battery_sag",
        ),
        reference="clipped duty of a pack that sags (authors_data 1: 2.9 % of samples at full PWM)",
    ),
    EffectDescription(
        name="command_delay",
        domain=Domain.TIMING,
        equation="F*(t) -> F*(t - delay)",
        parameters={
            "delay": EffectParameter(
                unit="s",
                low=0.0,
                high=0.06,
                typical=0.005,
                neutral=0.0,
                practical_minimum=0.003,
                meaning="from the controller's output to the motors",
                source="flip check: 5 to 10 ms of timing cannot be excluded (authors_data 2)",
            )
        },
        revealed_by="steps of thrust of two sizes, attitude doublets and chirps",
        confused_with=(
            "motor_lag",
            "motor_lag_asymmetry",
            "motor_speed_law",
            "pose_delay",
        ),
        reference="pure delay",
    ),
)
