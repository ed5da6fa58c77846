"""Commands with a SCENARIO: a target, seen through the air by a sensor."""
