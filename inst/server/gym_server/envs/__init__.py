"""Gymnasium's environments: which exist, and how to make and wrap them."""
