"""The two-stage policy: model, files, bundle, and the arithmetic that drone and host share."""
