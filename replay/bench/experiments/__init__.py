"""The thesis's experiments I to IV: splitting, fitting a curve, predicting other plates and a pivoting one."""
