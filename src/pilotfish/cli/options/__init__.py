"""Types of command-line options, and the names that they accept."""
