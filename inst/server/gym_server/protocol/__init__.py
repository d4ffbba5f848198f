"""What travels: JSON and safetensors in bodies, the fields of requests, answers."""
