"""Pictures of single results, beside those of whole reports: each module has `figure`."""
