"""The effects: deviations from the base model that a vehicle file may declare, one module each.

A module of an effect holds its equation, as a kernel where it runs during flight, and an ``EFFECT`` that says
how its parameters get into the record (:class:`sim_backend.physics.effects.term.EffectTerm`). What the
parameters are stands in :data:`onboard.vehicle.effects.EFFECTS`. :mod:`.registry` collects the modules;
:mod:`.command` and :mod:`.wrench` run those that act during flight, and ``motors`` those of the rotors.
"""
