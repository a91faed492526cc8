"""The command `pilotfish stream`: lines, batches, signals and files of one session."""
