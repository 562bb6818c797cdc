"""Effects of the air on body and rotors."""

from onboard.vehicle.effects.description import (
    Domain,
    EffectDescription,
    EffectParameter,
    Needs,
    same_for,
)

_XYZ = ("x", "y", "z")
_FOERSTER = (
    "Foerster 2015, System Identification of the Crazyflie 2.0, ETH Zurich: matrix of drag over rotor speed"
)

AIR_FORCES = (
    "rotor_drag",
    "linear_drag",
    "body_drag",
    "inflow_thrust_loss",
    "translational_lift",
    "velocity_moment",
)
"""Effects that depend on the motion through the air, and so on the wind."""

DESCRIPTIONS = (
    EffectDescription(
        name="rotor_drag",
        domain=Domain.AIR,
        equation="f_i = -coefficient w_i (u_x, u_y, 0) at each hub, u air-relative velocity of the hub",
        parameters={
            "coefficient": EffectParameter(
                unit="kg/rad",
                low=0.0,
                high=2e-5,
                typical=1.025e-6,
                neutral=0.0,
                practical_minimum=1.5e-07,
                meaning="force per rotor speed and in-plane velocity",
                source=_FOERSTER,
                grows={"mass": 1, "rotor_speed": -1},
            )
        },
        revealed_by="steady speed: laps in both directions",
        confused_with=(
            "linear_drag",
            "body_drag",
            "wind",
            "velocity_moment",
            "thrust_tilt",
            "pose_delay",
            "pose_rotation",
        ),
        reference=(
            "Mahony, Kumar, Corke, IEEE RAM 19(3), 2012; Faessler, Franchi, Scaramuzza, IEEE RA-L 3(2), 2018"
        ),
        needs=(Needs.ROTOR_SPEED,),
        by_forces=True,
    ),
    EffectDescription(
        name="linear_drag",
        domain=Domain.AIR,
        equation="f_k = -k u_k along each body axis, beyond the drag of [air]",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="N s/m",
                low=0.0,
                high=0.15,
                typical=0.0075,
                neutral=0.0,
                practical_minimum=0.0011,
                meaning="drag of the whole vehicle per speed along this body axis",
                source="rotor drag of Foerster 2015 at 7300 rad/s in all",
                grows={"mass": 1},
            ),
        ),
        revealed_by="steady speed: laps in both directions; climbs for z",
        confused_with=(
            "rotor_drag",
            "body_drag",
            "inflow_thrust_loss",
            "wind",
            "thrust_tilt",
            "pose_delay",
            "pose_rotation",
        ),
        reference="Mahony, Kumar, Corke, IEEE RAM 19(3), 2012, at the centre of mass",
        by_forces=True,
    ),
    EffectDescription(
        name="body_drag",
        domain=Domain.AIR,
        equation="f_k = -1/2 rho area_k |u| u_k along each body axis",
        parameters=same_for(
            tuple(f"area_{axis}" for axis in _XYZ),
            EffectParameter(
                unit="m2",
                low=0.0,
                high=0.05,
                typical=0.003,
                neutral=0.0,
                practical_minimum=0.001,
                meaning="drag coefficient times area",
                source="engineering estimate: 75 mm square, a third of it solid, coefficient 1.2 to 1.5",
                grows={"mass": 1},
            ),
        ),
        revealed_by="steady speed at two speeds at least: laps in both directions; climbs for area_z",
        confused_with=(
            "linear_drag",
            "rotor_drag",
            "inflow_thrust_loss",
            "translational_lift",
            "wind",
            "thrust_tilt",
            "pose_delay",
            "pose_rotation",
        ),
        reference="quadratic drag of a bluff body (Hoerner, Fluid-Dynamic Drag, 1965)",
        by_forces=True,
    ),
    EffectDescription(
        name="inflow_thrust_loss",
        domain=Domain.AIR,
        equation="F_i = F*_i - coefficient w_i u_z, u_z climb of the hub through the air",
        parameters={
            "coefficient": EffectParameter(
                unit="kg/rad",
                low=0.0,
                high=2e-5,
                typical=7.553e-7,
                neutral=0.0,
                practical_minimum=1.5e-07,
                meaning="loss of thrust per rotor speed and climb",
                source=_FOERSTER,
                grows={"mass": 1, "rotor_speed": -1},
            )
        },
        revealed_by="steady climbs and descents: vertical steps",
        confused_with=(
            "linear_drag",
            "thrust_curve",
            "motor_lag",
            "body_drag",
            "translational_lift",
        ),
        reference="blade element theory, first order in the inflow (Svacha, Mohta, Kumar, ICUAS 2017)",
        needs=(Needs.ROTOR_SPEED,),
        by_forces=True,
    ),
    EffectDescription(
        name="translational_lift",
        domain=Domain.AIR,
        equation="F_i = F*_i y^2, y^2 + inflow (v_i/v_h) y = 1 + inflow, v_i^2 (v_i^2 + u_xy^2) = v_h^4",
        parameters={
            "inflow": EffectParameter(
                unit="1",
                low=0.0,
                high=8.0,
                typical=1.0,
                neutral=0.0,
                practical_minimum=0.2,
                meaning="share of the thrust in still air that the rotor's own inflow costs",
                source="engineering estimate: blade at 17 deg, induced 5 m/s at 2060 rad/s and 22.5 mm",
            )
        },
        revealed_by="fast level flight: laps at several speeds",
        confused_with=(
            "thrust_curve",
            "inflow_thrust_loss",
            "body_drag",
        ),
        reference="Glauert, ARC R&M 1111, 1926; Leishman, Principles of Helicopter Aerodynamics, 2006, 2.14",
        by_forces=True,
    ),
    EffectDescription(
        name="ceiling_effect",
        domain=Domain.AIR,
        equation=(
            "F_i = F*_i y^2, y^2 + (inflow/gamma) y = 1 + inflow, "
            "gamma = 1/2 + 1/2 sqrt(1 + R^2 / (8 opening^2 d_i^2)), d_i hub to ceiling"
        ),
        parameters={
            "inflow": EffectParameter(
                unit="1",
                low=0.0,
                high=4.0,
                typical=1.0,
                neutral=0.0,
                practical_minimum=0.1,
                meaning="share of the open-air thrust that its own inflow costs; gain at contact less one",
                source="engineering estimate: blade at 17 deg, induced 5 m/s at 2060 rad/s and 22.5 mm",
                spread=0.5,
            ),
            "opening": EffectParameter(
                unit="1",
                low=0.1,
                high=1.0,
                typical=1.0,
                neutral=1.0,
                practical_minimum=0.1,
                meaning="share of the rotor's rim through which air can enter; neighbours block the rest",
                source="single rotor",
            ),
        },
        revealed_by="hovers within two rotor radii of the ceiling, at several distances",
        confused_with=(
            "thrust_scale",
            "tether",
        ),
        reference="Hsiao, Chirarattananon, IEEE/ASME Trans. Mechatronics 24(5), 2019 (arXiv 1905.04632)",
    ),
    EffectDescription(
        name="ground_effect",
        domain=Domain.AIR,
        equation="F_i = F*_i / (1 - strength (R / (4 h_i))^2), h_i hub above floor",
        parameters={
            "strength": EffectParameter(
                unit="1",
                low=0.0,
                high=20.0,
                typical=1.0,
                neutral=0.0,
                practical_minimum=0.3,
                meaning="1 is the single rotor; four rotors close together have more",
                source="Cheeseman and Bennett; 11.4 in gym-pybullet-drones for a Crazyflie 2",
            )
        },
        revealed_by="hovers within two rotor radii of the floor, at several heights",
        confused_with=(
            "thrust_scale",
            "tether",
        ),
        reference="Cheeseman, Bennett, ARC R&M 3021, 1955",
    ),
    EffectDescription(
        name="wind",
        domain=Domain.AIR,
        equation="u = v - wind, in all forces of the air",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="m/s",
                low=-30.0,
                high=30.0,
                typical=0.3,
                neutral=0.0,
                practical_minimum=0.1,
                meaning="velocity of the air along this world axis",
                source="engineering estimate: air conditioning and the vehicle's own circulation indoors",
            ),
        ),
        revealed_by="hover and laps in both directions, with a yaw by 180 deg",
        confused_with=(
            "linear_drag",
            "rotor_drag",
            "body_drag",
            "thrust_tilt",
            "tether",
            "pose_rotation",
        ),
        reference="constant wind",
        needs=(Needs.AIR_FORCE,),
        by_forces=True,
    ),
    EffectDescription(
        name="velocity_moment",
        domain=Domain.AIR,
        equation="tau_x = roll u_y, tau_y = -pitch u_x",
        parameters=same_for(
            ("roll", "pitch"),
            EffectParameter(
                unit="N s",
                low=-2e-3,
                high=2e-3,
                typical=1.2e-4,
                neutral=0.0,
                practical_minimum=1e-05,
                meaning="moment per speed; positive raises the leading edge",
                source="rotor drag of Foerster 2015 at 8200 rad/s in all, 14 mm above the centre of mass",
                grows={"mass": 1, "arm": 1},
            ),
        ),
        revealed_by="steady speed: laps in both directions",
        confused_with=(
            "motor_imbalance",
            "rotor_drag",
            "inertia_error",
            "com_offset",
        ),
        reference="blade flapping and height of the drag's centre (Mahony, Kumar, Corke 2012)",
    ),
    EffectDescription(
        name="rate_damping",
        domain=Domain.AIR,
        equation="tau_k = -damping_k w_k",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="N m s/rad",
                low=0.0,
                high=1e-4,
                typical=6e-6,
                neutral=0.0,
                practical_minimum=1e-06,
                meaning="damping of the turn about this body axis",
                source="inflow loss of Foerster 2015 on 32.5 mm arms at 8200 rad/s in all",
                grows={"mass": 1, "arm": 2},
            ),
        ),
        revealed_by="fast turns of the body: attitude doublets and chirps of several amplitudes",
        confused_with=(
            "motor_lag",
            "inertia_error",
        ),
        reference="climbing and sinking rotors of a turning vehicle lose and gain thrust",
    ),
)
