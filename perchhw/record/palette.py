"""Colours that stay apart for every kind of colour vision.

Okabe and Ito, "Color Universal Design", 2008: https://jfly.uni-koeln.de/color/
"""

Colour = tuple[int, int, int]

ORANGE: Colour = (230, 159, 0)
SKY: Colour = (86, 180, 233)
GREEN: Colour = (0, 158, 115)
BLUE: Colour = (0, 114, 178)
VERMILION: Colour = (213, 94, 0)
PURPLE: Colour = (204, 121, 167)
GREY: Colour = (150, 156, 164)

AXES = (VERMILION, SKY, ORANGE)
"""Of x, y and z: they differ in lightness too, so that they stay apart in print."""
FOUR = (VERMILION, SKY, ORANGE, GREEN)
"""Of M1 to M4."""
