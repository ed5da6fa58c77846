"""Heat that facets exchange by radiation: conductors between them, and absorbed sunlight."""
