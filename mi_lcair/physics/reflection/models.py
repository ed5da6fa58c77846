"""All reflection models, loaded at the import of this module."""

from mi_lcair.physics.reflection import NAMES, model

MODELS = {name: model(name) for name in NAMES}
