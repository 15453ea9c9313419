"""The REBA method: tables, rules, step table, and the vectorised scores of postures."""
