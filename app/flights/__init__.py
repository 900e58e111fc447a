"""What flies: the queue of requested flights, the runner, vehicle processes, abort, and the record spool."""
