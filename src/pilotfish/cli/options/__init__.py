"""Options of the commands: parsing, names and shared decorators."""
