"""The core's vertical guidance beside a log of Paparazzi: pure numerics, which import the core alone."""
