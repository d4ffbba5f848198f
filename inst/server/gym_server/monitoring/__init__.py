"""Record episodes to files, as Gym's monitor did."""
