"""The twin of a body: inputs of its heat balance from a day of frames and temperatures."""
