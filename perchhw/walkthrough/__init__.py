"""What walk-throughs share: steps that are done once, flights in the simulated lab, landing rates."""
