"""The command `pilotfish demo`: learn, reproduce and simulate the published valve experiment."""
