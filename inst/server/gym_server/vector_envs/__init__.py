"""Vector environments: many sub-environments that are played together."""
