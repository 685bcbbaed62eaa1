//! BondGraph + Causality → Netlist + map.
