"""Terminal output, tables, pictures and reports of the commands."""
