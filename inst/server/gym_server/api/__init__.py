"""The protocol's routes: who may call them, their fields and responses, idempotency keys."""
