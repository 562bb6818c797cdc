"""The gap finder: where simulation and measured flights disagree, which effect is missing, and proof of it."""
