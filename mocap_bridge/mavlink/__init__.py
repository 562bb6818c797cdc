"""MAVLink 2 over UDP: what a ground station is told, what a vehicle is sent, what is taken for poses."""
