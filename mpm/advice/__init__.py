"""What is said of a case before it runs: engineering numbers, a sketch, what is silent, idle or questionable."""
