"""The routes of the protocol, who may call them, and that each call is done once."""
