"""Two recordings and rules in, their difference by meaning out: text, JSON, HTML, JUnit, rerun overlay."""
