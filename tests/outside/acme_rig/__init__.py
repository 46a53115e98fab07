"""The Acme M7, a voltmeter that nobody makes, for rigs: its driver and its twin."""
