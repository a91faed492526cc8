"""The command `pilotfish stream`: sources of events, the session that learns from them, and its options."""
