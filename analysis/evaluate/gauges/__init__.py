"""Virtual gauges and extensometers on a strain field."""
