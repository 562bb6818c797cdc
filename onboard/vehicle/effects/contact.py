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
        ),
        reference="adhesive foot (docs/physics.md, Legs)",
        needs=(Needs.LEGS,),
    ),
)
