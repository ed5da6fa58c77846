"""Files of scatterometers."""

import pytest


@pytest.fixture
def file(tmp_path):
    """Write text (or bytes) to a file and return its path."""

    def write(content, name="scan.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
