"""Tables from which derivatives with respect to parameters are recorded along paths."""
