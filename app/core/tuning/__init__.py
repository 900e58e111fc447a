"""The tuning method: calibration, corrected model, predictions, gate, strategies, stop rules and proposals."""
