"""Effects of masses and levers, and of a string."""

from onboard.vehicle.effects.description import (
    Domain,
    EffectDescription,
    EffectParameter,
    Needs,
    same_for,
)

_XYZ = ("x", "y", "z")
_ROTOR_INERTIA = {
    "rotor_inertia": EffectParameter(
        unit="kg m2",
        low=0.0,
        high=1e-6,
        typical=1.9e-8,
        neutral=0.0,
        meaning="one rotor with its propeller about its axis",
        source="engineering estimate: 0.35 g propeller of 45 mm as a plate, and rotor of the motor",
    )
}

DESCRIPTIONS = (
    EffectDescription(
        name="rotor_gyroscopic",
        domain=Domain.RIGID_BODY,
        equation="tau = -w x (J H e_z), H = w_1 - w_2 + w_3 - w_4",
        parameters=_ROTOR_INERTIA,
        reference="angular momentum of the rotors (Mahony, Kumar, Corke 2012)",
        needs=(Needs.ROTOR_SPEED,),
    ),
    EffectDescription(
        name="rotor_acceleration_torque",
        domain=Domain.RIGID_BODY,
        equation="tau_z = -J d(w_1 - w_2 + w_3 - w_4)/dt",
        parameters=_ROTOR_INERTIA,
        reference="angular momentum of the rotors (Mahony, Kumar, Corke 2012)",
        needs=(Needs.ROTOR_SPEED,),
    ),
    EffectDescription(
        name="mass_error",
        domain=Domain.RIGID_BODY,
        equation="m -> m (1 + relative)",
        parameters={
            "relative": EffectParameter(
                unit="1",
                low=-0.5,
                high=1.0,
                typical=0.03,
                neutral=0.0,
                meaning="true over filed mass, less one",
                source="a deck or another battery weighs about 1 g",
            )
        },
        reference="equation of motion",
    ),
    EffectDescription(
        name="inertia_error",
        domain=Domain.RIGID_BODY,
        equation="I_kk -> I_kk (1 + relative_k)",
        parameters=same_for(
            ("xx", "yy", "zz"),
            EffectParameter(
                unit="1",
                low=-0.6,
                high=2.0,
                typical=-0.1,
                neutral=0.0,
                meaning="true over filed inertia, less one",
                source="printed values are 8 to 12 % above the authors' own swings (errata 3)",
            ),
        ),
        reference="Euler's equation",
    ),
    EffectDescription(
        name="com_offset",
        domain=Domain.RIGID_BODY,
        equation="hubs, hips and hull lie at r - (x, y, z) from the centre of mass",
        parameters=same_for(
            _XYZ,
            EffectParameter(
                unit="m",
                low=-0.02,
                high=0.02,
                typical=0.002,
                neutral=0.0,
                meaning="centre of mass from the middle between the rotors",
                source="engineering estimate: a battery that is 10 mm off its place",
            ),
        ),
        reference="levers of the rotors",
    ),
    EffectDescription(
        name="thrust_tilt",
        domain=Domain.RIGID_BODY,
        equation="thrust along (tan x, tan y, 1), normed, at each hub",
        parameters=same_for(
            ("x", "y"),
            EffectParameter(
                unit="rad",
                low=-0.2,
                high=0.2,
                typical=0.02,
                neutral=0.0,
                meaning="lean of the rotors' axes towards this body axis",
                source="motion-capture frames tilted by 0.5 to 4.3 deg look the same (NanoBench flights)",
            ),
        ),
        reference="bent arms; body frame that is not that of the rotors",
    ),
    EffectDescription(
        name="tether",
        domain=Domain.RIGID_BODY,
        equation="T = stiffness (|a - p| - length) + damping d|a - p|/dt towards a, where taut and positive",
        parameters={
            **same_for(
                _XYZ,
                EffectParameter(
                    unit="m",
                    low=-50.0,
                    high=50.0,
                    typical=0.0,
                    neutral=None,
                    meaning="end of the string in the world",
                    source="a place in the room",
                ),
            ),
            "length": EffectParameter(
                unit="m",
                low=0.0,
                high=50.0,
                typical=1.0,
                neutral=None,
                meaning="length at which the string is taut",
                source="a safety line in a room",
            ),
            "stiffness": EffectParameter(
                unit="N/m",
                low=0.0,
                high=100.0,
                typical=0.2,
                neutral=None,
                meaning="pull per stretch",
                source="engineering estimate: soft rubber thread",
            ),
            "damping": EffectParameter(
                unit="N s/m",
                low=0.0,
                high=10.0,
                typical=0.0,
                neutral=0.0,
                meaning="pull per rate of stretch",
                source="engineering estimate",
            ),
        },
        reference="string that pulls and never pushes, at the centre of mass",
    ),
)
