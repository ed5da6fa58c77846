"""Sections of derivatives by facet: those of a table of facets."""

from mi_lcair.reports.sections.facets import sections

__all__ = ["sections"]
