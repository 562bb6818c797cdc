"""The ladder to the first flight: steps with pass and fail, each refused until the one below has passed."""
