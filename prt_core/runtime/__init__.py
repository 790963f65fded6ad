"""What all work shares: progress, threads, the machine's limits, random stages, whole files."""
