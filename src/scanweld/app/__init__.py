"""The command line, the output folder and the report."""
