"""The study of assistance under delay: its folder, its runs on all cores, its tables and figures."""
