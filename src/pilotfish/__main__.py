"""`python -m pilotfish` is the command `pilotfish`."""

from pilotfish.station import main

if __name__ == "__main__":
    main()
