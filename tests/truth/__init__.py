"""Programs that know the truth, by which tests and benchmarks judge the gap finder, fits and campaigns.

Those that fly share no equation with the finder, and hide something in their flights: ``hidden_effects``,
the MuJoCo room of ``drawn``, crazyflow in ``published``, the wind of ``tunnel``, and ``landings``. ``bench``
makes what instruments see, ``landing_rate_maps`` what campaigns map.
"""
