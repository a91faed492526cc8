"""The commands of pilotfish, one module each."""
