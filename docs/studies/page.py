"""What the studies that write a page share: the names of scenes, and filling in the template."""

from pathlib import Path

from mi_lcair.files import replacing


def label(name: str, parameters: dict) -> str:
    """Return the name of a scene with its parameters."""
    return " ".join([name, *(f"{key}={value}" for key, value in parameters.items())])


def write_page(page, study: str, /, **fields) -> None:
    """Write a page from STUDY.template.md, whose {fields} are filled in."""
    template = Path(__file__).with_name(f"{study}.template.md").read_text(encoding="utf-8")
    with replacing(page) as partial:
        partial.write_text(template.format(**fields), encoding="utf-8")
