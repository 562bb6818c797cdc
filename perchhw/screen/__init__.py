"""What the operator sees of a flight, and the keys: one calm screen, or a line per change without a terminal.

The screen is a process of its own (``python -m perchhw.screen``). The flight only leaves its newest readings
where a thread picks them up; keys that end a flight come back as signals, the way of Ctrl-C. So a screen that
fails, or a terminal that takes nothing, changes nothing for the flight.
"""
