"""The scenes, by kind: each file is one kind, each function one feature."""
