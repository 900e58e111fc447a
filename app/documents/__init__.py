"""Documents that need neither Gainline nor a network: one HTML file each, for reports and analysed logs."""
