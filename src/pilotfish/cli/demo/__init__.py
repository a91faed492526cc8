"""The command `pilotfish demo`."""
