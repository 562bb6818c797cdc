"""The onboard landing: its state machine, own attitude, braking, and the data they work on."""
