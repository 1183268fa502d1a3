"""Numbers: the jit policy, tolerances with reasons, rigid transforms in batch, closed-form integrals."""
