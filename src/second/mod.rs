//! The second route: the bond graph's own equations, integrated without any circuit.
