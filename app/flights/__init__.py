"""What flies: the rows of requested flights, the runner, vehicle processes, abort, and the record spool."""
