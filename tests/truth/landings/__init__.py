"""Landings that the simulation's code has no part in: ordinary flight files, and a sealed answer."""
