"""What is checked and derived when a scene file is loaded, before anything is rendered."""
