"""Label flights: how each of them ended on the ceiling, with the evidence.

    python examples/label_flights.py [FILE or FOLDER ...]

Takes records, CSV and the other formats of docs/records.md; without any it simulates five approaches. Prints
a line a flight with what made the label, and the files that hold no flight.
"""

import sys

import perchhw
from perchhw.label import LabelError

vehicle = perchhw.load_vehicle("crazyflie21-upgraded")
if len(sys.argv) > 1:
    flights, unusable = perchhw.open_flights(*sys.argv[1:])
else:
    policy, unusable = perchhw.load_policy(), []
    flights = [perchhw.simulate_approach(policy, 2.5, angle_deg, seed=4) for angle_deg in range(30, 80, 10)]

for flight in flights:
    try:
        label = perchhw.label_flight(flight, vehicle)
    except LabelError as error:
        print(f"{flight.name}: no label: {error}")
        continue
    limits = f" ({'; '.join(label.limits)})" if label.limits else ""
    print(f"{flight.name}: {label.outcome}, by {label.method}{limits}")
for file in unusable:
    print(f"{file.file}: {file.reason}")
