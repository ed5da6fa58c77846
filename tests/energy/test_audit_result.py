"""Words and tables of an audit."""

import numpy as np

from mi_lcair.energy.audit_result import Audit

FLUX = {"incident": (50.0, 2.0), "absorbed": (30.0, 1.0)}
AUDIT = Audit(
    scene_name="room",
    band="LWIR",
    total={"emitted": (100.0, 1.0), "balance": (0.5, 0.2)},
    materials={"paint": FLUX},
    shares={
        "scene": {"emitted": (1.0, 0.0), "balance": (0.005, 0.002)},
        "paint": {"incident": (1.0, 0.0), "absorbed": (0.6, 0.01)},
    },
    remarks=[],
    photons=1000,
)


def test_summary():
    assert AUDIT.summary() == (
        "audit of room, LWIR: 100 +- 1 W emitted, balance 0.5 +- 0.2 % of it (standard errors), "
        "no remarks"
    )


def test_entries_and_rows():
    entries = AUDIT.entries()
    assert entries["total"]["balance"] == {"value_W": 0.5, "standard_error_W": 0.2}
    assert entries["materials"]["paint"]["absorbed"] == {"value_W": 30.0, "standard_error_W": 1.0}
    assert entries["shares"]["paint"]["absorbed"] == {"value": 0.6, "standard_error": 0.01}
    assert all(len(column) == 4 for column in AUDIT.columns().values())
    assert np.isfinite(
        np.concatenate([c for c in AUDIT.columns().values() if c.dtype == float])
    ).all()
