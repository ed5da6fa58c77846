"""Whether a model describes the data, and how well these determine its parameters."""
