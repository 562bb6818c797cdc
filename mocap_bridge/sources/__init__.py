"""Where poses come from: one module per protocol, each behind the ``PoseStream`` contract."""
