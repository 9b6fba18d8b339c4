"""CasADi expressions compiled to SIMD machine code."""
