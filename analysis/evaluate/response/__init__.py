"""What each place does over all instants of a test: ``lines`` from sums that add up, ``departures`` from them."""
