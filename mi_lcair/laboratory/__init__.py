"""What a laboratory measures: cavities, thermography, and the audit of energy."""
