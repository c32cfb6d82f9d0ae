"""Whether a machine can follow a curve: certified between samples, refused in words."""
