"""Gymnasium's environments: which there are, and how they are made and wrapped."""
