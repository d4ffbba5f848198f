"""The protocol's routes: who may call them, what they take and answer, each call done once."""
