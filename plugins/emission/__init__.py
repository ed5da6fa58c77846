"""What emits in a scene: emissivities, sources, and the table from which emitters are drawn."""
