"""Seeded fuzzing: valid inputs are edited at random, and each must be accepted or refused in one line."""
