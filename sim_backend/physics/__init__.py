"""The physics of the world: rigid body, motors, battery, air, sprung adhesive legs, ceiling and floor.

Compiled kernels over numpy records, the same code for one vehicle and for a hundred thousand. The model, its
equations and its known error are in ``docs/physics.md``.
"""
