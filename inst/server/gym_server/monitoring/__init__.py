"""Recordings of episodes in files, as Gym's monitor wrote them."""
