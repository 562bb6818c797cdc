"""The search for missing effects: which are offered, which is taken, which of them earn a name."""
