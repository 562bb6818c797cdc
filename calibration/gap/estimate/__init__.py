"""Fits of effects to flights: a linear mixed model under coloured noise, and when its result is believed."""
