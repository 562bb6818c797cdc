"""The drone's own code in C: ``core`` is what flies, ``host`` makes a library of it, the rest loads that."""
