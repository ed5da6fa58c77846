"""Commands that state how certain a result is."""
