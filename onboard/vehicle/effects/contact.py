"""Effects of legs and feet."""

import math

from onboard.vehicle.effects.description import Domain, EffectDescription, EffectParameter, Needs

DESCRIPTIONS = (
    EffectDescription(
        name="leg_stiffness",
        domain=Domain.CONTACT,
        equation="K -> scale K, hinge and stop",
        parameters={
            "scale": EffectParameter(
                unit="1",
                low=0.02,
                high=50.0,
                typical=0.5,
                neutral=1.0,
                practical_minimum=0.2,
                meaning="factor on the stiffness of the hinges",
                source="never measured; the authors later used 0.5 N m/rad for 0.08 (errata 4)",
            )
        },
        revealed_by="landings: time and angle of the swing after the first foot holds",
        confused_with=(
            "inertia_error",
            "leg_damping",
            "foot_slip",
        ),
        reference="torsional hinge (paper, landing gear)",
        needs=(Needs.LEGS,),
    ),
    EffectDescription(
        name="leg_damping",
        domain=Domain.CONTACT,
        equation="c -> scale c",
        parameters={
            "scale": EffectParameter(
                unit="1",
                low=0.0,
                high=100.0,
                typical=3.0,
                neutral=1.0,
                practical_minimum=0.5,
                meaning="factor on the damping of the hinges",
                source="printed damping ratio 0.25, that of the model 0.08 (errata 4)",
            )
        },
        revealed_by="landings: decay of the swing after the first foot holds",
        confused_with=(
            "leg_stiffness",
            "foot_slip",
            "pad_damping",
        ),
        reference="torsional hinge (paper, landing gear)",
        needs=(Needs.LEGS,),
    ),
    EffectDescription(
        name="foot_slip",
        domain=Domain.CONTACT,
        equation="a foot holds up to adhesion_strength and needs minimum_preload, if these are the stricter",
        parameters={
            "adhesion_strength": EffectParameter(
                unit="N",
                low=0.0,
                high=100.0,
                typical=0.5,
                neutral=math.inf,
                practical_minimum=0.1,
                meaning="pull at which a foot comes off",
                source="engineering estimate: a dusty pad holds little more than the vehicle weighs",
            ),
            "minimum_preload": EffectParameter(
                unit="N",
                low=0.0,
                high=20.0,
                typical=0.3,
                neutral=0.0,
                practical_minimum=0.05,
                meaning="push that a foot needs to attach",
                source="engineering estimate: as much as the vehicle weighs",
            ),
        },
        revealed_by="landings at several speeds: which feet hold, and when one comes off",
        confused_with=(
            "leg_stiffness",
            "leg_damping",
            "pad_capture",
        ),
        reference="adhesive foot (docs/physics.md, Legs)",
        needs=(Needs.LEGS,),
    ),
    EffectDescription(
        name="pad_capture",
        domain=Domain.CONTACT,
        equation="a foot that touches sticks where v_n >= speed + spread z, z standard normal, one a landing",
        parameters={
            "speed": EffectParameter(
                unit="m/s",
                low=0.0,
                high=5.0,
                typical=0.7,
                neutral=0.0,
                practical_minimum=0.1,
                meaning="normal speed at which half of the touches stick",
                source="the authors' landings: rear feet come slowly and do not hold (docs/gap_landings.md)",
            ),
            "spread": EffectParameter(
                unit="m/s",
                low=0.0,
                high=5.0,
                typical=0.3,
                neutral=0.0,
                practical_minimum=0.1,
                meaning="standard deviation of that speed from landing to landing",
                source="likewise",
            ),
        },
        revealed_by="landings whose feet arrive at different speeds, or a leg that is thrown at the ceiling",
        confused_with=("foot_slip", "propeller_reach"),
        reference="bond grows with pressure and time of contact (Creton, Leibler, J. Polym. Sci. B 34, 1996)",
        needs=(Needs.LEGS,),
    ),
    EffectDescription(
        name="propeller_reach",
        domain=Domain.CONTACT,
        equation="R -> scale R where a propeller meets ceiling or floor",
        parameters={
            "scale": EffectParameter(
                unit="1",
                low=0.0,
                high=1.2,
                typical=0.64,
                neutral=1.0,
                practical_minimum=0.2,
                meaning="share of the propeller's radius that hits",
                source="two blades at any angle: 2/pi in the mean",
            )
        },
        revealed_by="landings in which propellers touch",
        confused_with=("pad_capture",),
        reference="rim of a disc in docs/physics.md, Hull and propellers",
    ),
    EffectDescription(
        name="pad_damping",
        domain=Domain.CONTACT,
        equation="M = -coefficient (u x du/dt) between ceiling and a foot that holds, u along the leg",
        parameters={
            "coefficient": EffectParameter(
                unit="N m s/rad",
                low=0.0,
                high=0.01,
                typical=8e-5,
                neutral=0.0,
                practical_minimum=2e-5,
                meaning="moment of a pad that is turned, per rate",
                source="the authors' flights: swings on two feet decay with a damping ratio of 0.022",
            )
        },
        revealed_by="a vehicle that swings on two feet: the decay of the swing",
        confused_with=("leg_damping",),
        reference="torsional friction of the pad, linear (docs/physics.md, Legs)",
        needs=(Needs.LEGS,),
    ),
)
