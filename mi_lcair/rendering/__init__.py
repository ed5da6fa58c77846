"""From a scene XML to a radiance image: `scene.load`, `render.render`, `image.write_exr`."""
