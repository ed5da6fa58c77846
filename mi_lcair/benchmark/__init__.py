"""The methods of Harkiss 2007 beside ours, one a file: what charts of error against time compare."""
