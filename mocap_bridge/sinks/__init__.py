"""Where poses go: one module per receiver, each with ``send_pose``."""
