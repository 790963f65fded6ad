"""The measuring of ray casters, samplers and compressors, and its reports."""
