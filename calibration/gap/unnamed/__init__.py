"""Where a residual lives and what no named effect explains; ``docs/gap_localisation.md``."""
