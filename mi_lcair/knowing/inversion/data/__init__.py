"""Measurements of an inverse problem: their entries, their files and their scenes."""
