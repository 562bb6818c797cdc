"""Flights of programs that share no equation with the gap finder, with something hidden in them."""
