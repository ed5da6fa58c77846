"""What the files of modelling programs leave open: formats, axes, and what each name means."""
