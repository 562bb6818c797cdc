"""The bench: what a drone weighs, how it turns and pushes, measured with instruments and procedures."""
