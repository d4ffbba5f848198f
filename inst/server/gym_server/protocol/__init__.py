"""What travels over HTTP: JSON and safetensors bodies, request fields, responses."""
