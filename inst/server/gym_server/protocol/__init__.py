"""What bodies hold: JSON, safetensors, the fields of requests, answers."""
