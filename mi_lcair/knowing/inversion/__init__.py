"""What measurements say about a scene: unknown temperatures, materials and backgrounds."""
