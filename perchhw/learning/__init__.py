"""Learning a landing policy: sweep of approach conditions, trigger and action policy, validation."""
