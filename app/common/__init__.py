"""What every package uses: errors, settings, the data folder, logging, schemas, state machines."""
