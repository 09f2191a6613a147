"""The benchmarks' and the command line's own nodes."""
