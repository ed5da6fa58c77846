"""From a scene file to means with errors: scenes are loaded, and paths are traced by `measure`."""
