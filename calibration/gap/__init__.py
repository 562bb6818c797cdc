"""The gap finder: where simulation and measurement disagree, which effect is missing, and the proof."""
