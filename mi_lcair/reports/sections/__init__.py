"""Sections of results, one file for each kind, which the console and pages show."""
