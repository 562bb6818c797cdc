"""Effects of what is measured and when: the world moves as without them."""

from onboard.vehicle.effects.description import Domain, EffectDescription, EffectParameter, same_for

_XYZ = ("x", "y", "z")

DESCRIPTIONS = (
    EffectDescription(
        name="pose_delay",
        domain=Domain.TIMING,
        equation="pose seen at t is that of t - delay",
        parameters={
            "delay": EffectParameter(
                unit="s",
                low=0.0,
                high=0.1,
                typical=0.015,
                neutral=0.0,
                practical_minimum=0.003,
                meaning="age of the motion-capture pose that nobody reports",
                source="15 ms in the authors' later simulation (SIM, Sim_Settings.yaml)",
            )
        },
        revealed_by="quick motion with a gyro: attitude doublets and chirps",
        confused_with=(
            "motor_lag",
            "command_delay",
            "rotor_drag",
            "linear_drag",
            "body_drag",
        ),
        reference="pure delay",
    ),
    EffectDescription(
        name="pose_rotation",
        domain=Domain.SENSING,
        equation="q_seen = q exp((x, y, z) / 2)",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="rad",
                low=-0.3,
                high=0.3,
                typical=0.03,
                neutral=0.0,
                practical_minimum=0.0087,
                meaning="turn of the tracked frame about this body axis",
                source="NanoBench flights: 0.5 to 4.3 deg [measured]",
            ),
        ),
        revealed_by="rest on the floor, hover with a yaw by 180 deg, turns about every axis",
        confused_with=(
            "rotor_drag",
            "linear_drag",
            "body_drag",
            "wind",
            "thrust_tilt",
        ),
        reference="marker frame that was drawn by hand",
    ),
    EffectDescription(
        name="pose_offset",
        domain=Domain.SENSING,
        equation="p_seen = p + R (x, y, z)",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="m",
                low=-0.1,
                high=0.1,
                typical=0.01,
                neutral=0.0,
                practical_minimum=0.005,
                meaning="origin of the tracked frame from the body's, along this body axis",
                source="engineering estimate: height of a marker over the frame",
            ),
        ),
        revealed_by="fast turns of the body in place: attitude doublets, yaw steps",
        confused_with=("com_offset",),
        reference="marker frame that was drawn by hand",
    ),
    EffectDescription(
        name="gyro_bias",
        domain=Domain.SENSING,
        equation="w_seen = w + (x, y, z)",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="rad/s",
                low=-0.5,
                high=0.5,
                typical=0.02,
                neutral=0.0,
                practical_minimum=0.005,
                meaning="bias that is left after the calibration at start",
                source="engineering estimate: about 1 deg/s, a drone that was moved while it calibrated",
            ),
        ),
        revealed_by="any flight with motion capture; rest on the floor",
        confused_with=(),
        reference="constant bias",
    ),
)
