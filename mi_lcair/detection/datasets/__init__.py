"""Data sets: labelled frames of a camera from many views, with the truth, poses and a card."""
